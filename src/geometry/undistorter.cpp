#include "doppel/geometry/undistorter.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

namespace doppel {

Undistorter::Undistorter(const Camera& camera) : camera_(camera), pinhole_(without_distortion(camera)) {
  if (!camera.has_distortion()) return;
  map1_.create(camera.height, camera.width, CV_32FC1);
  map2_.create(camera.height, camera.width, CV_32FC1);
  const Eigen::Matrix3d depth_one_from_pixel = camera.K.inverse();
  for (int row = 0; row < camera.height; ++row)
    for (int column = 0; column < camera.width; ++column) {
      const Eigen::Vector2d point = (depth_one_from_pixel * Eigen::Vector3d(column + 0.5, row + 0.5, 1.0)).head<2>();
      const Eigen::Vector2d pixel = (camera.K * camera.distorted(point).homogeneous()).head<2>();
      map1_.at<float>(row, column) = static_cast<float>(pixel.x() - 0.5);  // cv::remap has pixel centres at integers
      map2_.at<float>(row, column) = static_cast<float>(pixel.y() - 0.5);
    }
}

Eigen::Vector2d Undistorter::apply(const Eigen::Vector2d& pixel) const {
  if (!camera_.has_distortion()) return pixel;
  const Eigen::Vector2d point = (camera_.K.inverse() * pixel.homogeneous()).head<2>();
  const auto straight = camera_.undistorted(point);
  if (!straight) return pixel;
  return (camera_.K * straight->homogeneous()).head<2>();
}

cv::Mat Undistorter::apply(const cv::Mat& image) const {
  if (map1_.empty()) return image;
  cv::Mat result;
  cv::remap(image, result, map1_, map2_, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  return result;
}

}  // namespace doppel
