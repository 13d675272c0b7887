// The glTF validator of Khronos finds no error and no warning in .glb files.
//   node validate_glb.mjs FILE.glb ...     exit code 1: a file fails
import { readFileSync } from 'node:fs';
import { pathToFileURL } from 'node:url';
import validator from 'gltf-validator';

// The validator does not know KHR_gaussian_splatting and takes its names of attributes, which have a colon, for wrong.
const known = ({ code, pointer }) =>
  code === 'MESH_PRIMITIVE_INVALID_ATTRIBUTE' && pointer.includes('/attributes/KHR_gaussian_splatting:');

export async function validate(path) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(path)), { uri: path, maxIssues: 0 });
  const faults = report.issues.messages.filter((message) => message.severity < 2 && !known(message));
  for (const { code, message, pointer } of faults) console.error(`${path}: ${code}: ${message} ${pointer}`);
  const count = (severity) => faults.filter((message) => message.severity === severity).length;
  console.log(`${path}: ${count(0)} errors, ${count(1)} warnings`);
  return faults.length === 0;
}

if (import.meta.url === pathToFileURL(process.argv[1]).href) {
  let good = true;
  for (const path of process.argv.slice(2)) good = (await validate(path)) && good;
  process.exit(good ? 0 : 1);
}
