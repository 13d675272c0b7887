#include "doppel/actor/run_folder.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <regex>
#include <set>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/file_head.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/load_yaml.h"
#include "doppel/core/temporary_name.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace {

namespace fs = std::filesystem;

/// Keys that may change when a run is resumed. The capture is compared by its content (Stage::identity).
const std::set<std::string> kFreeKeys = {
    "capture",         "data.workers",     "train.max_minutes",  "train.checkpoint_every",
    "train.keep_last", "train.keep_every", "train.images_every", "train.pictures_every"};

/// Whether a text is a number by its value: not a name such as "007", nor a seed that no double holds.
bool is_by_value(const std::string& text) {
  const bool whole = text.find_first_not_of("0123456789") == std::string::npos;
  return !whole || (text.size() <= 15 && (text.size() == 1 || text[0] != '0'));
}

/// A value as text; numbers that are equal have the same one.
std::string canonical(const YAML::Node& node) {
  if (node.IsSequence()) {
    std::string items;
    for (const YAML::Node& item : node) items += (items.empty() ? "" : ", ") + canonical(item);
    return "[" + items + "]";
  }
  if (node.IsMap()) {
    std::string items;
    for (const auto& item : node)
      items += fmt::format("{}{}: {}", items.empty() ? "" : ", ", item.first.as<std::string>(), canonical(item.second));
    return "{" + items + "}";
  }
  if (node.IsScalar() && is_by_value(node.Scalar()))
    if (const std::optional<double> number = parse_number(node.Scalar())) return fmt::format("{}", *number);
  if (node.IsScalar() && node.Scalar().find(',') != std::string::npos) return "\"" + node.Scalar() + "\"";
  YAML::Emitter emitter;
  emitter << YAML::Flow << node;
  return emitter.c_str();
}

void flatten(const YAML::Node& node, const std::string& prefix, std::map<std::string, std::string>& out) {
  if (node.IsMap()) {
    for (const auto& item : node) {
      const std::string key = item.first.as<std::string>();
      flatten(item.second, prefix.empty() ? key : prefix + "." + key, out);
    }
  } else if (node.IsDefined() && !node.IsNull()) {
    out[prefix] = canonical(node);
  }
}

/// Whether a caption is one of ours: "step 500: ...".
bool is_caption(const fs::path& file) { return file.extension() == ".txt" && read_head(file, 5) == "step "; }

/// Removes the images that have a caption, and their folder if nothing else is in it.
void remove_images(const fs::path& folder) {
  std::error_code ignored;
  if (!fs::is_directory(folder)) return;
  std::vector<fs::path> captions;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    if (is_caption(entry.path())) captions.push_back(entry.path());
  for (const fs::path& caption : captions) {
    fs::remove(fs::path(caption).replace_extension(".jpg"), ignored);
    fs::remove(caption, ignored);
  }
  remove_temporaries(folder);
  fs::remove(folder, ignored);
}

std::map<std::string, std::string> flatten(const std::string& yaml) {
  std::map<std::string, std::string> values;
  try {
    flatten(load_yaml(yaml), "", values);
  } catch (const YAML::Exception& e) {
    fail("the run's config.yaml is not YAML ({}); use --overwrite or another --out", e.what());
  }
  for (const std::string& key : kFreeKeys) values.erase(key);
  return values;
}

}  // namespace

std::vector<std::string> config_differences(const std::string& old_yaml, const std::string& new_yaml) {
  const auto before = flatten(old_yaml), after = flatten(new_yaml);
  std::set<std::string> keys;
  for (const auto& item : before) keys.insert(item.first);
  for (const auto& item : after) keys.insert(item.first);
  std::vector<std::string> differences;
  for (const std::string& key : keys) {
    const auto old_value = before.find(key), new_value = after.find(key);
    const std::string from = old_value == before.end() ? "(default)" : old_value->second;
    const std::string to = new_value == after.end() ? "(default)" : new_value->second;
    if (from != to) differences.push_back(fmt::format("{}: {} -> {}", key, from, to));
  }
  return differences;
}

void RunFolder::check(const std::string& new_config, RunMode mode) const {
  if (fs::exists(path_) && !fs::is_directory(path_))
    fail<UsageError>("--out {}: this is a file; a run needs a folder", path_.string());
  const bool has_run = fs::exists(config());
  if (!has_run && !is_unused_folder(path_))
    fail<UsageError>("--out {}: the folder contains files that are not a run; choose another one", path_.string());
  const bool has_checkpoint = has_run && !CheckpointFolder(checkpoints()).steps().empty();
  if (mode == RunMode::resume && !has_checkpoint)
    fail<UsageError>("--resume: {} holds no checkpoint; leave --resume out to start a run there", path_.string());
  if (has_checkpoint && mode != RunMode::overwrite) {
    const auto differences = config_differences(read_file(config()), new_config);
    if (!differences.empty())
      fail<UsageError>(
          "{} holds a run with another configuration:\n  {}\nUse the same configuration to resume it, another --out, "
          "or "
          "--overwrite to replace it.",
          path_.string(), fmt::join(differences, "\n  "));
  }
}

void RunFolder::open(const std::string& new_config, RunMode mode) const {
  check(new_config, mode);
  if (mode == RunMode::overwrite || CheckpointFolder(checkpoints()).steps().empty()) clear();
  fs::create_directories(path_);
  write_atomically(config(), new_config);
}

void RunFolder::clear() const {
  std::error_code ignored;
  CheckpointFolder(checkpoints()).clear();
  for (const fs::path& file : {metrics(), validation(), report(), evaluation()}) fs::remove(file, ignored);
  remove_images(images());
  if (!fs::is_directory(path_)) return;
  static const std::regex events("events\\.out\\.tfevents\\.[0-9]+\\..+\\.[0-9]+");  // time, host, process
  for (const auto& entry : fs::directory_iterator(path_, ignored))
    if (std::regex_match(entry.path().filename().string(), events)) fs::remove(entry.path(), ignored);
}

}  // namespace doppel
