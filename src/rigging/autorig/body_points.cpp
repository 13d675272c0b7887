#include "doppel/rigging/autorig/body_points.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/geometry/triangulation.h"
#include "doppel/rigging/autorig/draw_scan.h"

namespace doppel {

namespace {

constexpr double kUpperRing = 0.55;    // elevation, radians
constexpr double kInlierShare = 0.03;  // largest residual of an inlier view, share of the image
constexpr int kMinViews = 3;
constexpr double kApart = 0.2;  // distance of the hips of two people, share of the image
constexpr int kMaxPairs = 200;  // of views that propose a point

/// How many of the people are far from all before them.
int count_people(const std::vector<BodyPose>& poses, double apart) {
  std::vector<Eigen::Vector2d> bodies;
  for (const BodyPose& pose : poses) {
    const Eigen::Vector2d hips = hips_of(pose);
    if (std::all_of(bodies.begin(), bodies.end(),
                    [&](const Eigen::Vector2d& other) { return (other - hips).norm() > apart; }))
      bodies.push_back(hips);
  }
  return static_cast<int>(bodies.size());
}

ScanView look(ScanPainter& painter, BodyDetector& detector, const PinholeCamera& camera) {
  ScanView view{camera, painter.draw(camera), std::nullopt, 0};
  const std::vector<BodyPose> poses = detector.detect_all(view.image);
  view.people = count_people(poses, kApart * camera.width);
  if (poses.empty()) return view;
  // The region of the second look follows from the landmarks of the first one, as in a video.
  const auto again = detector.read_pose(view.image, poses[0].next_roi);
  view.pose = again ? again : poses[0];
  return view;
}

void triangulate_landmark(BodyPoints& points, std::size_t landmark, int image_size) {
  std::vector<Sight> sights;
  double visibility = 0.0, scale = 0.0;
  for (const ScanView& view : points.views) {
    if (!view.pose) continue;
    const BodyLandmark& seen = view.pose->landmarks[landmark];
    const auto sight = sight_of(view.camera, {seen.x, seen.y}, seen.visibility * seen.visibility + 1e-3);
    if (!sight) continue;
    sights.push_back(*sight);
    visibility += seen.visibility;
    scale += 1.0 / view.camera.K(0, 0);
  }
  if (sights.empty()) return;
  const double count = static_cast<double>(sights.size());
  points.visibility[landmark] = visibility / count;
  TriangulationOptions options;
  options.inlier_threshold = kInlierShare * image_size;
  options.most_pairs = kMaxPairs;
  const auto found = triangulate(sights, options);
  if (!found || found->views < kMinViews) return;
  points.positions[landmark] = found->position;
  const double depth = (found->position - points.views[0].camera.centre()).norm();
  points.error[landmark] = found->error * depth * scale / count;
}

}  // namespace

int BodyPoints::views_with_person() const {
  return static_cast<int>(
      std::count_if(views.begin(), views.end(), [](const ScanView& view) { return view.pose.has_value(); }));
}

BodyPoints find_body_points(const TriangleMesh& mesh, const BodyPointsOptions& options) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& vertex : mesh.vertices) box.extend(vertex);
  ScanPainter painter(mesh);
  BodyDetector detector(options.detector);
  BodyPoints points;
  for (const auto& [elevation, phase] : {std::pair{0.0, 0.0}, std::pair{kUpperRing, 0.5}})
    for (const PinholeCamera& camera :
         cameras_around(box, options.views_per_ring, elevation, phase, options.image_size))
      points.views.push_back(look(painter, detector, camera));
  for (std::size_t k = 0; k < as_size(kNumBodyLandmarks); ++k) triangulate_landmark(points, k, options.image_size);
  return points;
}

}  // namespace doppel
