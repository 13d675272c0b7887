/// Operators and classes for programs outside: `torch.ops.doppel` and `torch.classes.doppel` in Python. Each one calls
/// a function of the library. float32 takes its kernel, float64 its reference, and gradients are those of the function.
/// python/doppel wraps them with documentation.

#include <torch/custom_class.h>
#include <torch/library.h>

#include <algorithm>
#include <opencv2/core.hpp>

#include "doppel/core/error.h"
#include "doppel/core/tensor/checks.h"
#include "doppel/core/tensor/op.h"
#include "doppel/detect/masks/mask.h"
#include "doppel/geometry/topology.h"
#include "doppel/layers/closest_point/closest_point.h"
#include "doppel/layers/embedded_deformation/embedded_deformation.h"
#include "doppel/layers/graph_convolution/graph_convolution.h"
#include "doppel/layers/skinning/skinning.h"
#include "doppel/losses/silhouette.h"
#include "doppel/render/outline/boundary.h"
#include "doppel/render/shading/shading.h"

namespace doppel {
namespace {

using torch::Tensor;

template <typename T>
std::vector<T> values_of(const Tensor& tensor, torch::ScalarType type) {
  const Tensor plain = tensor.to(torch::kCPU, type).contiguous();
  return {plain.data_ptr<T>(), plain.data_ptr<T>() + plain.numel()};
}

/// Rows of indices. @param offsets [rows+1], ascending from 0 to the number of items
IndexRows rows_of(const Tensor& offsets, const Tensor& items) {
  IndexRows rows;
  rows.offsets = values_of<int>(offsets, torch::kInt32);
  rows.items = values_of<int>(items, torch::kInt32);
  if (rows.offsets.empty() || rows.offsets.front() != 0 || rows.offsets.back() != static_cast<int>(rows.items.size()) ||
      !std::is_sorted(rows.offsets.begin(), rows.offsets.end()))
    fail<UsageError>("offsets must rise from 0 to the number of items, {}", rows.items.size());
  return rows;
}

TriangleMesh mesh_of(const Tensor& vertices, const Tensor& faces) {
  check_shape("a mesh", "vertices", vertices, {-1, 3}, "[N,3]");
  TriangleMesh mesh;
  mesh.vertices = positions_of(vertices.contiguous());
  const std::vector<int> corners = values_of<int>(faces, torch::kInt32);
  if (faces.dim() != 2 || faces.size(1) != 3)
    fail<UsageError>("a mesh: faces must be [F,3], found {}", describe(faces));
  for (std::size_t f = 0; f < corners.size(); f += 3)
    mesh.faces.push_back({corners[f], corners[f + 1], corners[f + 2]});
  for (const int corner : corners)
    if (corner < 0 || corner >= mesh.num_vertices())
      fail<UsageError>("a mesh: a face names vertex {}, allowed are 0..{}", corner, mesh.num_vertices() - 1);
  return mesh;
}

struct SkinningLayer : torch::CustomClassHolder {
  SparseRows rows;
  SkinningLayer(const Tensor& offsets, const Tensor& bones, const Tensor& weights, std::int64_t num_bones)
      : rows(rows_of(offsets, bones), values_of<double>(weights, torch::kFloat64), num_bones, "skinning weights") {}
  Tensor forward(const Tensor& points, const Tensor& bones, bool dual_quaternions) const {
    return skinning(points, bones, rows, dual_quaternions ? SkinningMode::dual_quaternion : SkinningMode::linear);
  }
};

struct DeformationLayer : torch::CustomClassHolder {
  DeformationGraph graph;
  DeformationLayer(const Tensor& rest, const Tensor& nodes, const Tensor& offsets, const Tensor& items,
                   const Tensor& weights)
      : graph(positions_of(rest.contiguous()), positions_of(nodes.contiguous()), rows_of(offsets, items),
              values_of<double>(weights, torch::kFloat64)) {}
  Tensor forward(const Tensor& angles, const Tensor& translations, const OptionalTensor& displacements,
                 const OptionalTensor& node_transforms) const {
    return embedded_deformation(angles, translations, displacements.value_or(Tensor()),
                                node_transforms.value_or(Tensor()), graph);
  }
};

struct GraphConvolutionLayer : torch::CustomClassHolder {
  RingWeights ring;
  GraphConvolutionLayer(const Tensor& edges, std::int64_t num_nodes, std::int64_t rings)
      : ring(RingWeights::from_topology(topology(edges, num_nodes), static_cast<int>(rings))) {}
  static MeshTopology topology(const Tensor& edges, std::int64_t num_nodes) {
    const std::vector<int> ends = values_of<int>(edges, torch::kInt32);
    std::vector<std::array<int, 2>> pairs;
    for (std::size_t e = 0; e + 1 < ends.size(); e += 2) {
      if (std::min(ends[e], ends[e + 1]) < 0 || std::max(ends[e], ends[e + 1]) >= num_nodes)
        fail<UsageError>("graph convolution: an edge joins {} and {}, allowed are 0..{}", ends[e], ends[e + 1],
                         num_nodes - 1);
      pairs.push_back({std::min(ends[e], ends[e + 1]), std::max(ends[e], ends[e + 1])});
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    return {static_cast<int>(num_nodes), pairs};
  }
  Tensor forward(const Tensor& features, const Tensor& kernels, const Tensor& bias) const {
    return graph_convolution(features, kernels, bias, ring);
  }
};

struct ClosestPointLayer : torch::CustomClassHolder {
  ClosestPoint layer;
  ClosestPointLayer(const Tensor& vertices, const Tensor& faces) : layer(mesh_of(vertices, faces)) {}
  std::tuple<Tensor, Tensor, Tensor> forward(const Tensor& vertices, const Tensor& points) const {
    const ClosestPoints found = layer->forward(vertices, points);
    return {found.distance, found.weights, found.face};
  }
};

struct ShadingLayer : torch::CustomClassHolder {
  RenderMesh mesh;
  ShadingLayer(const Tensor& faces, const OptionalTensor& corner_uvs, std::int64_t num_vertices)
      : mesh(faces, corner_uvs.value_or(Tensor()), num_vertices) {}
  std::tuple<Tensor, Tensor> forward(const Tensor& vertices, const OptionalTensor& texture,
                                     const OptionalTensor& lighting, const Tensor& projection, std::int64_t height,
                                     std::int64_t width) const {
    ShadingOptions options;
    options.lit = lighting.has_value();
    const ShadedImage image = shade(vertices, texture.value_or(Tensor()), lighting.value_or(Tensor()), projection, mesh,
                                    height, width, options);
    return {image.colour, image.mask};
  }
};

Tensor boundary(const Tensor& vertices, const Tensor& projection, const Tensor& faces, std::int64_t height,
                std::int64_t width, bool visible_only) {
  BoundaryOptions options;
  options.visible_only = visible_only;
  return boundary_vertices(vertices.detach().to(torch::kFloat32), projection.to(torch::kFloat32), faces, height, width,
                           {}, options);
}

std::tuple<Tensor, Tensor> silhouette(const Tensor& vertices, const Tensor& faces, const Tensor& boundary_set,
                                      const Tensor& projection, const Tensor& distance, const Tensor& valid,
                                      const Tensor& contour, const Tensor& contour_offsets) {
  SilhouetteTarget target;
  target.projection = projection;
  target.distance = distance;
  target.valid = valid;
  target.contour = contour;
  target.contour_offsets = contour_offsets;
  const SilhouetteLoss loss = silhouette_loss(vertices, faces, boundary_set, target);
  return {loss.model_to_data, loss.data_to_model};
}

/// @param masks bool or uint8 [B,C,S,S], not 0: the person
/// @return distance [B,C,S,S], valid [B,C], contour [P,2], contour_offsets [B*C+1], as in SilhouetteTarget
std::tuple<Tensor, Tensor, Tensor, Tensor> silhouette_target(const Tensor& masks) {
  if (masks.dim() != 4) fail<UsageError>("silhouette_target: masks must be [B,C,S,S], found {}", describe(masks));
  const std::int64_t views = masks.size(0) * masks.size(1), height = masks.size(2), width = masks.size(3);
  const Tensor bytes = masks.ne(0).to(torch::kUInt8).mul(255).view({views, height, width}).contiguous();
  const Tensor distance = torch::zeros({views, height, width}), valid = torch::zeros({views}, torch::kBool);
  std::vector<float> contour;
  std::vector<std::int64_t> offsets{0};
  for (std::int64_t v = 0; v < views; ++v) {
    const cv::Mat mask(static_cast<int>(height), static_cast<int>(width), CV_8U, bytes[v].data_ptr());
    const int area = cv::countNonZero(mask);
    if (area > 0 && area < height * width) {
      cv::Mat out(mask.size(), CV_32F, distance[v].data_ptr());
      signed_distance(mask).copyTo(out);
      valid[v] = true;
      for (const ContourPixel& pixel : contour_pixels(mask))
        contour.insert(contour.end(), {static_cast<float>(pixel.x) + 0.5f, static_cast<float>(pixel.y) + 0.5f});
    }
    offsets.push_back(static_cast<std::int64_t>(contour.size() / 2));
  }
  return {distance.view(masks.sizes()), valid.view({masks.size(0), masks.size(1)}),
          torch::tensor(contour).view({-1, 2}), torch::tensor(offsets)};
}

TORCH_LIBRARY_FRAGMENT(doppel, m) {
  m.class_<SkinningLayer>("Skinning")
      .def(torch::init<const Tensor&, const Tensor&, const Tensor&, std::int64_t>())
      .def("forward", &SkinningLayer::forward);
  m.class_<DeformationLayer>("EmbeddedDeformation")
      .def(torch::init<const Tensor&, const Tensor&, const Tensor&, const Tensor&, const Tensor&>())
      .def("forward", &DeformationLayer::forward);
  m.class_<GraphConvolutionLayer>("GraphConvolution")
      .def(torch::init<const Tensor&, std::int64_t, std::int64_t>())
      .def("forward", &GraphConvolutionLayer::forward);
  m.class_<ClosestPointLayer>("ClosestPoint")
      .def(torch::init<const Tensor&, const Tensor&>())
      .def("forward", &ClosestPointLayer::forward);
  m.class_<ShadingLayer>("Shading")
      .def(torch::init<const Tensor&, const OptionalTensor&, std::int64_t>())
      .def("forward", &ShadingLayer::forward);
  m.def(
      "boundary_vertices(Tensor vertices, Tensor projection, Tensor faces, int height, int width, bool "
      "visible_only=False) -> Tensor",
      boundary);
  m.def(
      "silhouette(Tensor vertices, Tensor faces, Tensor boundary, Tensor projection, Tensor distance, Tensor valid, "
      "Tensor contour, Tensor contour_offsets) -> (Tensor model_to_data, Tensor data_to_model)",
      silhouette);
  m.def("silhouette_target(Tensor masks) -> (Tensor distance, Tensor valid, Tensor contour, Tensor contour_offsets)",
        silhouette_target);
}

}  // namespace
}  // namespace doppel
