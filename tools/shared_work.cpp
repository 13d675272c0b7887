#include "shared_work.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>

#include "doppel/character/character.h"
#include "doppel/core/crc32c.h"
#include "doppel/core/error.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/capture_cameras.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMaxChecksumBytes = std::uintmax_t{256} << 20;

/// @param name for messages @param checksum whether the content is read too
std::string describe_file(const std::string& name, const fs::path& path, bool checksum) {
  if (!fs::is_regular_file(path)) return name;
  const std::uintmax_t bytes = fs::file_size(path);
  if (!checksum || bytes > kMaxChecksumBytes) return fmt::format("{}: {} bytes", name, bytes);
  return fmt::format("{}: {} bytes, checksum {:08x}", name, bytes, checksum_of(path));
}

/// A file, or the files of a folder.
void describe_small(const Capture& capture, const std::string& written, std::vector<std::string>& lines) {
  if (written.empty()) return;
  const fs::path path = capture.resolve(written);
  std::vector<fs::path> files;
  if (fs::is_directory(path)) {
    for (const auto& entry : fs::directory_iterator(path)) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
  }
  lines.push_back(describe_file(written, path, true));
  for (const fs::path& file : files)
    lines.push_back(describe_file((fs::path(written) / file.filename()).string(), file, true));
}

/// The files of one kind of all cameras, by their sizes.
void describe_cameras(const Capture& capture, const CaptureCameras& cameras, const CameraPaths& paths,
                      const std::string& title, std::vector<std::string>& lines) {
  if (paths.empty()) return;
  for (std::size_t c = 0; c < cameras.cameras.size(); ++c) {
    const std::string& name = cameras.cameras[c].name;
    const std::string path = capture.source(paths, cameras.file_index[c], name);
    const std::string text = fmt::format("{} of camera {}", title, name);
    lines.push_back(has_frame_placeholder(path) ? text : describe_file(text, path, false));
  }
}

/// Files that the arguments name: configurations and networks.
void describe_arguments(const std::vector<std::string>& arguments, std::vector<std::string>& lines) {
  for (const std::string& argument : arguments) {
    const std::string value = argument.starts_with("--") ? argument.substr(argument.find('=') + 1) : argument;
    if (fs::is_regular_file(value)) lines.push_back(describe_file(value, value, true));
  }
}

ShardFile current_work(const CommonOptions& common, const std::function<std::vector<std::string>()>& inputs) {
  ShardFile work;
  work.version = DOPPEL_VERSION;
  work.arguments = shared_arguments(common.words);
  work.inputs = inputs();
  describe_arguments(work.arguments, work.inputs);
  work.shard = common.shard.value_or(Shard());
  return work;
}

void begin_shard(const fs::path& out, ShardFile work) {
  if (out.empty()) fail<UsageError>("--shard {} needs --out, a folder for this shard alone", work.shard.to_string());
  if (!fs::exists(out / kShardFile)) {
    check_empty(out);
  } else {
    const ShardFile before = read_shard_file(out);
    check_same_work(before, out, work, "this command");
    if (before.shard != work.shard)
      fail<UsageError>("{} holds shard {}, not {}; give each shard its own folder with --out", out.string(),
                       before.shard.to_string(), work.shard.to_string());
  }
  write_shard_file(out, work);
}

/// @throws UsageError when a file has changed since the shards were made
void check_inputs(const CommonOptions& common, ShardFile work) {
  const ShardFile& first = common.merged.files.at(0);
  work.shard = first.shard;
  work.arguments = first.arguments;
  check_same_work(first, common.merged.folders.at(0), work, "the files as they are now");
}

}  // namespace

std::uint32_t checksum_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<char> block(1 << 20);
  std::uint32_t crc = 0;
  while (file.read(block.data(), static_cast<std::streamsize>(block.size())) || file.gcount() > 0)
    crc = crc32c(block.data(), static_cast<std::size_t>(file.gcount()), crc);
  return crc;
}

std::vector<std::string> capture_inputs(const Capture& capture) {
  std::vector<std::string> lines;
  if (!capture.file.empty()) lines.push_back(describe_file("capture.yaml", capture.file, true));
  for (const std::string& file : {capture.character, capture.calibration, capture.landmarks, capture.keypoint_map})
    describe_small(capture, file, lines);
  if (!capture.character.empty())
    lines.push_back("character " + load_character(capture.character_path()).fingerprint());
  const CaptureCameras cameras = choose_cameras(capture);
  for (const SequenceEntry& sequence : capture.sequences) {
    describe_small(capture, sequence.motion, lines);
    describe_cameras(capture, cameras, sequence.videos, sequence.name + ", video", lines);
    describe_cameras(capture, cameras, sequence.masks, sequence.name + ", masks", lines);
    describe_cameras(capture, cameras, sequence.keypoints, sequence.name + ", keypoints", lines);
  }
  return lines;
}

void begin_work(const CommonOptions& common, const fs::path& out,
                const std::function<std::vector<std::string>()>& inputs) {
  if (!common.merged.empty()) return check_inputs(common, current_work(common, inputs));
  if (common.shard) return begin_shard(out, current_work(common, inputs));
  if (!out.empty() && fs::exists(out / kShardFile))
    fail<UsageError>("{} holds a shard; choose another folder with --out, or join shards with `doppel merge`",
                     out.string());
}

void finish_work(const CommonOptions& common, const fs::path& out, const nlohmann::ordered_json& results) {
  if (!common.shard) return;
  ShardFile file = read_shard_file(out);
  file.finished = true;
  file.results = results;
  write_shard_file(out, file);
}

}  // namespace doppel::tools
