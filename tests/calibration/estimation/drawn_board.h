#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "doppel/calibration/estimation/board.h"
#include "doppel/geometry/camera.h"

namespace doppel::support {

/// World from board.
struct BoardPose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
};

/// The grey level of a board's plane at a point in metres; negative: the board ends here.
using BoardPaint = std::function<double(double x, double y)>;

/// The squares of a chessboard with a white margin; the square behind the first corner is black.
inline BoardPaint chessboard_paint(const Board& board) {
  return [board](double x, double y) {
    const double i = std::floor(x / board.square), j = std::floor(y / board.square);
    const double margin = 0.6;
    if (x < -(1.0 + margin) * board.square || x > (board.columns + margin) * board.square ||
        y < -(1.0 + margin) * board.square || y > (board.rows + margin) * board.square)
      return -1.0;
    const bool square = i >= -1.0 && i < board.columns && j >= -1.0 && j < board.rows;
    return square && std::fmod(i + j + 4.0, 2.0) == 0.0 ? 25.0 : 230.0;
  };
}

/// What a camera sees of a board before a grey wall: the mean of rays all over each pixel, so that edges lie where they
/// are to a small fraction of a pixel. The centre of the first pixel is (0.5, 0.5). The lens is linear within a pixel.
inline cv::Mat drawn_board(const Camera& camera, const BoardPose& pose, const BoardPaint& paint, unsigned seed) {
  constexpr int kRays = 4;  // per pixel and axis
  const auto plane_of = [&](double u, double v) {
    const Eigen::Vector2d bent((u - camera.K(0, 2)) / camera.K(0, 0), (v - camera.K(1, 2)) / camera.K(1, 1));
    return camera.undistorted(bent).value_or(bent);
  };
  cv::Mat image(camera.height, camera.width, CV_8U);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 2.0);
  const Eigen::Vector3d centre = pose.R.transpose() * (camera.centre() - pose.t);
  const Eigen::Matrix3d board_from_camera = pose.R.transpose() * camera.R.transpose();
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector2d middle = plane_of(u + 0.5, v + 0.5), across = plane_of(u + 1.5, v + 0.5) - middle,
                            down = plane_of(u + 0.5, v + 1.5) - middle;
      double sum = 0.0;
      for (int i = 0; i < kRays * kRays; ++i) {
        const double x = (i % kRays + 0.5) / kRays - 0.5, y = (i / kRays + 0.5) / kRays - 0.5;
        const Eigen::Vector2d plane = middle + x * across + y * down;
        const Eigen::Vector3d ray = board_from_camera * plane.homogeneous();
        const double along = -centre.z() / ray.z();
        const Eigen::Vector3d hit = centre + along * ray;
        const double found = along > 0.0 ? paint(hit.x(), hit.y()) : -1.0;
        sum += (found >= 0.0 ? found : 120.0) / (kRays * kRays);
      }
      image.at<unsigned char>(v, u) = cv::saturate_cast<unsigned char>(sum + noise(random));
    }
  return image;
}

/// A board that faces the point `towards` from `at`, turned by angles in radians.
inline BoardPose facing(const Eigen::Vector3d& at, const Eigen::Vector3d& towards, double tilt, double pan, double roll,
                        const Board& board) {
  const Eigen::Vector3d z = (at - towards).normalized();  // the board's z points away from the viewer
  const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(z).normalized() * -1.0;
  Eigen::Matrix3d R;
  R.col(0) = x;
  R.col(1) = z.cross(x);
  R.col(2) = z;
  R = R * (Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(pan, Eigen::Vector3d::UnitY()) *
           Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()))
              .toRotationMatrix();
  const Eigen::Vector3d middle = 0.5 * (board.corner(0) + board.corner(board.num_corners() - 1));
  return {R, at - R * middle};
}

}  // namespace doppel::support
