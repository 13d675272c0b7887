#pragma once

/// Semantic labels of a character's vertices from label images of several views (4.3). Each view that sees a vertex
/// votes for the label of the pixel at the vertex's projection; the majority decides.

#include <cstdint>
#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// The label (`character/labels.h`) that a pixel value of a label image stands for.
class LabelLegend {
 public:
  /// Grey values are the labels themselves, 0..20.
  LabelLegend();
  /// A YAML mapping from label names to a grey value, or to red, green and blue.
  /// @code
  ///   background: 0
  ///   upper_clothes: [255, 85, 0]
  /// @endcode
  /// @throws FileError for an unknown name, a value that is not a colour, or a colour with two labels
  static LabelLegend read(const std::filesystem::path& path);

  /// @param image 8-bit, grey or BGR(A) @param source path of the image, for messages
  /// @return uint8 [H,W]
  /// @throws FileError for another kind of image, or naming the first pixel without a label
  cv::Mat labels(const cv::Mat& image, const std::string& source) const;

 private:
  std::map<std::uint32_t, int> label_of_;  ///< by 0xRRGGBB
};

struct LabelView {
  Camera camera;   ///< at the resolution of the image, with its distortion
  cv::Mat labels;  ///< uint8 [H,W]
};

/// The label images in `folder`: `NAME.png` (or another lossless format) is the image of camera NAME.
/// @throws Error for an image that belongs to no camera, or a folder without images; FileError for an image that cannot
/// be read, has another size than its camera, or contains a colour without a label
std::vector<LabelView> read_label_views(const std::filesystem::path& folder, const std::vector<Camera>& cameras,
                                        const LabelLegend& legend);

struct VertexLabels {
  std::vector<int> labels;  ///< [N]
  int voted = 0;            ///< vertices with votes; the others get the label of the nearest of these along the mesh
};
/// @param vertices [N] world metres, as the views show them
/// Background pixels do not vote: a vertex projects onto background only because of small errors of the calibration or
/// the pose. Between labels with equally many votes, the views that see the vertex most directly decide.
/// @throws Error when no view sees any vertex
VertexLabels label_vertices(const Character& character, const std::vector<Eigen::Vector3d>& vertices,
                            const std::vector<LabelView>& views);

}  // namespace doppel
