#include "doppel/actor/export/pose_file.h"

#include <fmt/ranges.h>

#include "doppel/actor/export/pose_trace.h"
#include "doppel/core/error.h"

namespace doppel {

using torch::Tensor;

void write_pose_file(const std::filesystem::path& path, TrainedPose& trained) {
  TracedPose traced = traced_pose(trained);
  traced.file.save(path, trained.character, traced.metadata);
}

PoseFile PoseFile::load(const std::filesystem::path& path) {
  ScriptFile file = load_script_file(path, ScriptKind::pose);
  PoseFile pose;
  try {
    PoseFileDescription& d = pose.description_;
    d.name = file.metadata.at("name");
    d.input_size = metadata_integer(file.metadata.at("input_size"), path, "input_size", 1, kMaxScriptSide);
    d.deformed = file.metadata.at("deformed");
    d.confidence_threshold = file.metadata.at("confidence_threshold");
    d.dof_names = file.metadata.at("dof_names").get<std::vector<std::string>>();
    d.joint_names = file.metadata.at("joint_names").get<std::vector<std::string>>();
    d.landmark_names = file.metadata.at("landmark_names").get<std::vector<std::string>>();
    d.num_vertices = metadata_integer(file.metadata.at("num_vertices"), path, "num_vertices", 1, kMaxScriptVertices);
    d.fingerprint = file.metadata.at("fingerprint");
  } catch (const nlohmann::json::exception& e) {
    fail_metadata(path, ScriptKind::pose, e);
  }
  pose.file_ = std::move(file);
  return pose;
}

void PoseFile::check(const char* what, const Tensor& tensor, at::IntArrayRef shape) const {
  if (!tensor.defined() || !tensor.sizes().equals(shape))
    fail("capturing {}: the {} must be [{}], found {}", description_.name, what, fmt::join(shape, ", "),
         tensor.defined() ? fmt::format("[{}]", fmt::join(tensor.sizes(), ", ")) : "nothing");
}

CapturedPerson PoseFile::forward(const Tensor& image, const Tensor& rotation) const {
  const std::int64_t B = image.dim() == 4 ? image.size(0) : 1, S = description_.input_size;
  check("image", image, {B, 3, S, S});
  check("camera's rotation", rotation, {B, 3, 3});
  const torch::NoGradGuard no_grad;
  const auto result = file_.fastest().forward({image, rotation}).toTuple();
  const auto& e = result->elements();
  return {e[0].toTensor(), e[1].toTensor(), e[2].toTensor(), Tensor()};
}

CapturedPerson PoseFile::placed(const Tensor& image, const CameraTensors& camera, const Tensor& keypoints) const {
  const std::int64_t B = image.dim() == 4 ? image.size(0) : 1, S = description_.input_size;
  check("image", image, {B, 3, S, S});
  check("camera's intrinsics", camera.intrinsics, {B, 3, 3});
  check("camera's rotation", camera.rotation, {B, 3, 3});
  check("camera's translation", camera.translation, {B, 3});
  check("keypoints", keypoints, {B, static_cast<std::int64_t>(description_.landmark_names.size()), 3});
  const torch::NoGradGuard no_grad;
  const auto result =
      file_.fastest()
          .get_method("placed")({image, camera.intrinsics, camera.rotation, camera.translation, keypoints})
          .toTuple();
  const auto& e = result->elements();
  return {e[0].toTensor(), e[1].toTensor(), e[2].toTensor(), e[3].toTensor()};
}

}  // namespace doppel
