#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/track/track_report.h"
#include "doppel/track/track_task.h"

namespace doppel {

/// Writes into `task.out`: `capture.yaml`, the capture with the tracked motions instead of its own; `track.json`, the
/// report; `track.html`, curves over time. A shard writes `track.json` and, instead of the other two, `curves.json`.
void write_results(const Footage& footage, const TrackTask& task, const TrackReport& report);

/// Joins the results of shards in `task.out`, which then holds what one run would have written. Reports of sequences,
/// with their times, are those of the shards.
/// @param task without a shard @param shards folders of all shards, by their index
/// @throws Error when a shard lacks a sequence; FileError for a file that is no JSON of a shard
void merge_tracks(const Footage& footage, const TrackTask& task, const std::vector<std::filesystem::path>& shards);

/// Joins only `track.json` and the files of sequences, which is all that a run without a character writes.
/// @param names of the sequences, in the order of the report
/// @return the folder that holds each sequence
std::vector<std::filesystem::path> merge_sequences(const std::vector<std::string>& names,
                                                   const std::filesystem::path& out,
                                                   const std::vector<std::filesystem::path>& shards);

}  // namespace doppel
