#include "doppel/track/surface/vertex_colours.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace doppel {
namespace {

constexpr int kBlur = 5;  // texels: a vertex represents the surface around it

Eigen::Vector3d texel(const cv::Mat& texture, const Eigen::Vector2d& uv) {
  const int column = std::clamp(static_cast<int>(uv.x() * texture.cols), 0, texture.cols - 1);
  const int row = std::clamp(static_cast<int>((1.0 - uv.y()) * texture.rows), 0, texture.rows - 1);
  const auto& bgr = texture.at<cv::Vec3b>(row, column);
  return Eigen::Vector3d(bgr[2], bgr[1], bgr[0]) / 255.0;
}

}  // namespace

Eigen::Matrix3Xd vertex_colours(const TriangleMesh& mesh) {
  Eigen::Matrix3Xd colours(3, mesh.num_vertices());
  if (!mesh.colours.empty()) {
    for (Eigen::Index i = 0; i < colours.cols(); ++i) colours.col(i) = mesh.colours[i];
    return colours;
  }
  if (mesh.texture.empty() || mesh.face_uvs.empty()) return {};
  cv::Mat texture;
  cv::GaussianBlur(mesh.texture, texture, {kBlur, kBlur}, 0.0);
  Eigen::VectorXd corners = Eigen::VectorXd::Zero(colours.cols());
  colours.setZero();
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const int vertex = mesh.faces[f][k];
      colours.col(vertex) += texel(texture, mesh.uvs[mesh.face_uvs[f][k]]);
      corners[vertex] += 1.0;
    }
  for (Eigen::Index i = 0; i < colours.cols(); ++i) colours.col(i) /= std::max(1.0, corners[i]);
  return colours;
}

}  // namespace doppel
