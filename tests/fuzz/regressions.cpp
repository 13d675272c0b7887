#include "fuzz/fuzz_target.h"
#include "support/fbx_writer.h"
#include "support/gltf_writer.h"
#include "support/onnx_file.h"
#include "support/scan_files.h"

namespace doppel::fuzz {

namespace {

namespace wire = support::wire;
using support::GltfWriter;
using Json = GltfWriter::Json;

std::string repeated(const std::string& part, int times) {
  std::string text;
  for (int i = 0; i < times; ++i) text += part;
  return text;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);  // throws where the text does not hold it
}

/// The arm with one change, as a .glb.
template <typename Change>
std::string changed_arm(const Change& change) {
  GltfWriter file = support::bending_arm();
  change(file);
  return file.glb();
}

/// The arm of FBX with one change of its records, as text.
template <typename Change>
std::string changed_fbx(const Change& change) {
  FbxNode root = support::fbx_arm();
  change(root.children[2].children, root.children[3].children);  // objects, connections
  return support::fbx_text(root);
}

void add_gltf(std::vector<Regression>& all) {
  all.push_back({"gltf", "nested objects took all of the stack", repeated("{\"a\":\n", 200'000)});
  all.push_back({"gltf", "a nested value in a message took all of the stack",
                 "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"children\":[" + repeated("[", 100'000) +
                     repeated("]", 100'000) + "]}]}"});
  all.push_back({"glb", "a huge number became an int",
                 changed_arm([](GltfWriter& file) { file.json["accessors"][0]["componentType"] = 1e300; })});
  all.push_back({"glb", "a huge number became an int",
                 changed_arm([](GltfWriter& file) { file.json["meshes"][0]["primitives"][0]["mode"] = -1e300; })});
  all.push_back({"glb", "rows of zeros without data took 1.4 GB", changed_arm([](GltfWriter& file) {
                   Json& accessor = file.json["accessors"][0];
                   accessor.erase("bufferView");
                   accessor["count"] = 60'000;
                   accessor["sparse"] = {{"count", 0},
                                         {"indices", {{"bufferView", 0}, {"componentType", 5123}}},
                                         {"values", {{"bufferView", 0}}}};
                 })});
  all.push_back({"glb", "each node used all primitives: memory grew with the square of the file",
                 changed_arm([](GltfWriter& file) {
                   const Json primitive = file.json["meshes"][0]["primitives"][0];
                   for (int i = 0; i < 1000; ++i) file.json["meshes"][0]["primitives"].push_back(primitive);
                   for (int i = 0; i < 400; ++i) file.json["nodes"].push_back({{"mesh", 0}});
                 })});
  all.push_back({"glb", "an image announces 30000 x 30000 pixels", changed_arm([](GltfWriter& file) {
                   const std::string png("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x75\x30\0\0\x75\x30\x08\x02\0\0\0\0\0\0\0",
                                         33);
                   file.json["images"] = {{{"bufferView", file.view({png.begin(), png.end()})}}};
                   file.json["textures"] = {{{"source", 0}}};
                   file.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
                 })});
}

FbxNode connection(std::int64_t lower, std::int64_t upper) { return {"C", {std::string("OO"), lower, upper}, {}}; }

void add_fbx(std::vector<Regression>& all) {
  all.push_back(
      {"fbx_text", "nodes in a circle were followed for ever", changed_fbx([](auto& objects, auto& connections) {
         connections.insert(connections.begin(), connection(2, 3));
         // Bind poses that disagree make the reader ask for the position of the mesh.
         objects[7].children[3].values = {std::vector<double>(16, 2.0)};
         connections.push_back(connection(1, 2));
       })});
  all.push_back({"fbx_text", "a huge number became an int", changed_fbx([](auto& objects, auto&) {
                   objects[2].children[0].children.push_back(support::fbx_property70("RotationOrder", {1e300}));
                 })});
  all.push_back({"fbx_text", "objects with one id: surfaces grew with the square of the file",
                 changed_fbx([](auto& objects, auto& connections) {
                   for (int i = 0; i < 1500; ++i) objects.push_back(objects[1]);
                   for (int i = 0; i < 1500; ++i) connections.push_back(connection(10, 1));
                 })});
  FbxNode bomb = support::fbx_arm();
  for (int i = 0; i < 60; ++i) bomb.children.push_back({"Zeros", {std::vector<std::int32_t>(200'000, 0)}, {}});
  all.push_back({"fbx_binary", "compressed zeros took a thousand times the file", fbx_binary(bomb, 7400, true)});
}

void add_character(std::vector<Regression>& all) {
  const std::string header = "Skeletool Skeleton Definition V1.0\njoints: 1\n  root ";
  const std::string rest = "\nmarkers: 0\nscaling joints: 0\ndofs: 0\ntextureEntries: 0\n";
  all.push_back({"skeleton", "the product of offset and scale is infinite",
                 header + "prismatic none 1e300 0 0 1 0 0 1e300" + rest});
  all.push_back({"skeleton", "the length of an axis is infinite, which made the axis zero",
                 header + "revolute none 0 0 0 1e200 0 0 1" + rest});
  all.push_back({"obj", "a vertex became infinite as float", "v 1e45 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n"});
  std::string joints = "HIERARCHY\nROOT a { OFFSET 0 0 0 CHANNELS 1 Xposition\n";
  for (int j = 0; j < 20'000; ++j) joints += "JOINT " + std::to_string(j) + " { OFFSET 0 0 0 }\n";
  all.push_back({"bvh", "joints without channels cost time in each frame",
                 joints + "}\nMOTION\nFrames: 20000\nFrame Time: 0.04\n" + repeated("0\n", 20'000)});
}

void add_calibration(std::vector<Regression>& all) {
  const std::string yaml = "%YAML:1.0\n---\n";
  const std::string matrix = "{rows: 3, cols: 3, data: [800, 0, 320, 0, 800, 240, 0, 0, 1]}";
  const auto camera = [&](const std::string& t) {
    return yaml + "units: millimetres\ncam0: {width: 640, height: 480, K: " + matrix +
           ", R: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}, t: [" + t + "]}\n";
  };
  for (const char* open : {"[", "{\"a\":", "- ", "{a: ["})
    all.push_back(
        {"calibration_opencv", "OpenCV's parser calls itself for each level", yaml + "K: " + repeated(open, 100'000)});
  all.push_back({"calibration_opencv", "OpenCV's XML parser calls itself for each level",
                 "<?xml version=\"1.0\"?><opencv_storage>" + repeated("<a>", 100'000)});
  all.push_back({"calibration_opencv", "an alias stands inside of what it names", yaml + "K: {\"a\": &a {b: *a}}\n"});
  all.push_back({"calibration_opencv", "the largest number makes an infinite position", camera("1e308, 1e308, 1e308")});
  all.push_back({"calibration_opencv", "the name nan was read as a number and lost",
                 replaced(camera("0, 0, 1"), "{width", "{name: nan, width")});
  all.push_back({"calibration_opencv", "a name leads out of the folder",
                 replaced(camera("0, 0, 1"), "{width", "{name: ../../../x, width")});
}

void add_files(std::vector<Regression>& all) {
  all.push_back({"store_layout", "a huge number became an int",
                 "{\"doppel_store\":1,\"settings\":\"\",\"num_dofs\":1e308,\"mask_size\":1,\"image_size\":1,"
                 "\"cameras\":[]}"});
  all.push_back({"torch_pickle", "a pickle had no limit for values", "\x80\x02" + repeated("N", 3'000'000) + "."});
  std::string shapes = "\x80\x02(" + repeated("K\x01", 30'000) + "tq\x01" + repeated("h\x01", 1000) + ".";
  all.push_back({"torch_pickle", "a long tuple was copied for each use", shapes});
  all.push_back({"capture", "values without masks were lost when written",
                 "doppel_capture: 1\nname: a\ncalibration: c.toml\nkeypoint_filter: {window: 0, sigma: 7}\n"
                 "sequences:\n- {name: a, split: train, videos: v.mp4, mask_threshold: 7, largest_component: true}\n"});
  all.push_back(
      {"config", "control characters of a file stood in the message", "a: \"\\e[2J\\e[H\"\nb: {\"\\a\": 1}\n"});
}

/// An ONNX file with one graph of these parts.
std::string onnx_of(const std::vector<std::string>& nodes, const std::string& constant) {
  std::string graph = wire::field(5, constant);
  for (const std::string& node : nodes) graph += wire::field(1, node);
  return wire::field(7, graph);
}

std::string onnx_node(const std::string& type, const std::vector<std::string>& inputs, const std::string& output,
                      const std::string& attribute = "") {
  std::string node;
  for (const std::string& input : inputs) node += wire::field(1, input);
  node += wire::field(2, output) + wire::field(4, type);
  return attribute.empty() ? node : node + wire::field(5, attribute);
}

std::string onnx_constant(const std::vector<std::uint64_t>& dims, const std::vector<float>& values) {
  std::string tensor;
  for (const std::uint64_t size : dims) tensor += wire::field(1, size);
  return tensor + wire::field(2, std::uint64_t{1}) + wire::field(8, std::string("rows")) +
         wire::field(9, wire::raw(values));
}

void add_networks(std::vector<Regression>& all) {
  const std::string axes = support::OnnxFile::ints("axes", {0}), product = onnx_node("Mul", {"wide", "rows"}, "out");
  all.push_back(
      {"onnx", "dimensions whose product is 1 modulo 2^64 were read beyond the constant",
       onnx_of({onnx_node("Unsqueeze", {"x"}, "wide", axes), product}, onnx_constant({67280421310721, 274177}, {1}))});
  all.push_back({"onnx", "an operator without inputs threw std::out_of_range",
                 onnx_of({onnx_node("Unsqueeze", {}, "wide", axes), product}, onnx_constant({2, 2}, {1, 2, 3, 4}))});
  const std::vector<std::string> many(500, product);
  all.push_back({"onnx", "each product with one row took 16 MB",
                 onnx_of(many, onnx_constant({2048}, std::vector<float>(2048, 1.0F)))});
  const std::string low = wire::field(2, std::uint64_t{1}) + wire::field(8, std::string("low")) +
                          wire::field(9, wire::raw(std::vector<float>{-1}));
  all.push_back({"onnx", "of the test: it wanted a network unchanged for damage in a constant that no edit reads",
                 wire::field(7, wire::field(5, low) + wire::field(5, wire::field(1, std::string("\xff"))) +
                                    wire::field(1, onnx_node("Clip", {"x", "low"}, "out")))});
  all.push_back({"network_config", "files that name each other were read for ever",
                 joined({"config: b.yaml\nmodel: c.onnx\n", "config: a.yaml\n"})});
}

void add_weights(std::vector<Regression>& all) {
  const auto text = [](const std::string& t) {
    return "X" + std::string(1, static_cast<char>(t.size())) + std::string(3, '\0') + t;
  };
  const std::string tensor = "ctorch._utils\n_rebuild_tensor_v2\n((" + text("storage") + "ctorch\nFloatStorage\n" +
                             text("0") + text("cpu") + "K\x01tQK" + std::string(1, '\0') + "(K\x01t(K\x01t\x89" +
                             "ccollections\nOrderedDict\n)RtR";
  all.push_back({"torch_weights", "a name that is not in UTF-8 ended the writer by an exception of the JSON library",
                 joined({"\x80\x02}(" + text("\xff") + tensor + "u.", std::string(4, '\1')})});
  std::string archive = target_of("script_archive").seeds[0];
  archive[archive.rfind("code/")] = '\0';  // in the list of parts
  all.push_back({"script_archive", "of the test: it unpacked a part that LibTorch lists and refuses", archive});
}

void add_json(std::vector<Regression>& all) {
  const std::string deep = repeated("[", 200'000) + repeated("]", 200'000);
  all.push_back({"shard", "a nested value was copied level by level",
                 R"({"doppel_shard":1,"version":"0","shard":"0/1","finished":true,"arguments":["track"],"inputs":[],)"
                 "\"results\":" +
                     deep + "}"});
  all.push_back({"shard", "a number too large for an integer was converted to one", R"({"doppel_shard":1e+308})"});
  all.push_back({"shard", "a message held all of a text", "{\"a\":\"" + repeated("x", 100'000)});
  all.push_back(
      {"motions_json", "a nested value was copied level by level", "{\"motions\":[{\"file\":" + deep + "}]}"});
}

}  // namespace

std::vector<Regression> regressions() {
  std::vector<Regression> all;
  add_gltf(all);
  add_fbx(all);
  add_character(all);
  add_calibration(all);
  add_files(all);
  add_networks(all);
  add_json(all);
  add_weights(all);
  all.push_back({"joints", "nested values", "{\"joints\":" + repeated("{\"a\":\n", 200'000)});
  const std::string box = support::collada_file(support::coloured_box({-0.5, 0, 0}, {0.5, 2, 1}), 1, "Y_UP");
  all.push_back({"collada", "assimp read one index for ever", replaced(box, "<p>0 0", "<p>0\xff")});
  all.push_back(
      {"collada", "assimp reserved memory for a count", replaced(box, "count=\"24\"", "count=\"3600000000\"")});
  all.push_back({"collada", "assimp read behind an empty array", replaced(box, "count=\"24\"", "count=\"-0\"")});
  all.push_back({"collada", "nested nodes took all of the stack",
                 "<COLLADA version=\"1.4.1\"><library_visual_scenes><visual_scene id=\"s\">" +
                     repeated("<node>", 50'000) + repeated("</node>", 50'000) +
                     "</visual_scene></library_visual_scenes></COLLADA>"});
  return all;
}

}  // namespace doppel::fuzz
