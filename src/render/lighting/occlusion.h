#pragma once

#include <torch/types.h>

namespace doppel {

/// The light that a body takes from a point of its own surface.
struct Occlusion {
  torch::Tensor amount;     ///< [B,N] o: the share of uniform light that is taken, 0 to 0.9
  torch::Tensor direction;  ///< [B,N,3] m: unit, from the point to what takes the light; 0 where nothing does
};

/// Spheres in the limbs of a body, which shade its surface: the arm darkens the hip. They move with the vertices, so
/// that no skeleton is needed.
///
/// A sphere of radius r, at the distance d in the direction u of a point with the normal n, takes the share
/// (r/d)^2 max(0, n . u) of uniform light (a disc of that solid angle; exact for small spheres above the horizon).
/// The shares of all spheres add up to o, at most 0.9, and m is their mean direction.
class BodySpheres {
 public:
  /// Divides each part of the body into slices along its longest axis, about as long as they are wide. A slice becomes
  /// a sphere about the centre of its vertices, with their mean distance from the axis as radius, if this is at least 2
  /// cm. A sphere does not shade the vertices that are near to it in the given pose, up to twice the radius from its
  /// centre.
  /// @param vertices float32 [N,3] of the template, metres @param parts int64 [N] the part of each vertex, 0 or more
  BodySpheres(const torch::Tensor& vertices, const torch::Tensor& parts);

  /// Plain tensor operations. @param vertices [B,N,3] world, metres @param normals [B,N,3] unit
  Occlusion at(const torch::Tensor& vertices, const torch::Tensor& normals) const;

  std::int64_t size() const { return radius_.size(0); }

 private:
  torch::Tensor members_;  ///< [K,N] the weights of the vertices in a centre
  torch::Tensor radius_;   ///< [K] metres
  torch::Tensor weight_;   ///< [N,K] r^2, or less where the sphere is near in the given pose, to 0
};

/// The light at points of a shaded surface: max(0.1 L(n), L(n) - strength o R(m)), with the light R that comes from a
/// direction. R is L without the cosine of Lambert's law: its bands are 1, 3/2 and 4 times those of L (Ramamoorthi and
/// Hanrahan 2001). @param normals [B,N,3] @param lighting [3,9] as `shade` takes it @return [B,N,3]
torch::Tensor shaded_light(const torch::Tensor& normals, const Occlusion& occlusion, const torch::Tensor& lighting,
                           const torch::Tensor& strength);

}  // namespace doppel
