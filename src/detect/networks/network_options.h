#pragma once

#include <array>
#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace doppel {

/// How the outputs of a network are read: one adapter each (output_adapter.h).
enum class OutputKind {
  automatic,  ///< by the shapes of the outputs
  heatmaps,   ///< [1, >= K, h, w]: one image of each point
  simcc,      ///< [1, K, W*r] and [1, K, H*r]: one row of bins of each point for x, one for y
  points,     ///< [1, K*2|3|5]: coordinates
  mask,       ///< [1, 1|2|N, h, w]: the person's pixels
  boxes,      ///< [1, N, 5]: x1, y1, x2, y2, score; perhaps a second output [1, N] with the classes
  ssd,        ///< [1, 1, N, 7]: image, class, score, x1, y1, x2, y2 as fractions
  yolox       ///< [1, N, 5+C] relative to the cells of three grids
};

/// Where the entries of a heatmap (or a row of bins) lie on the network's input of W pixels.
enum class OutputGrid {
  cells,    ///< entry i of n covers W/n pixels: its centre is (i + 1/2) W/n
  samples,  ///< entry i is the centre of pixel i W/n: i W/n + 1/2 (MSRA heatmaps, SimCC)
  ends      ///< the first and the last entry are the centres of the first and last pixels (UDP)
};

/// How the maximum of a heatmap is refined below its grid.
enum class PeakRefinement {
  none,
  quarter,   ///< a quarter of an entry towards the larger neighbour
  parabola,  ///< the maximum of a parabola through the neighbours, in x and in y
  dark       ///< the maximum of a quadratic function fitted to the logarithm (Zhang et al., CVPR 2020, eq. 7)
};

/// What turns the values of a mask into probabilities.
enum class MaskActivation {
  automatic,  ///< none when the network ends in Sigmoid, Softmax or Clip; otherwise one of the next two by the channels
  sigmoid,
  softmax,
  none
};

/// A network for images and the way to its inputs and from its outputs. docs/detect.md explains the keys.
struct NetworkOptions {
  std::filesystem::path model;                        ///< .onnx, or the .prototxt of a Caffe model
  std::filesystem::path weights;                      ///< .caffemodel of a .prototxt; empty for .onnx
  cv::Size input;                                     ///< of the network; empty: `input_height` decides
  int input_height = 368;                             ///< the width follows from the image, both multiples of 8
  bool letterbox = false;                             ///< keep the aspect ratio of a whole image
  double border = 0.0;                                ///< colour of what lies beyond the image, 0..255
  std::array<double, 3> mean{0.0, 0.0, 0.0};          ///< value = (colour - mean) / deviation, colours 0..255,
  std::array<double, 3> deviation{255., 255., 255.};  ///< both in the order of the network's channels
  bool rgb = false;                                   ///< the network expects RGB, otherwise BGR
  OutputKind output = OutputKind::automatic;
  std::vector<std::string> outputs;      ///< names of the outputs to read, in order; empty: all
  double threshold = 0.1;                ///< points and boxes of lower scores are not seen
  std::optional<OutputGrid> grid;        ///< default: cells, for SimCC samples
  std::optional<PeakRefinement> refine;  ///< default: parabola, for SimCC none
  int blur = 11;                         ///< side of the Gaussian before `dark`, entries, odd; 0: none
  bool fractions = false;                ///< regressed points are fractions of the input
  std::vector<std::string> values;       ///< of a regressed point: x, y, score, logit, skip
  MaskActivation activation = MaskActivation::automatic;
  std::optional<int> person;  ///< index of the class `person`
};

/// The part of the image that a top-down network sees: a person with a margin.
struct CropOptions {
  std::optional<NetworkOptions> boxes;  ///< a network that finds people; none: begin with the whole image
  bool track = true;                    ///< the crop follows from the result of the image before, if there is one
  double padding = 1.25;                ///< sides of the crop by sides of the person's box
};

/// Networks that find one person in an image.
struct PersonNetworkOptions {
  NetworkOptions network;              ///< points or a mask
  std::optional<CropOptions> crop;     ///< none: `network` sees the whole image
  std::optional<NetworkOptions> mask;  ///< a further network for the mask, which sees the whole image
};

}  // namespace doppel
