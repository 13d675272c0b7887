#include "doppel/actor/export/correctives/helper_joints.h"

#include <algorithm>
#include <numeric>

#include "doppel/actor/export/correctives/convex_weights.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/geometry/best_rotation.h"
#include "doppel/geometry/decompositions.h"

namespace doppel {
namespace {

constexpr int kRegroupings = 4;          ///< of the vertices of the first helpers
constexpr std::size_t kMinGroup = 8;     ///< vertices of a first helper
constexpr double kWeightDamping = 1e-7;  ///< square metres a frame, of the sum of squared weights
constexpr double kRestDamping = 1e-3;    ///< a frame, of the distance from the first rest vertices
constexpr double kIdleReach = 0.5;       ///< vertices; a helper with fewer begins anew elsewhere

using Joints = std::vector<int>;

Eigen::Index index_of(int number) { return static_cast<Eigen::Index>(number); }

/// Sorts weights, largest first, which takes the rounding.
void set_weights(const Joints& joints, const Eigen::VectorXd& weights, std::array<int, 4>& joint,
                 std::array<float, 4>& weight) {
  std::vector<std::pair<double, int>> sorted;
  for (std::size_t i = 0; i < joints.size(); ++i)
    if (const double w = weights(static_cast<Eigen::Index>(i)); w > 0.0) sorted.emplace_back(w, joints[i]);
  std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  joint.fill(0);
  weight.fill(0.0F);
  float rest = 1.0F;
  for (std::size_t i = sorted.size(); i-- > 0;) {
    joint[i] = sorted[i].second;
    weight[i] = i == 0 ? rest : static_cast<float>(sorted[i].first);
    rest -= weight[i];
  }
}

class HelperSearch {
 public:
  HelperSearch(const SkinnedFrames& frames, const LinearSkin& skin, const HelperOptions& options)
      : frames_(frames),
        start_(skin),
        options_(options),
        num_frames_(static_cast<int>(frames.bones.size())),
        columns_(frames.vertices.rows(),
                 4 * (static_cast<Eigen::Index>(frames.bones.front().size()) + options.helpers)) {
    found_.skin = skin;
    found_.bones = static_cast<int>(frames.bones.front().size());
    found_.parents.assign(as_size(options.helpers), 0);
    found_.mean.assign(as_size(options.helpers), Eigen::Affine3d::Identity());
    helpers_.assign(frames.bones.size(), found_.mean);
    columns_.setZero();
    products_ = Eigen::MatrixXd::Zero(columns_.cols(), columns_.cols());
    moments_ = Eigen::MatrixXd::Zero(columns_.cols(), frames.vertices.cols());
    squares_ = frames.vertices.colwise().squaredNorm();
    find_neighbours();
  }

  HelperSkin found() {
    Progress progress("placing helper joints", options_.rounds);
    update(0, found_.bones);
    find_rest();
    find_groups();
    find_weights();
    find_rest();
    for (int round = 0; round < options_.rounds; ++round) {
      if (stop_requested()) fail("finding helper joints: stopped in round {} of {}", round + 1, options_.rounds);
      if (2 * round < options_.rounds) renew_idle();
      find_means();
      find_transforms();
      find_weights();
      find_rest();
      progress.advance(1);
    }
    find_means();
    return std::move(found_);
  }

 private:
  std::size_t num_vertices() const { return start_.rest.size(); }
  int dominant(std::size_t v) const { return start_.joint[v][0]; }

  /// The bones that share vertices.
  void find_neighbours() {
    near_ = Eigen::MatrixXi::Identity(found_.bones, found_.bones);
    for (std::size_t v = 0; v < num_vertices(); ++v)
      for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t k = 0; k < 4; ++k)
          if (start_.weight[v][i] > 0.0F && start_.weight[v][k] > 0.0F)
            near_(start_.joint[v][i], start_.joint[v][k]) = 1;
  }

  // ---- what the frames say about vertices, summed: sum_t M_j^T M_k, sum_t M_j^T vertex, of M as [3, 4] ----

  void update(int first, int count) {
    for (int t = 0; t < num_frames_; ++t)
      for (int j = first; j < first + count; ++j)
        columns_.block<3, 4>(3 * index_of(t), 4 * index_of(j)) =
            (j < found_.bones ? frames_.bones[as_size(t)][as_size(j)] : helpers_[as_size(t)][as_size(j - found_.bones)])
                .matrix()
                .topRows<3>();
    const Eigen::Index at = 4 * index_of(first), size = 4 * index_of(count);
    const auto changed = columns_.middleCols(at, size);
    products_.middleCols(at, size).noalias() = columns_.transpose() * changed;
    products_.middleRows(at, size) = products_.middleCols(at, size).transpose().eval();
    moments_.middleRows(at, size).noalias() = changed.transpose() * frames_.vertices;
  }
  void update_helpers() { update(found_.bones, options_.helpers); }

  Eigen::Block<const Eigen::MatrixXd, 4, 4> product(int j, int k) const {
    return products_.block<4, 4>(4 * index_of(j), 4 * index_of(k));
  }
  Eigen::Block<const Eigen::MatrixXd, 4, 1> moment(int j, std::size_t v) const {
    return moments_.block<4, 1>(4 * index_of(j), static_cast<Eigen::Index>(v));
  }

  /// Sums over the frames of the inner products of what single joints leave of a vertex.
  Eigen::MatrixXd left_products(std::size_t v, const Joints& joints) const {
    const Eigen::Vector4d rest = found_.skin.rest[v].homogeneous();
    const auto n = static_cast<Eigen::Index>(joints.size());
    Eigen::VectorXd inner(n);
    for (Eigen::Index a = 0; a < n; ++a) inner(a) = rest.dot(moment(joints[as_size(a)], v));
    Eigen::MatrixXd products(n, n);
    for (Eigen::Index a = 0; a < n; ++a) {
      for (Eigen::Index b = 0; b <= a; ++b)
        products(a, b) = products(b, a) = rest.dot(product(joints[as_size(a)], joints[as_size(b)]) * rest) - inner(a) -
                                          inner(b) + squares_(static_cast<Eigen::Index>(v));
      products(a, a) += kWeightDamping * num_frames_;
    }
    return products;
  }

  Joints joints_of(std::size_t v) const {
    Joints joints;
    for (std::size_t i = 0; i < 4; ++i)
      if (found_.skin.weight[v][i] > 0.0F) joints.push_back(found_.skin.joint[v][i]);
    return joints;
  }

  /// What the skin leaves of a vertex: the sum of its squared distances.
  double error_of(std::size_t v) const {
    const Joints joints = joints_of(v);
    Eigen::VectorXd weights(static_cast<Eigen::Index>(joints.size()));
    for (std::size_t i = 0; i < joints.size(); ++i)
      weights(static_cast<Eigen::Index>(i)) = static_cast<double>(found_.skin.weight[v][i]);
    return weights.dot(left_products(v, joints) * weights);
  }
  std::vector<double> errors() const {
    std::vector<double> all(num_vertices());
    for (std::size_t v = 0; v < all.size(); ++v) all[v] = error_of(v);
    return all;
  }

  // ---- the first helpers ----

  bool may_use(std::size_t v, int helper) const { return near_(dominant(v), found_.parents[as_size(helper)]) > 0; }

  /// The vertices nearest to one of them that have its dominant bone.
  std::vector<std::size_t> group_around(std::size_t seed) const {
    std::vector<std::pair<double, std::size_t>> sorted;
    for (std::size_t v = 0; v < num_vertices(); ++v)
      if (dominant(v) == dominant(seed))
        sorted.emplace_back((found_.skin.rest[v] - found_.skin.rest[seed]).squaredNorm(), v);
    std::sort(sorted.begin(), sorted.end());
    sorted.resize(std::min(sorted.size(), std::max(kMinGroup, num_vertices() / (2 * as_size(options_.helpers)))));
    std::vector<std::size_t> group;
    group.reserve(sorted.size());
    for (const auto& [distance, v] : sorted) group.push_back(v);
    return group;
  }

  /// Moves a helper in each frame as a group of vertices moves.
  void follow(int helper, const std::vector<std::size_t>& group) {
    const double count = static_cast<double>(group.size());
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (const std::size_t v : group) centre += found_.skin.rest[v] / count;
    for (int t = 0; t < num_frames_; ++t) {
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
      for (const std::size_t v : group) {
        const Eigen::Vector3d vertex = frames_.vertices.block<3, 1>(3 * index_of(t), static_cast<Eigen::Index>(v));
        mean += vertex / count;
        moment += vertex * (found_.skin.rest[v] - centre).transpose();
      }
      Eigen::Affine3d& moved = helpers_[as_size(t)][as_size(helper)];
      moved = Eigen::Affine3d::Identity();
      moved.linear() = nearest_rotation(moment);
      moved.translation() = mean - moved.linear() * centre;
    }
  }

  /// Makes a helper where errors are largest, and lowers them.
  void begin(int helper, std::vector<double>& errors) {
    const auto seed = as_size(std::max_element(errors.begin(), errors.end()) - errors.begin());
    found_.parents[as_size(helper)] = dominant(seed);
    const std::vector<std::size_t> group = group_around(seed);
    follow(helper, group);
    update(found_.bones + helper, 1);
    for (std::size_t v = 0; v < errors.size(); ++v)
      if (may_use(v, helper)) errors[v] = std::min(errors[v], left_products(v, {found_.bones + helper})(0, 0));
    for (const std::size_t v : group) errors[v] *= 0.5;  // so that the next is not the same
  }

  void find_groups() {
    const std::vector<double> by_bones = errors();
    std::vector<double> least = by_bones;
    for (int h = 0; h < options_.helpers; ++h) begin(h, least);
    for (int i = 0; i < kRegroupings; ++i) {
      std::vector<std::vector<std::size_t>> groups(as_size(options_.helpers));
      for (std::size_t v = 0; v < num_vertices(); ++v) {
        double error = by_bones[v];
        int nearest = -1;
        for (int h = 0; h < options_.helpers; ++h) {
          if (!may_use(v, h)) continue;
          const double here = left_products(v, {found_.bones + h})(0, 0);
          if (here >= error) continue;
          error = here;
          nearest = h;
        }
        if (nearest >= 0) groups[as_size(nearest)].push_back(v);
      }
      for (int h = 0; h < options_.helpers; ++h)
        if (groups[as_size(h)].size() >= kMinGroup) follow(h, groups[as_size(h)]);
      update_helpers();
    }
  }

  /// Helpers that no vertex uses begin anew where errors are largest.
  void renew_idle() {
    const HelperPoser poser(found_);
    std::vector<double> left;
    for (int h = 0; h < options_.helpers; ++h) {
      if (poser.reach(as_size(h)) >= kIdleReach) continue;
      if (left.empty()) left = errors();
      begin(h, left);
    }
  }

  // ---- the rounds ----

  void find_means() {
    const HelperPoser poser(found_);
    for (std::size_t h = 0; h < found_.parents.size(); ++h) {
      Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
      Eigen::Vector3d centre = Eigen::Vector3d::Zero();
      for (std::size_t t = 0; t < helpers_.size(); ++t) {
        const Eigen::Affine3d relative = frames_.bones[t][as_size(found_.parents[h])].inverse() * helpers_[t][h];
        turns += relative.linear();
        centre += relative * poser.centre(h) / num_frames_;
      }
      found_.mean[h].linear() = nearest_rotation(turns);
      found_.mean[h].translation() = centre - found_.mean[h].linear() * poser.centre(h);
    }
  }

  void find_transforms() {
    const HelperPoser poser(found_);
    for (std::size_t t = 0; t < helpers_.size(); ++t)
      poser.improve(frames_.bones[t], frames_.vertices.middleRows<3>(3 * static_cast<Eigen::Index>(t)), helpers_[t]);
    update_helpers();
  }

  void find_weights() {
    for (std::size_t v = 0; v < num_vertices(); ++v) {
      Joints joints;
      for (std::size_t i = 0; i < 4; ++i)
        if (start_.weight[v][i] > 0.0F) joints.push_back(start_.joint[v][i]);
      for (int h = 0; h < options_.helpers; ++h)
        if (may_use(v, h)) joints.push_back(found_.bones + h);
      const Eigen::MatrixXd products = left_products(v, joints);
      const Eigen::VectorXd weights = sparse_convex_weights(products, 4);
      if (weights.dot(products * weights) < error_of(v))
        set_weights(joints, weights, found_.skin.joint[v], found_.skin.weight[v]);
    }
  }

  void find_rest() {
    for (std::size_t v = 0; v < num_vertices(); ++v) {
      const double damping = kRestDamping * num_frames_;
      Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
      Eigen::Vector4d right = Eigen::Vector4d::Zero();
      for (std::size_t i = 0; i < 4; ++i) {
        const double weight = static_cast<double>(found_.skin.weight[v][i]);
        if (weight <= 0.0) continue;
        right += weight * moment(found_.skin.joint[v][i], v);
        for (std::size_t k = 0; k < 4; ++k)
          normal += weight * static_cast<double>(found_.skin.weight[v][k]) *
                    product(found_.skin.joint[v][i], found_.skin.joint[v][k]);
      }
      const Eigen::Matrix3d damped = normal.topLeftCorner<3, 3>() + damping * Eigen::Matrix3d::Identity();
      const Eigen::Vector3d wanted = right.head<3>() - normal.topRightCorner<3, 1>() + damping * start_.rest[v];
      found_.skin.rest[v] = solve_symmetric(damped, wanted);
    }
  }

  const SkinnedFrames& frames_;
  const LinearSkin& start_;
  HelperOptions options_;
  int num_frames_;
  HelperSkin found_;
  std::vector<std::vector<Eigen::Affine3d>> helpers_;  // [F][N]
  Eigen::MatrixXi near_;                               // [B, B] 1: the bones share a vertex
  Eigen::MatrixXd columns_;                            // [3F, 4 (B + N)] the rows 0 to 2 of all M
  Eigen::MatrixXd products_, moments_;                 // of the columns with each other, and with the vertices
  Eigen::RowVectorXd squares_;                         // [V] of the vertices, summed over the frames
};

}  // namespace

HelperSkin find_helpers(const SkinnedFrames& frames, const LinearSkin& skin, const HelperOptions& options) {
  if (frames.bones.empty() || options.helpers < 1 || skin.rest.size() < as_size(options.helpers))
    fail(
        "finding {} helper joints for {} vertices in {} frames: there must be a frame, a helper, and a vertex for each",
        options.helpers, skin.rest.size(), frames.bones.size());
  return HelperSearch(frames, skin, options).found();
}

}  // namespace doppel
