#include "doppel/track/track_results.h"

#include <algorithm>

#include "doppel/core/atomic_file.h"
#include "doppel/track/track_curves.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// The capture with the tracked motions instead of its own.
Capture tracked_capture(const Footage& footage, const fs::path& out, const TrackReport& report) {
  Capture capture = footage.capture();
  for (SequenceEntry& entry : capture.sequences)
    for (const SequenceReport& one : report.sequences) {
      const FootageSequence& sequence = one.tracked.sequence;
      if (sequence.name != entry.name) continue;
      const fs::path motion = fs::absolute(out / (entry.name + ".motion")).lexically_normal();
      const fs::path inside = motion.lexically_relative(capture.root);
      entry.motion = inside.empty() || *inside.begin() == ".." ? motion.string() : inside.string();
      entry.first_frame = sequence.first_frame;
      entry.last_frame = sequence.last_frame;
    }
  const auto untracked = [](const SequenceEntry& entry) { return entry.motion.empty(); };
  capture.sequences.erase(std::remove_if(capture.sequences.begin(), capture.sequences.end(), untracked),
                          capture.sequences.end());
  return capture;
}

}  // namespace

void write_results(const Footage& footage, const fs::path& out, const TrackReport& report) {
  write_capture(out / "capture.yaml", tracked_capture(footage, out, report));
  write_atomically(out / "track.json", to_json(report).dump(1) + "\n");
  write_atomically(out / "track.html", track_curves(out, report));
}

}  // namespace doppel
