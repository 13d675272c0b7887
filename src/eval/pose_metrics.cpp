#include "doppel/eval/pose_metrics.h"

#include <torch/utils.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cctype>

#include "doppel/core/error.h"
#include "doppel/geometry/decompositions.h"

namespace doppel {

using torch::Tensor;

namespace {

constexpr double kPckMillimetres = 150.0, kAucStep = 5.0;
constexpr double kRounding = 1e-6;  ///< millimetres, because the first threshold of the AUC is 0
constexpr int kRoot = -1;
constexpr int kCommonJoints = 14;

struct CommonJoint {
  const char* name;
  const char* part;  ///< part of the landmark's name
  char side;         ///< 'l', 'r' or ' '
  int parent;        ///< index of the joint its bone starts at, or kRoot
};
constexpr std::array<CommonJoint, kCommonJoints> kJoints{{{"head", "head", ' ', 1},
                                                          {"neck", "neck", ' ', kRoot},
                                                          {"right_shoulder", "shoulder", 'r', 1},
                                                          {"right_elbow", "elbow", 'r', 2},
                                                          {"right_wrist", "wrist", 'r', 3},
                                                          {"left_shoulder", "shoulder", 'l', 1},
                                                          {"left_elbow", "elbow", 'l', 5},
                                                          {"left_wrist", "wrist", 'l', 6},
                                                          {"right_hip", "hip", 'r', kRoot},
                                                          {"right_knee", "knee", 'r', 8},
                                                          {"right_ankle", "ankle", 'r', 9},
                                                          {"left_hip", "hip", 'l', kRoot},
                                                          {"left_knee", "knee", 'l', 11},
                                                          {"left_ankle", "ankle", 'l', 12}}};
constexpr int kRightHip = 8, kLeftHip = 11;

/// Letters only, in lower case, with a leading "left" or "right" shortened to its first letter.
std::string plain_name(const std::string& name) {
  std::string plain;
  for (unsigned char letter : name)
    if (std::isalpha(letter)) plain += static_cast<char>(std::tolower(letter));
  for (const std::string side : {"left", "right"})
    if (plain.rfind(side, 0) == 0) plain.erase(1, side.size() - 1);
  return plain;
}

/// The row of the landmark that is this joint, or -1.
std::int64_t row_of(const CommonJoint& joint, const std::vector<std::string>& plain_names) {
  const std::string wanted = (joint.side == ' ' ? "" : std::string(1, joint.side)) + joint.part;
  std::vector<std::string> accepted{wanted};
  if (wanted == "head") accepted = {"head", "headtop", "nose"};
  for (const std::string& word : accepted) {
    const auto found = std::find(plain_names.begin(), plain_names.end(), word);
    if (found != plain_names.end()) return found - plain_names.begin();
  }
  return -1;
}

Tensor checked(const char* name, const Tensor& joints) {
  if (!joints.defined() || !joints.is_floating_point() || joints.dim() != 3 || joints.size(0) == 0 ||
      joints.size(1) != kCommonJoints || joints.size(2) != 3)
    fail<UsageError>("pose metrics: {} must be a floating-point tensor [frames,14,3] with at least one frame", name);
  return joints.to(torch::kFloat64).contiguous();
}

using Points = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>;
using PointsOut = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>;

/// Umeyama's closed form for one frame. If all points coincide, they are moved to the mean of the others.
void align_frame(const Points& from, const Points& to, PointsOut out) {
  const Eigen::RowVector3d from_mean = from.colwise().mean(), to_mean = to.colwise().mean();
  const Eigen::MatrixX3d centred = from.rowwise() - from_mean;
  const Eigen::Matrix3d covariance = centred.transpose() * (to.rowwise() - to_mean);
  const auto [U, values, V] = svd(covariance);
  Eigen::Vector3d sign(1.0, 1.0, 1.0);
  if ((U * V).determinant() < 0.0) sign.z() = -1.0;  // a rotation, not a reflection
  const Eigen::Matrix3d rotation = U * sign.asDiagonal() * V.transpose();
  const double spread = centred.squaredNorm();
  const double scale = spread > 0.0 ? values.dot(sign) / spread : 0.0;
  out = ((scale * centred * rotation).rowwise() + to_mean).eval();
}

}  // namespace

bool has_common_joints(const std::vector<std::string>& landmark_names) {
  std::vector<std::string> plain;
  for (const std::string& name : landmark_names) plain.push_back(plain_name(name));
  return std::all_of(kJoints.begin(), kJoints.end(),
                     [&](const CommonJoint& joint) { return row_of(joint, plain) >= 0; });
}

std::vector<std::int64_t> common_joint_rows(const std::vector<std::string>& landmark_names) {
  std::vector<std::string> plain, missing;
  for (const std::string& name : landmark_names) plain.push_back(plain_name(name));
  std::vector<std::int64_t> rows;
  for (const CommonJoint& joint : kJoints) {
    rows.push_back(row_of(joint, plain));
    if (rows.back() < 0) missing.emplace_back(joint.name);
  }
  if (!missing.empty())
    fail<UsageError>("poses cannot be compared: no landmark has the name {} (there are {})", fmt::join(missing, ", "),
                     fmt::join(landmark_names, ", "));
  return rows;
}

Tensor root_of_joints(const Tensor& joints) {
  return 0.5 * (joints.narrow(1, kRightHip, 1) + joints.narrow(1, kLeftHip, 1));
}

Tensor rescale_bones(const Tensor& found_in, const Tensor& ground_truth_in) {
  const Tensor found = checked("found", found_in), ground_truth = checked("ground truth", ground_truth_in);
  const Tensor found_root = root_of_joints(found).squeeze(1), true_root = root_of_joints(ground_truth).squeeze(1);
  std::vector<Tensor> joints(kCommonJoints);
  // Bones start at joints with known positions. The neck is the parent of the head but comes after it, so it is
  // computed first.
  for (int j : {1, 0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13}) {
    const int parent = kJoints[j].parent;
    const Tensor bone = found.select(1, j) - (parent == kRoot ? found_root : found.select(1, parent));
    const Tensor true_bone = ground_truth.select(1, j) - (parent == kRoot ? true_root : ground_truth.select(1, parent));
    const Tensor length = bone.norm(2, {1}, true);
    const Tensor factor = torch::where(length > 0.0, true_bone.norm(2, {1}, true) / length, torch::ones_like(length));
    joints[j] = (parent == kRoot ? found_root : joints[parent]) + factor * bone;
  }
  return torch::stack(joints, 1);
}

Tensor align_similarity(const Tensor& found_in, const Tensor& ground_truth_in) {
  if (found_in.sizes() != ground_truth_in.sizes() || found_in.dim() != 3 || found_in.size(2) != 3)
    fail<UsageError>("similarity alignment: both poses must be [frames,J,3]");
  const Tensor found = found_in.to(torch::kFloat64).contiguous(),
               ground_truth = ground_truth_in.to(torch::kFloat64).contiguous();
  Tensor aligned = torch::empty_like(found);
  const std::int64_t J = found.size(1);
  for (std::int64_t f = 0; f < found.size(0) && J > 0; ++f)
    align_frame(Points(found.data_ptr<double>() + 3 * J * f, J, 3),
                Points(ground_truth.data_ptr<double>() + 3 * J * f, J, 3),
                PointsOut(aligned.data_ptr<double>() + 3 * J * f, J, 3));
  return aligned;
}

PoseScores compare_poses(const Tensor& found_in, const Tensor& ground_truth_in) {
  const torch::NoGradGuard no_grad;
  Tensor found = checked("found", found_in), ground_truth = checked("ground truth", ground_truth_in);
  if (found.size(0) != ground_truth.size(0))
    fail<UsageError>("pose metrics: {} frames found, {} true ones", found.size(0), ground_truth.size(0));
  if (!ground_truth.isfinite().all().item<bool>())
    fail<UsageError>("pose metrics: the ground truth contains numbers that are not finite");
  PoseScores scores;
  scores.frames = found.size(0);
  const Tensor rows = found.isfinite().flatten(1).all(1).nonzero().flatten();
  scores.missing = scores.frames - rows.size(0);
  if (rows.size(0) == 0) return scores;
  found = found.index_select(0, rows);
  ground_truth = ground_truth.index_select(0, rows);

  constexpr double kMillimetres = 1000.0;
  scores.GLE_mm =
      kMillimetres * (root_of_joints(found) - root_of_joints(ground_truth)).norm(2, {-1}).mean().item<double>();
  const Tensor rescaled = rescale_bones(found, ground_truth);
  const Tensor error =
      kMillimetres *
      ((rescaled - root_of_joints(rescaled)) - (ground_truth - root_of_joints(ground_truth))).norm(2, {-1});
  const double all = static_cast<double>(scores.frames * kCommonJoints);
  const auto share = [&](double threshold) {
    return 100.0 * static_cast<double>((error <= threshold + kRounding).sum().item<std::int64_t>()) / all;
  };
  scores.PCK = share(kPckMillimetres);
  const int steps = static_cast<int>(kPckMillimetres / kAucStep);
  for (int step = 0; step <= steps; ++step) scores.AUC += share(kAucStep * step) / (steps + 1);
  scores.MPJPE_mm =
      kMillimetres * (align_similarity(rescaled, ground_truth) - ground_truth).norm(2, {-1}).mean().item<double>();
  return scores;
}

nlohmann::ordered_json PoseScores::to_json() const {
  nlohmann::ordered_json json;
  json["frames"] = frames;
  json["missing"] = missing;
  if (missing < frames) {
    json["GLE_mm"] = GLE_mm;
    json["MPJPE_mm"] = MPJPE_mm;
  }
  json["3DPCK"] = PCK;
  json["AUC"] = AUC;
  return json;
}

}  // namespace doppel
