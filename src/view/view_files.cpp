#include "doppel/view/view_files.h"

#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "doppel/detect/keypoints/limbs.h"
#include "doppel/view/reach_dofs.h"
#include "doppel/view/view_mesh.h"

namespace doppel {
namespace {

nlohmann::json dof_entries(const Skeleton& skeleton) {
  nlohmann::json entries = nlohmann::json::array();
  for (const Dof& dof : skeleton.dofs) {
    nlohmann::json entry{{"name", dof.name}};
    if (dof.limits) entry["limits"] = {(*dof.limits)[0], (*dof.limits)[1]};
    entries.push_back(std::move(entry));
  }
  return entries;
}

nlohmann::json joint_entries(const Skeleton& skeleton) {
  nlohmann::json entries = nlohmann::json::array();
  for (int j = 0; j < skeleton.num_joints(); ++j) {
    const Joint& joint = skeleton.joints[static_cast<std::size_t>(j)];
    nlohmann::json moved_by = nlohmann::json::array();
    for (const ReachDof& found : reach_dofs(skeleton, j))
      moved_by.push_back({{"dof", found.dof}, {"radians", found.radians}});
    entries.push_back({{"name", joint.name}, {"parent", joint.parent}, {"moved_by", moved_by}});
  }
  return entries;
}

nlohmann::json description(const ViewSubject& subject, const Motion& motion) {
  nlohmann::json stages = nlohmann::json::array();
  for (const ViewStage& stage : subject.stages)
    stages.push_back({{"name", stage.name},
                      {"past_frames", stage.past_frames},
                      {"texture_size", stage.texture_size},
                      {"gaussians", stage.num_gaussians},
                      {"geometry", stage.geometry.empty() ? stage.name : stage.geometry}});
  const bool own = motion.frames == subject.motion.frames;
  return {{"name", subject.character.name},
          {"vertices", subject.character.num_vertices()},
          {"frames", motion.num_frames()},
          {"frames_per_second", subject.frames_per_second},
          {"textured", !subject.character.mesh.texture.empty()},
          {"cuts", own ? subject.cuts : std::vector<long>()},
          {"cameras", own && subject.cameras},
          {"training", !subject.run.empty()},
          {"rest", subject.character.rest_dofs},
          {"dofs", dof_entries(subject.character.skeleton)},
          {"joints", joint_entries(subject.character.skeleton)},
          {"stages", stages}};
}

/// A description without an actor, which says what a sequence has.
nlohmann::json with_sequence(nlohmann::json description, const ViewSequence& sequence) {
  description["name"] = sequence.name;
  description["frames"] = sequence.frames;
  description["points"] = sequence.points.points;
  description["sticks"] = sticks_between(sequence.points.points);
  return description;
}

std::string point_bytes(const PointMotion& motion) {
  const Eigen::Vector3d nowhere = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::string bytes;
  for (const PointMotion::Frame& frame : motion.frames)
    for (const auto& point : frame) {
      const Eigen::Vector3f position = point.value_or(nowhere).cast<float>();
      bytes.append(reinterpret_cast<const char*>(position.data()), 3 * sizeof(float));
    }
  return bytes;
}

std::string motion_bytes(const Motion& motion) {
  std::string bytes;
  for (const std::vector<double>& frame : motion.frames) {
    const std::vector<float> row(frame.begin(), frame.end());
    bytes.append(reinterpret_cast<const char*>(row.data()), row.size() * sizeof(float));
  }
  return bytes;
}

std::string jpeg(const cv::Mat& image) {
  std::vector<std::uint8_t> bytes;
  if (!image.empty()) cv::imencode(".jpg", image, bytes);
  return {bytes.begin(), bytes.end()};
}

}  // namespace

ViewFiles view_files(const ViewSubject& subject, const Motion& motion, int number) {
  nlohmann::json about = description(subject, motion);
  about["motion"] = number;
  if (subject.sequence) about = with_sequence(std::move(about), *subject.sequence);
  // Names of other files may be in any encoding.
  return {about.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace),
          view_mesh_bytes(split_at_seams(subject.character.mesh)), motion_bytes(motion),
          jpeg(subject.character.mesh.texture), subject.sequence ? point_bytes(subject.sequence->points) : ""};
}

}  // namespace doppel
