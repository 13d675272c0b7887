#include "doppel/calibration/estimation/fit_lens.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "doppel/core/angles.h"
#include "doppel/core/statistics.h"
#include "doppel/geometry/decompositions.h"

namespace doppel {
namespace {

// The term f k theta^(2n+1) of a usual fisheye lens (f = 400 pixels, k3 = 0.004, k4 = 0.001) moves a corner by 0.3
// pixels at 45 degrees (k3) and by 0.6 pixels at 60 (k4). Corners nearer to the axis do not tell it from their noise
// and from the lower terms. A free coefficient then becomes any number, and bends the rest of the image by tens of
// pixels.
constexpr double kMinAngleOfK3 = 45.0, kMinAngleOfK4 = 60.0;  // degrees
constexpr double kShareOfAngles = 0.95;  // of the corners; the few beyond do not determine a coefficient
constexpr double kLensStep = 0.25;       // degrees

using FisheyeBoards = std::vector<std::vector<cv::Point3d>>;
using FisheyeImages = std::vector<std::vector<cv::Point2d>>;

/// Where OpenCV finds the board: turn and shift for each view.
struct ViewPoses {
  std::vector<cv::Mat> turns, shifts;
};

double largest_tilt(const std::vector<cv::Mat>& turns) {
  double largest = 0.0;
  for (const cv::Mat& turn : turns) {
    cv::Mat rotation;
    cv::Rodrigues(turn, rotation);
    largest = std::max(largest, std::acos(std::min(1.0, std::abs(rotation.at<double>(2, 2)))));
  }
  return largest;
}

/// The angles between the optical axis and all corners, radians.
std::vector<double> angles_of_corners(const std::vector<LensView>& views, const ViewPoses& poses) {
  std::vector<double> angles;
  for (std::size_t v = 0; v < views.size(); ++v) {
    cv::Mat rotation;
    cv::Rodrigues(poses.turns[v], rotation);
    Eigen::Matrix3d R;
    cv::cv2eigen(rotation, R);
    const cv::Mat& shift = poses.shifts[v];
    const Eigen::Vector3d t(shift.at<double>(0), shift.at<double>(1), shift.at<double>(2));
    for (const cv::Point3f& corner : views[v].board) {
      const Eigen::Vector3d seen = R * Eigen::Vector3d(corner.x, corner.y, corner.z) + t;
      angles.push_back(std::atan2(seen.head<2>().norm(), seen.z()));
    }
  }
  return angles;
}

/// The standard deviation of fx by the normal equations of all corners, from which the poses of the board are
/// eliminated. @param free coefficients of distortion that were fitted
double focal_sigma_of_fisheye(const FisheyeBoards& boards, const ViewPoses& poses, const LensFit& fit, int free) {
  constexpr int kFirstOfPose = 8, kOfPose = 6;  // columns of OpenCV's jacobian: f, c, k1..k4, turn, shift, skew
  const int shared = 4 + free;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(shared, shared);
  double squares = 0.0, corners = 0.0;
  for (std::size_t v = 0; v < boards.size(); ++v) {
    std::vector<cv::Point2d> projected;
    cv::Mat derivatives;
    cv::fisheye::projectPoints(boards[v], projected, poses.turns[v], poses.shifts[v], fit.K, fit.distortion, 0.0,
                               derivatives);
    Eigen::MatrixXd jacobian;
    cv::cv2eigen(derivatives, jacobian);
    const Eigen::MatrixXd by_lens = jacobian.leftCols(shared), by_pose = jacobian.middleCols(kFirstOfPose, kOfPose);
    const Eigen::MatrixXd cross = by_pose.transpose() * by_lens;
    normal += by_lens.transpose() * by_lens -
              cross.transpose() * solve_symmetric(Eigen::MatrixXd(by_pose.transpose() * by_pose), cross);
    corners += static_cast<double>(projected.size());
    squares += fit.errors[v] * fit.errors[v] * static_cast<double>(projected.size());
  }
  const double freedoms = 2.0 * corners - shared - kOfPose * static_cast<double>(boards.size());
  const Eigen::VectorXd focal = Eigen::VectorXd::Unit(shared, 0);
  return std::sqrt(squares / std::max(1.0, freedoms) * solve_symmetric(normal, focal)[0]);
}

LensFit fit_fisheye(const std::vector<LensView>& views, const cv::Size& size) {
  FisheyeBoards boards;
  FisheyeImages images;
  for (const LensView& view : views) {
    boards.emplace_back(view.board.begin(), view.board.end());
    images.emplace_back(view.image.begin(), view.image.end());
  }
  LensFit fit;
  ViewPoses poses;
  const auto calibrate = [&](int free) {
    int flags = cv::fisheye::CALIB_RECOMPUTE_EXTRINSIC | cv::fisheye::CALIB_FIX_SKEW;
    if (free < 4) flags |= cv::fisheye::CALIB_FIX_K4;
    if (free < 3) flags |= cv::fisheye::CALIB_FIX_K3;
    fit.K = fit.distortion = cv::Mat();
    poses = {};  // OpenCV refuses vectors that are not empty
    fit.rms = cv::fisheye::calibrate(boards, images, size, fit.K, fit.distortion, poses.turns, poses.shifts, flags);
    return angles_of_corners(views, poses);
  };
  int free = 2;
  std::vector<double> angles = calibrate(free);
  const double reached = quantile(angles, kShareOfAngles) / kRadiansPerDegree;
  if (reached > kMinAngleOfK3) {
    free = reached > kMinAngleOfK4 ? 4 : 3;
    angles = calibrate(free);
  }
  fit.tilt = largest_tilt(poses.turns);
  fit.largest_angle = quantile(angles, 1.0);
  for (std::size_t v = 0; v < boards.size(); ++v) {
    std::vector<cv::Point2d> projected;
    cv::fisheye::projectPoints(boards[v], projected, poses.turns[v], poses.shifts[v], fit.K, fit.distortion);
    fit.errors.push_back(cv::norm(projected, images[v]) / std::sqrt(static_cast<double>(projected.size())));
  }
  fit.focal_sigma = focal_sigma_of_fisheye(boards, poses, fit, free);
  return fit;
}

/// The point of the image plane at depth 1 where an image corner lies, with distortion. @param corner 0 to 3
Eigen::Vector2d bent_corner(const Camera& camera, int corner) {
  const Eigen::Vector3d pixel(corner % 2 == 0 ? 0.0 : camera.width, corner < 2 ? 0.0 : camera.height, 1.0);
  const double y = (pixel.y() - camera.K(1, 2)) / camera.K(1, 1);
  return {(pixel.x() - camera.K(0, 2) - camera.K(0, 1) * y) / camera.K(0, 0), y};
}

/// Goes from the optical axis to an image corner. @return the angle at which the corner is reached, radians, and
/// whether it is; otherwise the lens turns back there, or the angle is 90 degrees
std::pair<double, bool> way_to_corner(const Camera& camera, int corner) {
  const Eigen::Vector2d bent = bent_corner(camera, corner);
  const Eigen::Vector2d direction = bent.normalized();
  double before = 0.0, angle = 0.0;
  for (double degrees = kLensStep; degrees < 90.0; degrees += kLensStep) {
    const double radius = camera.distorted(std::tan(degrees * kRadiansPerDegree) * direction).norm();
    if (!(radius > before)) return {angle, false};
    angle = degrees * kRadiansPerDegree;
    before = radius;
    if (radius >= bent.norm()) return {angle, true};
  }
  return {90.0 * kRadiansPerDegree, false};
}

}  // namespace

LensFit fit_lens(const std::vector<LensView>& views, const cv::Size& size, Lens lens) {
  if (lens == Lens::fisheye) return fit_fisheye(views, size);
  std::vector<std::vector<cv::Point3f>> board;
  std::vector<std::vector<cv::Point2f>> image;
  for (const LensView& view : views) {
    board.push_back(view.board);
    image.push_back(view.image);
  }
  LensFit fit;
  ViewPoses poses;
  cv::Mat sigmas, pose_sigmas, errors;
  // k3 is left at 0: a few views of a flat board do not determine it, and it then bends the corners of the image.
  fit.rms = cv::calibrateCamera(board, image, size, fit.K, fit.distortion, poses.turns, poses.shifts, sigmas,
                                pose_sigmas, errors, cv::CALIB_FIX_K3);
  fit.focal_sigma = sigmas.at<double>(0);
  fit.tilt = largest_tilt(poses.turns);
  fit.largest_angle = quantile(angles_of_corners(views, poses), 1.0);
  for (int v = 0; v < errors.rows; ++v) fit.errors.push_back(errors.at<double>(v));
  return fit;
}

double angle_of_image_corner(const Camera& camera) {
  double largest = 0.0;
  for (int corner = 0; corner < 4; ++corner) largest = std::max(largest, way_to_corner(camera, corner).first);
  return largest;
}

std::optional<double> angle_of_turning_back(const Camera& camera) {
  double smallest = 90.0 * kRadiansPerDegree;
  for (int corner = 0; corner < 4; ++corner) {
    const auto [angle, reached] = way_to_corner(camera, corner);
    if (!reached) smallest = std::min(smallest, angle);
  }
  return smallest < 89.0 * kRadiansPerDegree ? std::optional(smallest) : std::nullopt;
}

}  // namespace doppel
