#pragma once

/// What every way of tracking can be asked for, and what that means for footage.

#include <filesystem>
#include <string>
#include <vector>

#include "doppel/track/footage.h"

namespace doppel {

struct TrackTask {
  std::filesystem::path out;           ///< the folder to write into
  std::vector<std::string> sequences;  ///< names; empty: all
  long limit_frames = 0;               ///< of each sequence; 0: all
  bool vertices = false;               ///< `<sequence>_vertices.npy`
};

/// The sequences of the task, each no longer than it says. @throws UsageError for one that is not there
std::vector<FootageSequence> chosen_sequences(const Footage& footage, const TrackTask& task);
/// Of all sequences.
long count_frames(const std::vector<FootageSequence>& sequences);
/// So many frames, spread over a sequence.
std::vector<long> spread_frames(const FootageSequence& sequence, int count);

/// Makes the folder. @throws UsageError when it holds the capture itself, or none is given
void open_out_folder(const Footage& footage, const std::filesystem::path& out);
/// @throws UsageError unless the footage is of one camera
void check_one_camera(const Footage& footage);
/// @throws Error when a stop was asked for (`stop_requested`)
void check_not_stopped(const FootageSequence& sequence, long frame);

}  // namespace doppel
