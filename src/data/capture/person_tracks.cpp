#include "doppel/data/capture/person_tracks.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/filmed_sequence.h"
#include "doppel/data/capture/people_in_cameras.h"
#include "doppel/detect/keypoints/keypoint_source.h"

namespace doppel {

namespace {

PeopleInCameras open_people(const Capture& capture, const SequenceEntry& sequence, const CaptureCameras& filmed,
                            const PointLayout& layout) {
  const RowRange rows = rows_of_sequence(capture, sequence, filmed);
  PeopleInCameras seen{sequence.name, filmed.cameras, {}, {}, rows.first, rows.last};
  for (std::size_t c = 0; c < filmed.cameras.size(); ++c) {
    const Camera& camera = filmed.cameras[c];
    const int index = filmed.file_index[c];
    const auto source = std::make_shared<const KeypointSource>(capture.source(sequence.keypoints, index, camera.name),
                                                               layout, keypoint_camera(camera, index),
                                                               sequence.keypoint_offset_of(camera.name));
    seen.clocks.push_back(capture.clock(sequence, camera.name));
    seen.people.emplace_back([source](long frame) { return source->people(frame); });
  }
  return seen;
}

constexpr double kRoughResidual = 0.08;  // share of the image's height, of a point that agrees in a rough rig

/// Who is followed. People may differ between cameras even if each camera found only one.
std::vector<ChoiceOfFrame> choose(const PeopleInCameras& seen, const PointLayout& layout,
                                  const PersonChoiceOptions& options) {
  if (seen.cameras.size() > 1) return follow_in_cameras(seen, layout, options, {});
  return {[&](long frame) { return index_of_person(seen.people[0](frame).value_or(People())); }};
}

CameraTrack track_of(const PeopleInCameras& seen, std::size_t c, const ChoiceOfFrame& chosen, double fps,
                     std::size_t num_points) {
  const FrameClock& clock = seen.clocks[c];
  const long first = std::max(0L, static_cast<long>(std::floor(clock.time(seen.first_row))));
  const long last = std::max(first, static_cast<long>(std::ceil(clock.time(seen.last_row))));
  CameraTrack track(seen.cameras[c].name, fps * clock.rate, last + 1, static_cast<int>(num_points));
  track.offset = clock.offset;
  for (long frame = first; frame <= last; ++frame) {
    const int index = chosen(frame);
    if (index < 0) continue;
    const People people = seen.people[c](frame).value_or(People());
    const Person& person = people.at(as_size(index));
    for (std::size_t k = 0; k < std::min(num_points, person.size()); ++k)
      track.at(frame, static_cast<int>(k)) = {{person[k].x, person[k].y}, person[k].confidence};
  }
  return track;
}

PointLayout layout_of_tracks(const Capture& capture, const SequenceEntry& sequence) {
  if (sequence.keypoints.empty())
    fail("sequence {} of {} names no `keypoints`; `doppel detect` finds them (docs/detect.md)", sequence.name,
         capture.name);
  return layout_of_keypoints(capture);
}

PointTracks tracks_of(const PeopleInCameras& seen, const std::vector<ChoiceOfFrame>& chosen, const PointLayout& layout,
                      double fps) {
  PointTracks tracks;
  tracks.points = layout.points;
  for (std::size_t c = 0; c < seen.cameras.size(); ++c)
    tracks.cameras.push_back(track_of(seen, c, chosen[c], fps, layout.points.size()));
  return tracks;
}

}  // namespace

PointTracks read_person_tracks(const Capture& capture, const SequenceEntry& sequence, const CaptureCameras& filmed) {
  const PointLayout layout = layout_of_tracks(capture, sequence);
  const PeopleInCameras seen = open_people(capture, sequence, filmed, layout);
  return tracks_of(seen, choose(seen, layout, capture.person_of(sequence)), layout, capture.fps);
}

PointTracks read_tracks_of_rough_rig(const Capture& capture, const SequenceEntry& sequence,
                                     const CaptureCameras& filmed) {
  const PointLayout layout = layout_of_tracks(capture, sequence);
  const PeopleInCameras seen = open_people(capture, sequence, filmed, layout);
  PersonChoiceOptions options = capture.person_of(sequence);
  options.max_residual = std::max(options.max_residual, kRoughResidual);
  std::vector<ChoiceOfFrame> chosen = follow_if_several(seen, layout, options, {});
  for (std::size_t c = 0; c < chosen.size(); ++c)
    if (!chosen[c])
      chosen[c] = [&, c](long frame) { return index_of_person(seen.people[c](frame).value_or(People())); };
  return tracks_of(seen, chosen, layout, capture.fps);
}

}  // namespace doppel
