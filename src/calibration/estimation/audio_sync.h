#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// A mono recording.
struct AudioTrack {
  double rate = 0.0;           ///< samples per second
  std::vector<float> samples;  ///< within [-1, 1]
};

struct AudioOffset {
  double seconds = 0.0;   ///< what sounds at time t in the first recording sounds at t + seconds in the second
  double contrast = 0.0;  ///< height of the highest peak of the correlation over the second highest, at least 1
  bool known = false;     ///< false: no peak stands out
  std::string reason;     ///< why it is not known; empty when known
};

/// The offset between two recordings of the same sounds, at most a minute: the lag with the highest generalised
/// cross-correlation with phase transform (Knapp and Carter 1976), which is sharp in rooms with echoes. The onsets of
/// both recordings, which do not depend on the microphone, confirm the lag. The recordings may have different rates.
/// @throws Error for a recording without samples, with samples that are not finite, or with an impossible rate
AudioOffset audio_offset(const AudioTrack& first, const AudioTrack& second);

/// The sound of a video or audio file as mono samples, by the program `ffmpeg`.
/// @return nothing when the file has no sound
/// @throws Error without the program, or when it cannot read the file
std::optional<AudioTrack> read_audio(const std::filesystem::path& path, int rate = 16000);

}  // namespace doppel
