#include "shard_folder.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/json_bounds.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kShardFormat = 1;
constexpr std::size_t kMaxShardDepth = 50;

ShardFile shard_from_json(const Json& node, const fs::path& path) {
  if (node.at("doppel_shard") != kShardFormat)
    fail<UsageError>("{} has another format than {}; make all shards with one version of the program", path.string(),
                     kShardFormat);
  ShardFile file;
  file.version = node.at("version").get<std::string>();
  file.arguments = node.at("arguments").get<std::vector<std::string>>();
  file.inputs = node.at("inputs").get<std::vector<std::string>>();
  file.shard = parse_shard(node.at("shard").get<std::string>());
  file.finished = node.at("finished").get<bool>();
  file.results = node.at("results");
  const std::set<std::string> commands{"synth", "prepare", "detect", "track", "evaluate"};
  if (file.arguments.empty() || !commands.contains(file.command()))
    fail<UsageError>("{}: the command is '{}'; only {} work in shards", path.string(),
                     file.arguments.empty() ? "" : excerpt(file.command()), fmt::join(commands, ", "));
  return file;
}

/// The first element in which two lists differ, "nothing" at the end of one.
std::pair<std::string, std::string> first_difference(const std::vector<std::string>& a,
                                                     const std::vector<std::string>& b) {
  std::size_t i = 0;
  while (i < a.size() && i < b.size() && a[i] == b[i]) ++i;
  const auto at = [i](const std::vector<std::string>& list) { return i < list.size() ? list[i] : "nothing"; };
  return {at(a), at(b)};
}

std::string command_line(const ShardFile& file) { return fmt::format("doppel {}", fmt::join(file.arguments, " ")); }

/// The folders of shards in what the user named.
std::vector<fs::path> shard_folders(const fs::path& folder) {
  if (fs::exists(folder / kShardFile)) return {folder};
  std::vector<fs::path> found;
  if (fs::is_directory(folder))
    for (const auto& entry : fs::directory_iterator(folder))
      if (fs::exists(entry.path() / kShardFile)) found.push_back(entry.path());
  std::sort(found.begin(), found.end());
  if (found.empty())
    fail<UsageError>(
        "{} is no shard: it holds no {}, and none of its folders does; name folders that were written "
        "with --shard i/n",
        folder.string(), kShardFile);
  return found;
}

/// @param index of the folder of each shard, -1: none
void check_complete(const std::vector<int>& index) {
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < index.size(); ++i)
    if (index[i] < 0) missing.push_back(i);
  if (missing.empty()) return;
  const std::size_t shown = std::min<std::size_t>(missing.size(), 10);
  fail<UsageError>("{} of {} shards are missing: {}{}; run them, or name their folders too", missing.size(),
                   index.size(), fmt::join(missing.begin(), missing.begin() + static_cast<long>(shown), ", "),
                   shown < missing.size() ? ", ..." : "");
}

}  // namespace

ShardFile read_shard_file(const fs::path& folder) {
  const fs::path path = folder / kShardFile;
  const std::string text = read_file(path);
  // Copies of a JSON value call themselves for each level.
  if (is_json_deeper_than(text, kMaxShardDepth))
    fail<UsageError>("{} cannot be read as a shard: its lists and objects are nested more than {} deep", path.string(),
                     kMaxShardDepth);
  try {
    return shard_from_json(Json::parse(text), path);
  } catch (const Json::exception& e) {
    fail<UsageError>("{} cannot be read as a shard ({}); run this shard again into an empty folder", path.string(),
                     excerpt(e.what(), 200));
  }
}

void write_shard_file(const fs::path& folder, const ShardFile& file) {
  const Json document{{"doppel_shard", kShardFormat}, {"version", file.version},     {"shard", file.shard.to_string()},
                      {"finished", file.finished},    {"arguments", file.arguments}, {"inputs", file.inputs},
                      {"results", file.results}};
  write_atomically(folder / kShardFile, document.dump(1) + "\n");
}

std::vector<std::string> shared_arguments(const std::vector<std::string>& words) {
  const std::set<std::string> with_value{"--shard", "--out", "--threads", "--log-level"};
  const std::set<std::string> flags{"--json", "--overwrite"};
  std::vector<std::string> shared;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string name = words[i].substr(0, words[i].find('='));
    if (flags.contains(name)) continue;
    if (!with_value.contains(name))
      shared.push_back(words[i]);
    else if (name == words[i])
      ++i;  // its value
  }
  return shared;
}

void check_same_work(const ShardFile& a, const fs::path& folder_a, const ShardFile& b, const fs::path& folder_b) {
  const std::string both = fmt::format("{} and {} do not belong together", folder_a.string(), folder_b.string());
  if (a.version != b.version)
    fail<UsageError>("{}: doppel {} wrote one, doppel {} the other; make all shards with one version", both, a.version,
                     b.version);
  if (a.arguments != b.arguments)
    fail<UsageError>("{}: the commands are `{}` and `{}`; give the same arguments, in the same order", both,
                     command_line(a), command_line(b));
  if (a.inputs != b.inputs) {
    const auto [in_a, in_b] = first_difference(a.inputs, b.inputs);
    fail<UsageError>("{}: they read other files, '{}' and '{}'; make all shards of the same files", both, in_a, in_b);
  }
  if (a.shard.count != b.shard.count)
    fail<UsageError>("{}: one is of {} shards, the other of {}; cut the work into one number of shards", both,
                     a.shard.count, b.shard.count);
}

ShardSet find_shards(const std::vector<fs::path>& named) {
  std::vector<fs::path> folders;
  for (const fs::path& folder : named)
    for (const fs::path& found : shard_folders(folder)) folders.push_back(found);
  std::vector<ShardFile> files;
  for (const fs::path& folder : folders) files.push_back(read_shard_file(folder));
  std::vector<int> position(static_cast<std::size_t>(files.at(0).shard.count), -1);
  for (std::size_t i = 0; i < files.size(); ++i) {
    check_same_work(files[0], folders[0], files[i], folders[i]);
    int& at = position[static_cast<std::size_t>(files[i].shard.index)];
    if (at >= 0)
      fail<UsageError>("{} and {} are both shard {}; name each shard once",
                       folders[static_cast<std::size_t>(at)].string(), folders[i].string(), files[i].shard.to_string());
    at = static_cast<int>(i);
    if (!files[i].finished)
      fail<UsageError>("{}: shard {} is not finished; run it again, or wait for it", folders[i].string(),
                       files[i].shard.to_string());
  }
  check_complete(position);
  ShardSet set;
  for (const int at : position) {
    set.folders.push_back(folders[static_cast<std::size_t>(at)]);
    set.files.push_back(files[static_cast<std::size_t>(at)]);
  }
  return set;
}

void check_empty(const fs::path& folder) {
  if (!fs::exists(folder) || (fs::is_directory(folder) && fs::is_empty(folder))) return;
  fail<UsageError>("{} is not empty; choose another folder with --out, or remove it first", folder.string());
}

}  // namespace doppel::tools
