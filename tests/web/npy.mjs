import { readFileSync } from 'node:fs';

// A .npy file of version 1 with float32: { shape, values }.
export function readNpy(path) {
  const bytes = readFileSync(path), size = bytes.readUInt16LE(8);
  const header = bytes.toString('latin1', 10, 10 + size);
  if (!header.includes("'<f4'")) throw new Error(`${path}: ${header} is not float32`);
  const shape = /'shape': \(([^)]*)\)/.exec(header)[1].split(',').filter((text) => text.trim()).map(Number);
  const data = bytes.buffer.slice(bytes.byteOffset + 10 + size, bytes.byteOffset + bytes.length);
  return { shape, values: new Float32Array(data) };
}
