#pragma once

#include <torch/types.h>

#include <functional>
#include <map>
#include <vector>

namespace doppel {

/// The surfaces of consecutive frames, smoothed over time (5.8): each vertex is the mean of its positions in the frames
/// f - r .. f + r under a Gaussian exp(-d^2 / (2 sigma^2)) of the distance d in frames, with r = ceil(2 sigma); a sigma
/// of 1 gives the five frames of the thesis. Frames of another segment do not count; the weights of the others sum
/// to 1.
class SmoothedSurfaces {
 public:
  /// @param surface of a frame, float32 [N,3]; called once for each frame, in their order
  /// @param frames number of frames, from 0 @param cuts frames that begin a segment, ascending
  /// @param sigma frames; 0: surfaces stay as they are
  SmoothedSurfaces(std::function<torch::Tensor(long)> surface, long frames, std::vector<long> cuts, double sigma);

  /// The smoothed surface, float32 [N,3]. @param frame not before that of the last call
  torch::Tensor at(long frame);

 private:
  const torch::Tensor& surface(long frame);

  std::function<torch::Tensor(long)> make_;
  long frames_;
  std::vector<long> cuts_;
  double sigma_;
  long radius_;
  std::map<long, torch::Tensor> near_;  ///< surfaces that this frame or later ones need
};

}  // namespace doppel
