#include <cmath>

#include "../tools/shard_folder.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/npy.h"
#include "doppel/core/pickle.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/prepare/store_layout.h"
#include "doppel/geometry/image_orientation.h"
#include "doppel/io/motion_import/npz_file.h"
#include "doppel/nets/weights/torch_pickle.h"
#include "fuzz/fuzz_target.h"
#include "io/motion_import/motion_writers.h"
#include "support/oriented_image.h"
#include "support/temporary_folder.h"

namespace doppel::fuzz {
namespace {

using Path = std::filesystem::path;
using namespace std::string_literals;

const FileLocation kWhere{"a.file", 0};

void check_npy(const NpyArray& array) {
  promise(array.size() >= 0, "arrays have a size");
  if (array.type != "<f4" && array.type != "<f8") array.as<std::int64_t>();
  promise(static_cast<std::int64_t>(array.as<double>().size()) == array.size(), "arrays are whole");
}

void read_npz_bytes(std::string_view bytes, const Path& folder) {
  const NpzFile file(written(bytes, folder, "a.npz"));
  for (const std::string& name : file.names()) check_npy(file.read(name));
}

void read_pickle_bytes(std::string_view bytes, const Path& /*folder*/) {
  const Pickle pickle = read_pickle(bytes, kWhere);
  for (const double value : numbers(pickle.root, 0, "the root", kWhere))
    promise(std::isfinite(value), "numbers are finite");
}

void read_torch_bytes(std::string_view bytes, const Path& /*folder*/) {
  const PickledDictionary dictionary = read_torch_pickle(bytes, kWhere);
  std::size_t texts = 0;
  for (const auto& [name, text] : dictionary.texts) texts += text.size();
  promise(texts <= 64 << 20, "texts are limited");
  for (const PickledTensor& tensor : dictionary.tensors)
    promise(tensor.shape.size() == tensor.stride.size() && tensor.shape.size() <= 16, "tensors are described");
}

void read_config_bytes(std::string_view bytes, const Path& /*folder*/) {
  const ConfigDocument document = ConfigDocument::parse(std::string(bytes), "a.yaml");
  const ConfigReader root = document.root();
  for (const std::string& key : root.keys())
    if (root.has_section(key)) root.section(key).keys();
  ConfigDocument::parse(document.resolved(), "again.yaml");
}

void read_capture_bytes(std::string_view bytes, const Path& folder) {
  const Capture capture = read_capture(written(bytes, folder, "capture.yaml"));
  write_capture(folder / "once.yaml", capture);
  write_capture(folder / "twice.yaml", read_capture(folder / "once.yaml"));
  promise(read_file(folder / "once.yaml") == read_file(folder / "twice.yaml"),
          "a capture survives writing and reading");
}

void read_store_bytes(std::string_view bytes, const Path& folder) {
  std::filesystem::remove(folder / "lock.mdb");
  written(bytes, folder, "data.mdb");
  {
    const Store store(folder, Store::Mode::read);
    for (const std::string& key : store.keys("")) promise(store.has(key), "keys have a value");
    read_store_layout(store);
  }
  Store(folder, Store::Mode::write).put({{"another", std::string(10'000, 'a')}});
}

void read_record_bytes(std::string_view bytes, const Path& /*folder*/) {
  const FrameRecord record = decode_record(std::string(bytes), "a record");
  promise(encode_record(record).size() == bytes.size(), "a record survives");
  if (!record.crop_mask.empty()) decode_mask(record.crop_mask, {record.mask_size, record.mask_size}, "a mask");
}

void read_keypoint_record(std::string_view bytes, const Path& /*folder*/) {
  promise(encode_keypoints(decode_keypoints(std::string(bytes), 2, "keypoints")) == bytes, "keypoints survive");
}

/// The description of a shard, which survives writing and reading.
void read_shard_bytes(std::string_view bytes, const Path& folder) {
  written(bytes, folder, tools::kShardFile);
  const tools::ShardFile shard = tools::read_shard_file(folder);
  promise(!shard.arguments.empty() && shard.shard.index >= 0 && shard.shard.index < shard.shard.count,
          "a shard is a part of a command");
  tools::write_shard_file(folder, shard);
  const tools::ShardFile again = tools::read_shard_file(folder);
  promise(again.arguments == shard.arguments && again.inputs == shard.inputs && again.shard == shard.shard &&
              again.finished == shard.finished && again.results == shard.results,
          "a shard survives");
}

StoreLayout small_layout() {
  StoreLayout layout;
  layout.settings = "made by code";
  layout.num_dofs = 4;
  layout.mask_size = layout.image_size = 16;
  PinholeCamera camera;
  camera.name = "c0";
  camera.width = camera.height = 64;
  camera.K << 80, 0, 32, 0, 80, 32, 0, 0, 1;
  layout.cameras = {camera};
  layout.file_index = {0};
  return layout;
}

/// A store whose description is the input.
void read_layout_bytes(std::string_view bytes, const Path& folder) {
  for (const char* name : {"data.mdb", "lock.mdb"}) std::filesystem::remove(folder / name);
  Store store(folder, Store::Mode::write);
  store.put({{"meta/description", std::string(bytes)}});
  const StoreLayout layout = read_store_layout(store);
  promise(!layout.cameras.empty() && layout.cameras.size() == layout.file_index.size(), "cameras have an index");
  for (const Marker& landmark : layout.landmarks) promise(landmark.joint >= 0, "landmarks have a joint");
}

/// Two versions, so that pages are free; and a value of several pages.
std::string small_store(std::string* description) {
  const support::TemporaryFolder folder;
  {
    Store store(folder.path(), Store::Mode::write);
    write_store_layout(store, small_layout());
    *description = store.get("meta/description").value_or("");
    for (int i = 0; i < 4; ++i) store.put({{"frames/a/c0/" + std::to_string(i), std::string(9000, 'x')}});
    store.put({{"frames/a/c0/1", "short"}});
    mark_complete(store);
  }
  return read_file(folder / "data.mdb");
}

FrameRecord small_record() {
  FrameRecord record;
  record.width = record.height = 32;
  record.box = {2, 3, 20};
  record.mask_size = record.image_size = 16;
  cv::Mat mask(16, 16, CV_8U, cv::Scalar(0));
  mask(cv::Rect(4, 4, 8, 8)).setTo(255);
  record.crop_mask = record.full_mask = encode_mask(mask);
  record.crop_image = record.full_mask;
  return record;
}

constexpr const char* kCapture =
    "doppel_capture: 1\nname: a\nroot: .\ncharacter: a.character\ncalibration: cameras.toml\nfps: 25\n"
    "camera_fps: {c1: 50}\ncameras: [c0, c1]\nbackground: empty/{name}.png\nkeypoint_map: coco17\n"
    "person: {near: [0.1, 1, 2]}\nkeypoint_filter: {window: 2, outlier: 0.1, sigma: 1.5}\n"
    "detector: {model: a.onnx, input: [192, 256], crop: {padding: 1.5, boxes: {model: b.onnx}}}\n"
    "sequences:\n- name: walk\n  split: train\n  videos: {c0: a.mp4, c1: b.mp4}\n  masks: m/{name}/{frame:04}.png\n"
    "  mask_threshold: 100\n  keypoints: k/{name}.json\n  motion: a.motion\n  frame_offset: {c1: 0.5}\n"
    "  first_frame: 1\n  last_frame: 9\n  cuts: [4]\n- name: run\n  split: test\n  videos: v/{camera:02}.mp4\n"
    "  chroma_key: {colour: [0, 177, 64], tolerance: 20}\n";

constexpr const char* kShard =
    R"({"doppel_shard":1,"version":"0.1.0","shard":"0/2","finished":true,"arguments":["evaluate","run"],)"
    R"("inputs":["a.yaml 10 ab"],"results":{"frames":[{"error_mm":1.5}]}})";

std::string small_npz(bool deflated) {
  support::NpzWriter writer(deflated);
  writer.add("poses", {1, 2, 3, 4}, {2, 2});
  writer.add("trans", {1, 2, 3}, {1, 3});
  return writer.bytes();
}

/// {"format": "a", "texts": {"x": "y"}, "t": tensor}, as LibTorch writes it.
std::string small_torch_pickle() {
  const auto text = [](const std::string& t) {
    return "X" + std::string(1, static_cast<char>(t.size())) + "\0\0\0"s + t;
  };
  const std::string tensor = "ctorch._utils\n_rebuild_tensor_v2\nq\x05((" + text("storage") + "ctorch\nFloatStorage\n" +
                             text("0") + text("cpu") + "K\x06tQK" + "\0"s + "(K\x02K\x03t(K\x03K\x01t\x89" +
                             "ccollections\nOrderedDict\n)RtR";
  return "\x80\x02"
         "ctorch.jit._pickle\nrestore_type_tag\nq" +
         "\0"s + "}(" + text("format") + text("a") + text("texts") + "h" + "\0"s + "}(" + text("x") + text("y") + "u" +
         text("Dict[str, str]") + "\x86R" + text("t") + tensor + "u" + text("Dict[str, Any]") + "\x86R.";
}

std::string python_pickle() { return "(lp0\nF1.5\naI7\na(F2.25\nL3L\ntp1\na."; }

void add_store(std::vector<FuzzTarget>& targets) {
  std::string description;
  const std::string store = small_store(&description);
  targets.push_back({"store", read_store_bytes, {store}, {"\xDE\xC0\xEF\xBE", "frames/a/c0/1"}});
  targets.push_back({"store_layout",
                     read_layout_bytes,
                     {description},
                     {"\"joint\":-1", "\"cameras\":[]", "\"K\":[", "null", "1e999", "{\"a\":", "[[[["}});
  targets.push_back({"record", read_record_bytes, {encode_record(small_record())}, {"DREC", "\x89PNG"}});
  targets.push_back({"record_keypoints", read_keypoint_record, {encode_keypoints(std::vector<Keypoint>(2))}, {}});
}

void read_exif_bytes(std::string_view bytes, const Path& /*folder*/) {
  const int orientation = exif_orientation(bytes);
  promise(orientation >= 1 && orientation <= 8, "there are eight orientations");
}

/// Images with EXIF data, of each format that has them.
FuzzTarget exif_target() {
  const cv::Mat image(3, 5, CV_8UC3, cv::Scalar(10, 20, 30));
  return {"exif",
          read_exif_bytes,
          {support::oriented_file(image, ".jpg", 6, true), support::oriented_file(image, ".png", 3, false),
           support::oriented_file(image, ".webp", 8, true)},
          {"Exif\0\0"s, "MM\0*"s, "II*\0"s, "\x01\x12\0\x03"s, "eXIf", "EXIF", "\xFF\xE1", "\xFF\xFF\xFF\xFF"}};
}

}  // namespace

std::vector<FuzzTarget> file_targets() {
  const std::vector<double> values{1, 2, 3, 4, 5, 6};
  std::vector<FuzzTarget> targets{
      {"npy",
       [](std::string_view bytes, const Path& /*folder*/) { check_npy(parse_npy(bytes, kWhere)); },
       {npy_bytes(values.data(), "<f8", {2, 3}), npy_bytes(values.data(), "<i8", {3, 2})},
       {"'shape': (0, 9223372036854775807)", "'descr': '<f4'", "fortran_order': True", "|u1", "(,)"}},
      {"npz",
       read_npz_bytes,
       {small_npz(false), small_npz(true)},
       {"PK\x01\x02", "PK\x05\x06", "poses.npy"},
       unwrap_zip},
      {"pickle",
       read_pickle_bytes,
       {python_pickle()},
       {"cnumpy.core.multiarray\n_reconstruct\n", "cos\nsystem\n", "q\x01h\x01", "]", "(t", "R", "b", "\x8a\x08",
        "X\xff\xff\xff\x7f", "\x94", "2", "1"}},
      {"torch_pickle",
       read_torch_bytes,
       {small_torch_pickle()},
       {"ctorch._utils\n_rebuild_parameter\n", "q\x01h\x01", "}", "(t", "R", "Q", "s", "u", "\x8a\x08",
        "cos\nsystem\n"}},
      {"config",
       read_config_bytes,
       {"stage: egnet\nseed: 3\ntrain: {steps: 10, learning_rate: 1e-3}\ndata:\n  cameras: [a, b]\n"},
       {"&a [*a]", "*a", "{a: &a {b: *a}}", "- - - -", "? ", "!!binary ", "|\n  x\n", "\"\\0\"", "~", "<<: *a",
        "[[[["}},
      {"capture",
       read_capture_bytes,
       {kCapture},
       {"\"~\"", "null", "window: 0", "..", "person: 0", "masks: ", "frames: [0, 1]",
        "background_subtraction:", "1e308", "{frame}", "'\\n'", "input_height: 368"}},
      {"shard",
       read_shard_bytes,
       {kShard},
       {"[[[[", "{\"a\":", "null", "1e999", "\"0/1\"", "\"99999/100000\"", "\"prepare\"", "\"results\":", "\\u0000"}}};
  targets.push_back(exif_target());
  add_store(targets);
  return targets;
}

}  // namespace doppel::fuzz
