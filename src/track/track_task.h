#pragma once

/// The task of a tracking run, common to all methods.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "doppel/core/shard.h"
#include "doppel/track/footage.h"

namespace doppel {

struct TrackTask {
  std::filesystem::path out;           ///< the folder to write into
  std::vector<std::string> sequences;  ///< names; empty: all
  long limit_frames = 0;               ///< largest number of frames of each sequence; 0: all
  bool vertices = false;               ///< write `<sequence>_vertices.npy`
  /// Track only the sequences of this shard: sequence k of the chosen ones is unit k. `write_results` then writes what
  /// `merge_tracks` reads.
  std::optional<Shard> shard{};
};

/// The elements that belong to the task's shard, or all.
template <typename T>
std::vector<T> own_units(const std::vector<T>& all, const TrackTask& task) {
  std::vector<T> own;
  for (std::size_t k = 0; k < all.size(); ++k)
    if (!task.shard || task.shard->owns(k)) own.push_back(all[k]);
  return own;
}

/// The sequences of the task, limited to its number of frames and to its shard. @throws UsageError for a name that no
/// sequence has
std::vector<FootageSequence> chosen_sequences(const Footage& footage, const TrackTask& task);
/// The number of frames of all sequences.
long count_frames(const std::vector<FootageSequence>& sequences);
/// `count` frames, evenly spread over a sequence.
std::vector<long> spread_frames(const FootageSequence& sequence, int count);

/// @throws Error when a sequence has no masks @param method that needs them, for the message
void require_masks(const Footage& footage, const std::vector<FootageSequence>& sequences, const std::string& method);
/// Warns once when sequences have no masks: the terms of silhouettes and contours are then off.
void warn_without_masks(const std::vector<FootageSequence>& sequences);

/// Makes the output folder. @param method of the tracking, as in `track.json`
/// @throws UsageError when it holds the capture itself, a description that Doppel did not write, or the tracking of
/// another method, or `out` is empty
void open_out_folder(const Footage& footage, const std::filesystem::path& out, const std::string& method);
/// The method that a folder's `track.json` names; empty without one.
std::string tracked_method(const std::filesystem::path& folder);
/// @throws UsageError when `folder` holds the tracking of another method
void check_tracked_method(const std::filesystem::path& folder, const std::string& method);
/// @throws UsageError unless `footage` has one camera
void check_one_camera(const Footage& footage);
/// @throws Error when a stop was requested (`stop_requested`)
void check_not_stopped(const FootageSequence& sequence, long frame);

}  // namespace doppel
