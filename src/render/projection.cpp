#include "doppel/render/projection.h"

#include "doppel/core/tensor/checks.h"

namespace doppel {

using torch::Tensor;
using torch::indexing::Ellipsis;
using torch::indexing::Slice;

Tensor project(const Tensor& points, const Tensor& projection) {
  check_shape("project", "points", points, {-1, -1, 3}, "[B,N,3]");
  check_shape("project", "projection", projection, {points.size(0), -1, 3, 4}, "[B,C,3,4]");
  const Tensor linear = projection.index({Ellipsis, Slice(0, 3)}), offset = projection.index({Ellipsis, 3});
  const Tensor h = torch::matmul(points.unsqueeze(1), linear.transpose(2, 3)) + offset.unsqueeze(2);  // [B,C,N,3]
  return h.index({Ellipsis, Slice(0, 2)}) / h.index({Ellipsis, Slice(2, 3)});
}

Tensor projection_tensor(const std::vector<PinholeCamera>& cameras, torch::ScalarType dtype) {
  Tensor out = torch::empty({static_cast<std::int64_t>(cameras.size()), 3, 4}, torch::kFloat64);
  double* data = out.data_ptr<double>();
  for (const Camera& camera : cameras) {
    const Eigen::Matrix<double, 3, 4> p = camera.projection();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) *data++ = p(r, c);
    }
  }
  return out.to(dtype);
}

CameraPlacement camera_placement(const Tensor& projection) {
  const Tensor p = projection.to(torch::kFloat64);
  const Tensor M = p.index({Ellipsis, Slice(0, 3)}), offset = p.index({Ellipsis, Slice(3, 4)});
  const Tensor centre = -torch::matmul(torch::inverse(M), offset).squeeze(-1);
  const Tensor axis = M.select(-2, 2);
  // A matrix multiplied by a negative number describes the same camera.
  const Tensor forward = axis * torch::det(M).sign().unsqueeze(-1) / axis.norm(2, {-1}, true);
  return {centre.to(projection.scalar_type()), forward.to(projection.scalar_type())};
}

Tensor camera_from_world(const Tensor& points, const std::vector<PinholeCamera>& cameras) {
  check_shape("camera_from_world", "points", points, {-1, 3}, "[N,3]");
  std::vector<Tensor> out;
  for (const Camera& camera : cameras) {
    const Eigen::Matrix3d columns = camera.R.transpose();  // row-major R
    const Tensor r = torch::from_blob(const_cast<double*>(columns.data()), {3, 3}, torch::kFloat64).to(points.dtype());
    const Tensor t = torch::from_blob(const_cast<double*>(camera.t.data()), {3}, torch::kFloat64).to(points.dtype());
    out.push_back(torch::matmul(points, r.t()) + t);
  }
  if (out.empty()) return points.new_empty({0, points.size(0), 3});
  return torch::stack(out);
}

}  // namespace doppel
