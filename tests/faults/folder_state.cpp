#include "faults/folder_state.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/videoio.hpp>
#include <set>
#include <sstream>

#include "doppel/actor/checkpoint.h"
#include "doppel/core/crc32c.h"
#include "doppel/data/prepare/store.h"
#include "support/same_run.h"

namespace doppel::faults {

namespace {

namespace fs = std::filesystem;

std::uint32_t checksum(const std::string& bytes) { return crc32c(bytes.data(), bytes.size(), 0); }

std::string records_of(const fs::path& folder) {
  const Store store(folder, Store::Mode::read);
  std::string lines;
  for (const std::string& key : store.keys("")) lines += fmt::format("{} {:08x}\n", key, checksum(*store.get(key)));
  return lines;
}

std::string tensors_of(const fs::path& path) {
  const Checkpoint checkpoint = Checkpoint::load(path);
  std::string lines;
  for (const auto& [name, tensor] : checkpoint.tensors()) {
    const torch::Tensor whole = tensor.contiguous();
    lines += fmt::format("{} {:08x}\n", name, crc32c(static_cast<const char*>(whole.data_ptr()), whole.nbytes(), 0));
  }
  for (const char* name : {"data", "step", "loss"}) lines += fmt::format("{} {}\n", name, checkpoint.text(name));
  return lines;
}

/// A Matroska file has a random number in its head.
std::string images_of(const fs::path& path) {
  cv::VideoCapture video(path.string());
  std::string lines;
  for (cv::Mat image; video.read(image);)
    lines += fmt::format("{:08x}\n", crc32c(image.data, image.total() * image.elemSize()));
  return lines;
}

bool is_log(const std::string& file) { return file == "metrics.jsonl"; }

std::string content_of(const fs::path& path) {
  const std::string file = path.filename().string();
  if (file == "data.mdb") return records_of(path.parent_path());
  if (file.starts_with("step-")) return tensors_of(path);
  if (path.extension() == ".mkv") return images_of(path);
  if (is_log(file)) {
    std::string lines;
    for (const std::string& line : support::timeless_metrics(path.parent_path())) lines += line + "\n";
    return lines;
  }
  const std::string bytes = read_file(path);
  if (file == "report.html") return bytes.ends_with("</html>\n") ? "whole" : "a part";
  return support::comparable(file, bytes);
}

bool is_compared(const std::string& file) { return file != "lock.mdb" && !file.starts_with("events.out."); }

std::set<std::string> lines_of(const std::string& text) {
  std::set<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.insert(line);
  return lines;
}

}  // namespace

Files state_of(const fs::path& folder) {
  Files files;
  if (!fs::exists(folder)) return files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file() || !is_compared(entry.path().filename().string())) continue;
    std::string& content = files[entry.path().lexically_relative(folder).string()];
    try {
      content = content_of(entry.path());
    } catch (const std::exception& e) {
      content = fmt::format("damaged: {}", e.what());
    }
  }
  return files;
}

bool is_part_of(const std::string& name, const std::string& content, const std::string& whole) {
  const std::string file = fs::path(name).filename().string();
  if (is_log(file)) return whole.starts_with(content);
  if (file == "latest") return content.starts_with("step-") && content.ends_with(".pt\n");
  if (file != "data.mdb") return false;
  const std::set<std::string> all = lines_of(whole), some = lines_of(content);
  return std::includes(all.begin(), all.end(), some.begin(), some.end());
}

std::string difference(const Files& found, const Files& expected) {
  for (const auto& [name, content] : expected) {
    const auto file = found.find(name);
    if (file == found.end()) return name + " is missing";
    if (file->second != content) return name + " differs";
  }
  for (const auto& [name, content] : found)
    if (!expected.contains(name)) return name + " is too much";
  return "";
}

bool is_leftover(const std::string& name) {
  for (const fs::path& part : fs::path(name))
    if (part.string().starts_with(".")) return true;
  return false;
}

}  // namespace doppel::faults
