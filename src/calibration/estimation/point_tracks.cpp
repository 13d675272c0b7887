#include "doppel/calibration/estimation/point_tracks.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

CameraTrack::CameraTrack(std::string camera, double frames_per_second, long num_frames, int num_points)
    : name(std::move(camera)), fps(frames_per_second), num_frames_(num_frames), num_points_(num_points) {
  if (num_frames < 0 || num_points < 0)
    fail("the track of camera {} cannot have {} frames of {} points", name, num_frames, num_points);
  points_.resize(as_size(num_frames) * as_size(num_points));
}

std::size_t CameraTrack::index(long frame, int point) const {
  if (frame < 0 || frame >= num_frames_ || point < 0 || point >= num_points_)
    fail("camera {}: point {} of frame {} was asked for; there are {} points in {} frames", name, point, frame,
         num_points_, num_frames_);
  return as_size(frame) * as_size(num_points_) + as_size(point);
}

TrackPoint CameraTrack::sample(double frame, int point) const {
  if (!(frame >= 0.0 && frame <= static_cast<double>(num_frames_ - 1))) return {};
  const long before = static_cast<long>(std::floor(frame));
  const double share = frame - static_cast<double>(before);
  const TrackPoint& a = at(before, point);
  if (share == 0.0) return a;
  const TrackPoint& b = at(before + 1, point);
  if (!a.seen() || !b.seen()) return {};
  return {a.pixel + share * (b.pixel - a.pixel), std::min(a.confidence, b.confidence)};
}

std::vector<double> PointTracks::times(std::size_t most) const {
  std::vector<double> begins, ends;
  const CameraTrack* slowest = nullptr;
  for (const CameraTrack& camera : cameras) {
    if (camera.num_frames() == 0) continue;
    begins.push_back(camera.seconds_at(0.0));
    ends.push_back(camera.seconds_at(static_cast<double>(camera.num_frames() - 1)));
    if (slowest == nullptr || camera.fps < slowest->fps) slowest = &camera;
  }
  if (begins.size() < 2) return {};
  // From when the second camera begins to when the last but one ends.
  std::nth_element(begins.begin(), begins.begin() + 1, begins.end());
  std::nth_element(ends.begin(), ends.end() - 2, ends.end());
  const double begin = begins[1], end = ends[ends.size() - 2], tolerance = 1e-9 / slowest->fps;
  const double first = std::ceil(slowest->frame_at(begin - tolerance)), last = slowest->frame_at(end + tolerance);
  std::vector<double> all;
  for (double frame = first; frame <= last; frame += 1.0) all.push_back(slowest->seconds_at(frame));
  if (most == 0 || all.size() <= most) return all;
  std::vector<double> thinned;
  for (std::size_t i = 0; i < most; ++i) thinned.push_back(all[i * all.size() / most]);
  return thinned;
}

long drop_unusable(PointTracks& tracks, double min_confidence) {
  long left = 0;
  for (CameraTrack& camera : tracks.cameras)
    for (long frame = 0; frame < camera.num_frames(); ++frame)
      for (int k = 0; k < camera.num_points(); ++k) {
        TrackPoint& point = camera.at(frame, k);
        const bool usable =
            point.pixel.allFinite() && std::isfinite(point.confidence) && point.confidence >= min_confidence;
        if (!usable) point = {};
        if (point.seen()) ++left;
      }
  return left;
}

void check_tracks(const std::vector<Camera>& cameras, const PointTracks& tracks, int min_cameras,
                  const std::string& purpose) {
  if (tracks.num_cameras() < min_cameras)
    fail("{}: at least {} cameras are needed, found {}", purpose, min_cameras, tracks.num_cameras());
  if (cameras.size() != tracks.cameras.size())
    fail("{}: {} calibrated cameras were given, but points of {} cameras", purpose, cameras.size(),
         tracks.cameras.size());
  bool any = false;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const CameraTrack& track = tracks.cameras[c];
    if (track.name != cameras[c].name)
      fail("{}: camera {} is '{}' in the calibration but '{}' in the points; both need the same order", purpose, c,
           cameras[c].name, track.name);
    if (track.num_points() != tracks.num_points())
      fail("{}: camera {} has {} points per frame, but {} are named", purpose, track.name, track.num_points(),
           tracks.num_points());
    if (!(track.fps > 0.0) || !std::isfinite(track.fps) || !std::isfinite(track.offset))
      fail("{}: camera {} has {} frames per second and the offset {}; both must be finite and the rate positive",
           purpose, track.name, track.fps, track.offset);
    const std::vector<std::string> faults = cameras[c].faults();
    if (!faults.empty()) fail("{}: {}", purpose, faults.front());
    for (long frame = 0; frame < track.num_frames() && !any; ++frame)
      for (int k = 0; k < track.num_points() && !any; ++k) any = track.at(frame, k).seen();
  }
  if (!any) fail("{}: no camera saw any point; keypoint files with a person are needed", purpose);
}

}  // namespace doppel
