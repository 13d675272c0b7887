#include "doppel/actor/export/pose_trace.h"

#include "doppel/character/landmarks.h"
#include "doppel/data/dataset/person_crop.h"

namespace doppel {
namespace {

using torch::Tensor;
using torch::jit::Stack;

constexpr double kPoseTraceTolerance = 1e-5;  // metres and radians: the accuracy that a host can rely on

PoseFileDescription describe(const TrainedPose& trained) {
  PoseFileDescription d;
  d.name = trained.character.name;
  d.input_size = trained.input_size();
  d.deformed = !trained.defnet.is_empty();
  d.confidence_threshold = trained.detections.alignment.confidence_threshold;
  for (const Dof& dof : trained.character.skeleton.dofs) d.dof_names.push_back(dof.name);
  for (const Joint& joint : trained.character.skeleton.joints) d.joint_names.push_back(joint.name);
  d.landmark_names = landmark_names(trained.landmarks);
  d.num_vertices = trained.character.num_vertices();
  d.fingerprint = trained.character.fingerprint();
  return d;
}

nlohmann::ordered_json metadata(const PoseFileDescription& d) {
  return {
      {"name", d.name},
      {"forward", "forward(image, rotation) -> (dofs, landmarks, vertices), the root's pivot at the origin"},
      {"placed", "placed(image, intrinsics, rotation, translation, keypoints) -> (dofs, landmarks, vertices, valid)"},
      {"picture",
       "RGB [batch, 3, input_size, input_size], 0..1, the person on black, in a square window: the box of the "
       "keypoints with `margin` of its longer side added on every side"},
      {"camera", "OpenCV: intrinsics [batch, 3, 3], rotation [batch, 3, 3] and translation [batch, 3] from world"},
      {"keypoints", "[batch, landmarks, 3]: x, y in pixels of the whole image without distortion, confidence"},
      {"units", "metres; DoFs as in the motion file"},
      {"world", "right-handed, y up"},
      {"input_size", d.input_size},
      {"margin", kPersonMargin},
      {"window_confidence", kSeenConfidence},
      {"confidence_threshold", d.confidence_threshold},
      {"deformed", d.deformed},
      {"num_vertices", d.num_vertices},
      {"num_dofs", d.dof_names.size()},
      {"dof_names", d.dof_names},
      {"joint_names", d.joint_names},
      {"landmark_names", d.landmark_names},
      {"fingerprint", d.fingerprint}};
}

Tensor colours(const float (&values)[3]) { return torch::tensor({values[0], values[1], values[2]}).view({1, 3, 1, 1}); }

/// The functions of the file.
class PoseFunctions {
 public:
  explicit PoseFunctions(TrainedPose& trained)
      : trained_(trained), mean_(colours(kInputMean)), deviation_(colours(kInputDeviation)) {}

  /// @param inputs image, rotation
  Stack forward(const Stack& inputs) const {
    const Tensor image = input_of(inputs.at(0).toTensor());
    const Tensor rotation = inputs.at(1).toTensor();
    return results(image, trained_.capture({image, rotation, no_rays(rotation), Tensor()}));
  }

  /// @param inputs image, intrinsics, rotation, translation, keypoints
  Stack placed(const Stack& inputs) const {
    const Tensor image = input_of(inputs.at(0).toTensor()), rotation = inputs.at(2).toTensor(),
                 translation = inputs.at(3).toTensor().unsqueeze(-1);
    const Tensor projection = torch::matmul(inputs.at(1).toTensor(), torch::cat({rotation, translation}, -1));
    const Tensor centre = -torch::matmul(rotation.transpose(-2, -1), translation).squeeze(-1);
    const LandmarkRays rays =
        keypoint_rays(inputs.at(4).toTensor().unsqueeze(1), projection.unsqueeze(1), centre.unsqueeze(1));
    const CapturedPose captured = trained_.capture({image, rotation, rays, Tensor()});
    Stack all = results(image, captured);
    all.emplace_back(captured.valid);
    return all;
  }

 private:
  Tensor input_of(const Tensor& image) const { return (image - mean_) / deviation_; }

  /// Keypoints that do not count, which leaves people at the origin. They are made from a tensor of the batch, so that
  /// the trace does not fix the batch size.
  LandmarkRays no_rays(const Tensor& rotation) const {
    const Tensor none =
        torch::zeros_like(rotation.select(1, 0), rotation.options().dtype(torch::kFloat64)).unsqueeze(1);
    const Tensor rows = torch::zeros({1, trained_.landmark_layer->size(), 1}, torch::kFloat64);
    return {none, none.unsqueeze(2) + rows.unsqueeze(0), none.narrow(2, 0, 1) + rows.view({1, 1, -1})};
  }

  Stack results(const Tensor& image, const CapturedPose& captured) const {
    const Tensor dofs = trained_.dofs(captured);
    if (!trained_.defnet) return {dofs, captured.landmarks, trained_.surface->skinned(dofs)};
    const auto [A, T] = trained_.deformation(image);
    return {dofs, captured.landmarks, trained_.surface->deformed(dofs, A, T)};
  }

  TrainedPose& trained_;
  Tensor mean_, deviation_;
};

/// Inputs of `placed`: images of noise, cameras three metres away, and keypoints about the origin.
Stack random_inputs(const PoseFileDescription& d, int batch, std::uint64_t seed) {
  const at::Generator draw = at::detail::createCPUGenerator(seed);
  const auto landmarks = static_cast<std::int64_t>(d.landmark_names.size());
  const Tensor image = torch::rand({batch, 3, d.input_size, d.input_size}, draw);
  const Tensor intrinsics = torch::tensor({900.0f, 0.0f, 500.0f, 0.0f, 900.0f, 400.0f, 0.0f, 0.0f, 1.0f}).view({3, 3});
  const Tensor rotation = root_in_camera(torch::tensor({0.0f, 3.0f, 0.0f}) + 0.3 * torch::randn({batch, 3}, draw));
  const Tensor translation = torch::tensor({0.0f, 0.0f, 3.0f}) + 0.2 * torch::randn({batch, 3}, draw);
  const Tensor points = 0.5 * torch::randn({batch, landmarks, 3}, draw);
  const Tensor seen = torch::matmul(turn_points(rotation, points) + translation.unsqueeze(1), intrinsics.t());
  const Tensor confidence = 0.5 + 0.5 * torch::rand({batch, landmarks, 1}, draw);
  return {image, intrinsics.repeat({batch, 1, 1}), rotation, translation,
          torch::cat({seen.narrow(-1, 0, 2) / seen.narrow(-1, 2, 1), confidence}, -1)};
}

}  // namespace

TracedPose traced_pose(TrainedPose& trained) {
  const torch::NoGradGuard no_grad;
  const PoseFileDescription description = describe(trained);
  ScriptModules modules{{"posenet", trained.posenet.get()}, {"surface", trained.surface.get()}};
  if (trained.defnet) modules.emplace_back("defnet", trained.defnet.get());
  ScriptFileWriter file(ScriptKind::pose, modules);
  const PoseFunctions functions(trained);
  const Stack one = random_inputs(description, 1, 1), three = random_inputs(description, 3, 2);
  const std::vector<double> tolerances(4, kPoseTraceTolerance);
  const auto forward = [&](const Stack& inputs) { return functions.forward(inputs); };
  file.add("forward", {one[0], one[2]}, forward);
  file.check("forward", {three[0], three[2]}, forward, tolerances);
  const auto placed = [&](const Stack& inputs) { return functions.placed(inputs); };
  file.add("placed", one, placed);
  file.check("placed", three, placed, tolerances);
  return {std::move(file), description, metadata(description)};
}

Stack sample_of_placed(const PoseFileDescription& description, int batch) {
  return random_inputs(description, batch, 3);
}

}  // namespace doppel
