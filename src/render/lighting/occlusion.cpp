#include "doppel/render/lighting/occlusion.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "doppel/core/tensor/checks.h"
#include "doppel/render/lighting/sh_lighting.h"
#include "doppel/render/splats/surface_frames.h"

namespace doppel {
namespace {

using torch::Tensor;

constexpr std::int64_t kMinVertices = 4;  // of a slice: fewer have no centre inside the body
constexpr double kMinRadius = 0.02;       // metres; fingers shade too little
constexpr double kMaxAmount = 0.9;
constexpr double kMinLight = 0.1;

/// A slice of a part of the body.
struct LimbSlice {
  Tensor vertices;  ///< int64 [M] indices
  double radius;    ///< metres
};

/// @param positions [M,3] of the part's vertices, `index` [M]
std::vector<LimbSlice> slices_of(const Tensor& positions, const Tensor& index) {
  const Tensor centred = positions - positions.mean(0);
  const Tensor axis = std::get<1>(torch::linalg_eigh(centred.t().matmul(centred), "L")).select(1, 2);
  const Tensor along = centred.matmul(axis), away = (centred - along.unsqueeze(1) * axis).norm(2, 1);
  const double low = along.min().item<double>(), length = along.max().item<double>() - low,
               radius = std::max(away.mean().item<double>(), 1e-3);
  const auto count = std::max<std::int64_t>(1, std::lround(length / (2 * radius)));
  const Tensor slice =
      ((along - low) * (static_cast<double>(count) / std::max(length, 1e-9))).to(torch::kInt64).clamp(0, count - 1);
  std::vector<LimbSlice> slices;
  for (std::int64_t k = 0; k < count; ++k) {
    const Tensor members = (slice == k).nonzero().squeeze(1);
    if (members.size(0) < kMinVertices) continue;
    const double mean = away.index_select(0, members).mean().item<double>();
    if (mean >= kMinRadius) slices.push_back({index.index_select(0, members), mean});
  }
  return slices;
}

}  // namespace

BodySpheres::BodySpheres(const Tensor& vertices, const Tensor& parts) {
  check_floats("BodySpheres", "vertices", vertices, {-1, 3}, "[N,3]");
  check_tensor("BodySpheres", "parts", parts, {torch::kInt64}, {vertices.size(0)}, "[N]");
  std::vector<LimbSlice> slices;
  for (std::int64_t part = 0; part <= parts.max().item<std::int64_t>(); ++part) {
    const Tensor index = (parts == part).nonzero().squeeze(1);
    if (index.size(0) < kMinVertices) continue;
    for (LimbSlice& slice : slices_of(vertices.index_select(0, index), index)) slices.push_back(std::move(slice));
  }
  const auto count = static_cast<std::int64_t>(slices.size());
  members_ = torch::zeros({count, vertices.size(0)});
  radius_ = torch::empty({count});
  for (std::int64_t k = 0; k < count; ++k) {
    const LimbSlice& slice = slices[static_cast<std::size_t>(k)];
    members_[k].index_fill_(0, slice.vertices, 1.0 / static_cast<double>(slice.vertices.size(0)));
    radius_[k] = slice.radius;
  }
  const Tensor distance = torch::cdist(vertices, members_.matmul(vertices));
  weight_ = ((distance / radius_ - 1.5) / 0.5).clamp(0.0, 1.0) * radius_.square();
}

Occlusion BodySpheres::at(const Tensor& vertices, const Tensor& normals) const {
  // About the middle of the body, where differences of squares are exact enough.
  const Tensor x = vertices - vertices.mean(1, true), c = torch::matmul(members_, x);  // [B,N,3], [B,K,3]
  const auto dot = [](const Tensor& a, const Tensor& b) { return (a * b).sum(2, true); };
  // |x - c|^2 and n . (c - x), each as one product of matrices. @return [B,N,K]
  const Tensor ones_x = torch::ones_like(x.narrow(2, 0, 1)), ones_c = torch::ones_like(c.narrow(2, 0, 1));
  const Tensor squared =
      torch::matmul(torch::cat({x, dot(x, x), ones_x}, 2), torch::cat({-2 * c, ones_c, dot(c, c)}, 2).transpose(1, 2));
  const Tensor facing =
      torch::matmul(torch::cat({normals, dot(normals, x)}, 2), torch::cat({c, -ones_c}, 2).transpose(1, 2));
  const Tensor inverse = squared.maximum(radius_.square()).rsqrt();
  const Tensor share = facing.clamp_min(0.0) * weight_ * inverse * (inverse * inverse), weight = share * inverse;
  const Tensor mean = torch::matmul(weight, c) - weight.sum(2, true) * x;
  return {share.sum(2).clamp_max(kMaxAmount), unit_vectors(mean)};
}

Tensor shaded_light(const Tensor& normals, const Occlusion& occlusion, const Tensor& lighting, const Tensor& strength) {
  const Tensor bands = torch::tensor({1.0, 1.5, 1.5, 1.5, 4.0, 4.0, 4.0, 4.0, 4.0}, torch::kFloat32);
  const Tensor light = sh_basis(normals).matmul(lighting.t()),
               from = sh_basis(occlusion.direction).matmul((lighting * bands).t()).clamp_min(0.0);
  return torch::maximum(kMinLight * light, light - strength * occlusion.amount.unsqueeze(2) * from);
}

}  // namespace doppel
