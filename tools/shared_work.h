#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "command.h"
#include "doppel/data/capture/capture.h"

namespace doppel::tools {

/// Names, sizes and checksums of what a capture names. Files of images, masks and keypoints have no checksum, because
/// they are large; their sizes are compared. Paths are as written in the capture, so that machines may mount it
/// elsewhere.
std::vector<std::string> capture_inputs(const Capture& capture);

/// The CRC-32C of a file.
std::uint32_t checksum_of(const std::filesystem::path& path);

/// Begins the work of a command that may be a shard or the merge of shards. Does nothing else for the whole work.
/// As a shard: `out` must be empty, or hold the same shard, which is then made or resumed; writes its `shard.json`.
/// @param inputs asked for by shards and merges only. Files among the arguments are added.
/// @throws UsageError when `out` holds other files or another shard; when a whole work is to be written into a shard;
/// when the files that a merge reads are not those of the shards
void begin_work(const CommonOptions& common, const std::filesystem::path& out,
                const std::function<std::vector<std::string>()>& inputs);

/// Marks a shard as finished. Does nothing for other work.
void finish_work(const CommonOptions& common, const std::filesystem::path& out, const nlohmann::ordered_json& results);

}  // namespace doppel::tools
