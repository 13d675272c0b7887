#include "doppel/track/sequence_runner.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/core/clock.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/geometry/image_file.h"
#include "doppel/track/prefetch.h"
#include "doppel/track/track_sheet.h"
#include "doppel/track/track_task.h"

namespace doppel {

struct SequenceRunner::Read {
  long frame = 0;
  FootageFrame seen;
  double seconds = 0.0;
};

TrackedSequence SequenceRunner::run(const FootageSequence& sequence, Progress& progress) {
  TrackedSequence result;
  result.sequence = sequence;
  const std::vector<long> shown = spread_frames(sequence, options_.sheet_frames);
  const auto is_shown = [&](long frame) { return std::find(shown.begin(), shown.end(), frame) != shown.end(); };
  std::optional<TrackSheet> sheet;
  if (!shown.empty()) sheet.emplace(footage_.cameras(), tracker_.model());
  const auto reader = footage_.read(sequence.index);
  const bool images = tracker_.image_use() != ImageUse::none;
  auto read = [&, next = sequence.first_frame]() mutable -> std::optional<Read> {
    if (next > sequence.last_frame) return std::nullopt;
    const auto start = Clock::now();
    const long frame = next++;
    Read one{frame, reader->read(frame, images || is_shown(frame)), 0.0};
    one.seconds = seconds_since(start);
    return one;
  };
  const auto take = [&](const Read& one) {
    track(one, result);
    if (is_shown(one.frame)) sheet->add(one.frame, one.seen, result.frames.back());
    progress.advance(1, fmt::format("{} {}", sequence.name, to_string(result.frames.back().state)));
  };
  tracker_.cut();
  const auto start = Clock::now();
  try {
    std::optional<Prefetch<Read>> ahead;
    if (options_.frames_ahead > 0) ahead.emplace(read, as_size(options_.frames_ahead));
    while (!stop_requested()) {
      const std::optional<Read> one = ahead ? ahead->next() : read();
      if (!one) break;
      take(*one);
    }
  } catch (const FileError& e) {
    // A video that is cut short, say: the frames before it are kept.
    if (result.frames.empty()) throw;
    result.stopped = e.what();
  }
  end_at_last_frame(result);
  result.times.total = seconds_since(start);
  if (sheet && !sheet->empty()) write_image(options_.sheet, sheet->image());
  return result;
}

void SequenceRunner::end_at_last_frame(TrackedSequence& result) {
  FootageSequence& sequence = result.sequence;
  const long end = sequence.first_frame + static_cast<long>(result.frames.size());
  if (end > sequence.last_frame) return;
  if (result.frames.empty()) check_not_stopped(sequence, sequence.first_frame);
  if (result.stopped.empty()) result.stopped = "stopped on request";
  log::warn("sequence {}: only the frames {} to {} are tracked: {}", sequence.name, sequence.first_frame, end - 1,
            result.stopped);
  sequence.last_frame = end - 1;
}

void SequenceRunner::track(const Read& read, TrackedSequence& result) {
  if (tracker_.image_use() == ImageUse::required)
    for (std::size_t c = 0; c < read.seen.images.size(); ++c)
      if (read.seen.images[c].empty())
        fail("sequence {}: the camera {} has no images, which this method needs", result.sequence.name,
             footage_.cameras()[c].name);
  if (result.sequence.begins_segment(read.frame)) tracker_.cut();
  const FrameResult found = tracker_.track(read.seen);
  result.times.reading += read.seconds;
  result.times.pose += found.pose_seconds;
  result.times.surface += found.surface_seconds;
  result.frames.push_back(found.pose);
  if (hook_) hook_(read.frame, read.seen, found);
}

}  // namespace doppel
