#pragma once

#include <torch/types.h>

#include "doppel/render/shading/shading_terms.h"

/// The pixels that a mesh covers and the surface points that they show, in plain tensor operations.
namespace doppel::shading {

/// P pixels of all views, in the order of the views.
struct Pixels {
  torch::Tensor pixel;       ///< int64 [P], index into [B*C*H*W]
  torch::Tensor view, item;  ///< int64 [P]
  torch::Tensor face;        ///< int64 [P]
  torch::Tensor corner[3];   ///< int64 [P], rows of [B*N,3]
  torch::Tensor u, v;        ///< [P] pixel centres
  torch::Tensor mask;        ///< bool [B,C,H,W]
};

/// No gradient: a pixel keeps its face.
Pixels visible_pixels(const torch::Tensor& vertices, const torch::Tensor& projection, const RenderMesh& mesh,
                      std::int64_t height, std::int64_t width, float z_near);

/// Barycentrics [P,3], differentiable where the pixel lies within its face and the face is not seen edge-on.
torch::Tensor barycentrics(const Pixels& pixels, const torch::Tensor& vertices, const ViewTensors& views);

/// Sum of the corners' values [P,k], weighted with b [P,3].
torch::Tensor interpolate(const torch::Tensor& b, const torch::Tensor& at0, const torch::Tensor& at1,
                          const torch::Tensor& at2);

/// Unit normals [P,3], flipped towards the camera on request; 0 where the surface has none.
torch::Tensor pixel_normals(const Pixels& pixels, const torch::Tensor& b, const torch::Tensor& vertices,
                            const RenderMesh& mesh, const ViewTensors& views, bool flip);

}  // namespace doppel::shading
