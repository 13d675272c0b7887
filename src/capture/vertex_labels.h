#pragma once

/// What every vertex of a character is made of, from label images of several views (4.3): each view in which a vertex
/// is seen votes with the label of the pixel that the vertex falls on, and the majority decides.

#include <cstdint>
#include <filesystem>
#include <map>
#include <opencv2/core.hpp>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// Which label (`character/labels.h`) a pixel of a label image stands for.
class LabelLegend {
 public:
  /// Grey values are the labels themselves, 0..20.
  LabelLegend();
  /// A YAML mapping from names of labels to what shows them: a grey value, or red, green and blue.
  /// @code
  ///   background: 0
  ///   upper_clothes: [255, 85, 0]
  /// @endcode
  /// @throws FileError for an unknown name, a value that is no colour, or a colour with two labels
  static LabelLegend read(const std::filesystem::path& path);

  /// @param image 8-bit, grey or BGR(A) @param source where it comes from, for messages
  /// @return uint8 [H,W]; @throws FileError for another kind of image, or naming the first pixel without a label
  cv::Mat labels(const cv::Mat& image, const std::string& source) const;

 private:
  std::map<std::uint32_t, int> label_of_;  ///< by 0xRRGGBB
};

struct LabelView {
  Camera camera;   ///< at the resolution of the image, with its distortion
  cv::Mat labels;  ///< uint8 [H,W]
};

/// The label images in `folder`: `NAME.png` (any lossless format) is what camera NAME sees.
/// @throws Error for an image that belongs to no camera, or no image at all; FileError for one that cannot be read,
///   has another shape than its camera, or holds a colour without a label
std::vector<LabelView> read_label_views(const std::filesystem::path& folder, const std::vector<Camera>& cameras,
                                        const LabelLegend& legend);

struct VertexLabels {
  std::vector<int> labels;  ///< [N]
  int voted = 0;            ///< vertices that a view decided; the others took the label of the nearest along the mesh
};
/// @param vertices [N] world metres, as the views show them
/// Background does not vote: where a vertex falls beside the person, the calibration or the pose is off by a pixel. Of
/// labels with equally many votes the one that is looked at most directly wins.
/// @throws Error when no view shows any vertex
VertexLabels label_vertices(const Character& character, const std::vector<Eigen::Vector3d>& vertices,
                            const std::vector<LabelView>& views);

}  // namespace doppel
