#include "doppel/rigging/joints/lone_triangles.h"

#include <algorithm>
#include <numeric>
#include <span>

#include "doppel/character/blend_skin.h"
#include "doppel/core/as_size.h"
#include "doppel/rigging/joints/same_positions.h"
#include "doppel/rigging/joints/sticking.h"
#include "doppel/rigging/weights/stretch.h"
#include "doppel/rigging/weights/test_poses.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

constexpr int kMaxRounds = 150;
constexpr float kApproach = 0.5F;  // share of the way to the mean in a round

/// The rows of integers that list for each number 0 .. count - 1 where it stands in `numbers`.
IndexRows inverse_of(const std::vector<int>& numbers, int count) {
  IndexRows rows;
  rows.offsets.assign(as_size(count) + 1, 0);
  for (const int n : numbers) ++rows.offsets[as_size(n) + 1];
  std::partial_sum(rows.offsets.begin(), rows.offsets.end(), rows.offsets.begin());
  rows.items.resize(numbers.size());
  std::vector<int> next(rows.offsets.begin(), rows.offsets.end() - 1);
  for (std::size_t i = 0; i < numbers.size(); ++i) rows.items[next[numbers[i]]++] = static_cast<int>(i);
  return rows;
}

/// The template in the test poses, for weights that change at few vertices.
class PosedTemplate {
 public:
  explicit PosedTemplate(const Character& character)
      : mesh_(character.mesh), neighbours_(face_neighbours(mesh_.faces)), position_(same_positions(mesh_.vertices)) {
    std::vector<int> corners;
    for (const Triangle& face : mesh_.faces) corners.insert(corners.end(), face.begin(), face.end());
    corners_at_ = inverse_of(corners, mesh_.num_vertices());
    vertices_at_ =
        inverse_of(position_, position_.empty() ? 0 : 1 + *std::max_element(position_.begin(), position_.end()));
    for (const TestPose& pose : test_poses(character.skeleton, character.rest_dofs)) {
      blends_.emplace_back(bone_motions(character, pose.dofs), character.skinning);
      posed_.push_back(mesh_.vertices);
      stretches_.emplace_back(mesh_.faces.size(), 1.0);
    }
  }

  void pose_all(const WeightField& field) {
    std::vector<int> all(mesh_.vertices.size());
    std::iota(all.begin(), all.end(), 0);
    pose(field, all);
  }

  /// The triangles that stretch alone in one of the poses, as count_stretched counts them.
  std::vector<int> lone_triangles() const {
    std::vector<int> lone;
    for (int f = 0; f < mesh_.num_faces(); ++f)
      if (std::any_of(stretches_.begin(), stretches_.end(), [&](const std::vector<double>& stretches) {
            return stretches_alone(stretches, neighbours_, f, kStretchLimit);
          }))
        lone.push_back(f);
    return lone;
  }

  /// Lets the corners of triangles approach their mean. Vertices at one position keep equal weights.
  void approach(const std::vector<int>& faces, WeightField& field) {
    std::vector<std::pair<int, int>> moved;  // position, face
    for (const int f : faces)
      for (const int v : mesh_.faces[f]) moved.emplace_back(position_[v], f);
    std::sort(moved.begin(), moved.end());
    const WeightField means = means_of(faces, field);
    std::vector<int> changed;
    for (auto first = moved.begin(); first != moved.end();) {
      const auto last =
          std::find_if(first, moved.end(), [&](const auto& entry) { return entry.first != first->first; });
      Eigen::RowVectorXf mean = Eigen::RowVectorXf::Zero(field.cols());
      for (auto entry = first; entry != last; ++entry)
        mean += means.row(std::lower_bound(faces.begin(), faces.end(), entry->second) - faces.begin());
      mean /= static_cast<float>(last - first);
      for (const int v : vertices_at_.row(first->first)) {
        field.row(v) += kApproach * (mean - field.row(v));
        changed.push_back(v);
      }
      first = last;
    }
    pose(field, changed);
  }

 private:
  /// The mean weights of triangles [faces.size(), Bn].
  WeightField means_of(const std::vector<int>& faces, const WeightField& field) const {
    WeightField means(static_cast<Eigen::Index>(faces.size()), field.cols());
    for (std::size_t i = 0; i < faces.size(); ++i) {
      const Triangle& face = mesh_.faces[faces[i]];
      means.row(static_cast<Eigen::Index>(i)) = (field.row(face[0]) + field.row(face[1]) + field.row(face[2])) / 3.0F;
    }
    return means;
  }

  void pose(const WeightField& field, const std::vector<int>& vertices) {
    std::vector<int> faces;
    for (const int v : vertices) {
      const SparseRow row = sparse_row(field, v);
      for (std::size_t i = 0; i < blends_.size(); ++i)
        posed_[i][v] = blends_[i].point(mesh_.vertices[v], row.bones, row.weights);
      for (const int corner : corners_at_.row(v)) faces.push_back(corner / 3);
    }
    std::sort(faces.begin(), faces.end());
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    std::vector<Triangle> triangles;
    for (const int f : faces) triangles.push_back(mesh_.faces[f]);
    for (std::size_t i = 0; i < blends_.size(); ++i) {
      const std::vector<double> stretches = triangle_stretches(triangles, mesh_.vertices, posed_[i]);
      for (std::size_t k = 0; k < faces.size(); ++k) stretches_[i][faces[k]] = stretches[k];
    }
  }

  const TriangleMesh& mesh_;
  IndexRows neighbours_;                        ///< [F]
  std::vector<int> position_;                   ///< [N]
  IndexRows vertices_at_;                       ///< [P] the vertices at each position
  IndexRows corners_at_;                        ///< [N] corners 3 f + k of the faces at each vertex
  std::vector<SkinBlend> blends_;               ///< one for each pose
  std::vector<std::vector<Vector3d>> posed_;    ///< [N] for each pose
  std::vector<std::vector<double>> stretches_;  ///< [F] for each pose
};

/// Vertices that stick to another limb, over all test poses.
int count_sticking(const Character& character) {
  const StickingVertices sticking(character);
  int count = 0;
  for (const TestPose& pose : test_poses(character.skeleton, character.rest_dofs)) {
    const SkinBlend blend(bone_motions(character, pose.dofs), character.skinning);
    count += static_cast<int>(sticking.find(blend, blend.vertices(character.mesh.vertices, character.skin)).size());
  }
  return count;
}

}  // namespace

void set_smooth_skin(Character& character, const WeightField& field) {
  const std::vector<std::string> bones = character.skin.bones;
  character.skin = sparse_weights(field, bones);
  PosedTemplate posed(character);
  posed.pose_all(field);
  std::vector<int> lone = posed.lone_triangles();
  const std::size_t lone_before = lone.size();
  if (lone_before == 0) return;
  WeightField smooth = field;
  for (int round = 0; round < kMaxRounds && !lone.empty(); ++round) {
    posed.approach(lone, smooth);
    lone = posed.lone_triangles();
  }
  const std::size_t faults_before = lone_before + as_size(count_sticking(character));
  const SkinningWeights before = character.skin;
  character.skin = sparse_weights(smooth, bones);
  if (lone.size() + as_size(count_sticking(character)) >= faults_before) character.skin = before;
}

}  // namespace doppel
