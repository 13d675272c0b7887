#include "doppel/track/surface_errors.h"

#include <fmt/ranges.h>

#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/track/energy/outline.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;
using Surface = Eigen::Map<const Eigen::Matrix3Xf>;

/// Surfaces of consecutive frames, float32 [frames,N,3].
class SurfaceFile {
 public:
  SurfaceFile(const fs::path& path, int num_vertices, long frames) : num_vertices_(num_vertices) {
    const NpyArray array = read_npy(path);
    if (array.shape.size() != 3 || array.shape[0] < frames || array.shape[1] != num_vertices || array.shape[2] != 3)
      fail("{}: expected {} frames or more of [{},3] for this character, found [{}]", path.string(), frames,
           num_vertices, fmt::join(array.shape, ","));
    values_ = array.as<float>();
  }
  Surface at(long frame) const { return {values_.data() + 3 * num_vertices_ * frame, 3, num_vertices_}; }

 private:
  long num_vertices_;
  std::vector<float> values_;
};

double distance_mm(const Eigen::Matrix3Xd& found, const Surface& ground_truth) {
  const Eigen::Matrix3Xd difference = found - ground_truth.cast<double>();
  return 1e3 * (difference.colwise() - difference.rowwise().mean()).colwise().norm().mean();
}

Eigen::Matrix3Xd matrix_of(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) result.col(static_cast<Eigen::Index>(i)) = points[i];
  return result;
}

}  // namespace

std::optional<SurfaceErrors> surface_errors(const Footage& footage, const FootageSequence& sequence,
                                            const Motion& motion, const fs::path& vertices) {
  const fs::path path = footage.capture().resolve("ground_truth/" + sequence.name + "/vertices.npy");
  if (!fs::exists(path)) return std::nullopt;
  const Character& character = footage.character();
  const SurfaceFile ground_truth(path, character.num_vertices(), sequence.last_frame + 1);
  std::optional<SurfaceFile> found;
  if (!vertices.empty()) found.emplace(vertices, character.num_vertices(), sequence.num_frames());
  const PoseModel model(character, footage.landmarks(), {});
  SurfaceErrors errors;
  for (long frame = sequence.first_frame; frame <= sequence.last_frame; ++frame) {
    const PosedBody body = model.pose(motion.frames[frame], false);
    errors.skinned.push_back(distance_mm(matrix_of(posed_vertices(model, body)), ground_truth.at(frame)));
    if (found)
      errors.tracked.push_back(
          distance_mm(found->at(frame - sequence.first_frame).cast<double>(), ground_truth.at(frame)));
  }
  return errors;
}

}  // namespace doppel
