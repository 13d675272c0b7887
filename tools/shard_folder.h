#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/core/shard.h"

namespace doppel::tools {

inline constexpr char kShardFile[] = "shard.json";

/// The content of `shard.json`: which part of which work a folder holds. Shards of one work differ only in `shard`,
/// `finished` and `results`.
struct ShardFile {
  std::string version;                 ///< of the program
  std::vector<std::string> arguments;  ///< the command and its options, without those of one machine and one shard
  std::vector<std::string> inputs;     ///< names, sizes and checksums of what was read
  Shard shard;
  bool finished = false;
  nlohmann::ordered_json results = nullptr;  ///< what the command hands to the merge besides its files

  const std::string& command() const { return arguments.at(0); }
};

/// @throws UsageError when the folder holds no `shard.json` or one that this program did not write
ShardFile read_shard_file(const std::filesystem::path& folder);
void write_shard_file(const std::filesystem::path& folder, const ShardFile& file);

/// The arguments without --shard, --out, --overwrite and the options of all commands, which may differ between shards.
std::vector<std::string> shared_arguments(const std::vector<std::string>& words);

/// @throws UsageError that says in what two shards differ; their numbers are not compared
void check_same_work(const ShardFile& a, const std::filesystem::path& folder_a, const ShardFile& b,
                     const std::filesystem::path& folder_b);

/// All shards of one work, by their index.
struct ShardSet {
  std::vector<std::filesystem::path> folders;
  std::vector<ShardFile> files;

  bool empty() const { return folders.empty(); }
};

/// Finds the shards in `folders`. A folder is one shard, or its subfolders are shards.
/// @throws UsageError when there are none, or they are not the finished shards 0 to n-1 of one work, each once
ShardSet find_shards(const std::vector<std::filesystem::path>& folders);

/// @throws UsageError unless `folder` is missing or empty
void check_empty(const std::filesystem::path& folder);

}  // namespace doppel::tools
