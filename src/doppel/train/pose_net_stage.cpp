#include "doppel/train/pose_net_stage.h"

#include "doppel/losses/limits.h"
#include "doppel/render/face_tensor.h"

namespace doppel {

namespace {

std::vector<std::string> names_of(const std::vector<Marker>& landmarks) {
  std::vector<std::string> names;
  for (const Marker& landmark : landmarks) names.push_back(landmark.name);
  return names;
}

/// The dataset's landmarks, or an error that says how to come by them.
const std::vector<Marker>& landmarks_of(const Dataset& dataset) {
  dataset.require_landmarks();
  return dataset.landmarks();
}

}  // namespace

DetectionOptions DetectionOptions::read(const ConfigReader& loss) {
  DetectionOptions o;
  o.alignment.confidence_threshold =
      loss.get("confidence_threshold", o.alignment.confidence_threshold, between(0.0, 1.0));
  o.alignment.binary = loss.get("binary_alignment", o.alignment.binary);
  o.loss.confidence_threshold = o.alignment.confidence_threshold;
  return o;
}

PoseNetRunConfig PoseNetRunConfig::read(const ConfigDocument& document) {
  const ConfigReader root = document.root();
  PoseNetRunConfig c;
  c.subject = RunSubject::read(document, root, "posenet");
  c.loader = read_loader_options(root.section("data"), 90, 0, c.subject.seed);
  const ConfigReader model = root.section("model");
  c.dofs = model.list<std::string>("dofs");
  c.model = BackboneConfig::read(model);
  c.detections = DetectionOptions::read(root.section("loss"));
  c.phases = PosePhases::read(root);
  c.trainer = TrainerOptions::read_phased(root.section("train"), c.subject.seed, c.phases.schedule(),
                                          "the stage posenet takes this from its `phases`");
  root.finish();
  c.loader = with_people(c.loader, c.model.input_size);
  return c;
}

LoaderOptions with_people(LoaderOptions options, int person_size) {
  options.window = 0;
  options.keypoints = true;
  options.person_size = person_size;
  return options;
}

Batch person_batch(const Dataset& dataset, const std::vector<SampleId>& samples, const std::vector<int>& cameras,
                   int person_size) {
  BatchOptions options;
  options.window = 0;
  options.keypoints = true;
  options.person_size = person_size;
  return make_batch(dataset, samples, std::vector<std::vector<int>>(samples.size(), cameras), options);
}

Batch person_batch(const Dataset& dataset, const SampleId& sample, const LoaderOptions& loader) {
  return person_batch(dataset, {sample}, dataset.camera_indices(loader.cameras), loader.person_size);
}

PersonView person_view(const Batch& batch) {
  const torch::Tensor row = torch::arange(batch.person_camera.size(0));
  return {batch.person.select(1, 0), batch.camera_rotation.index({row, batch.person_camera}),
          keypoint_rays(batch.keypoints, batch.camera_projection, batch.camera_position), torch::Tensor()};
}

KeypointTarget keypoint_target(const Batch& batch, const torch::Tensor& counts) {
  const torch::Tensor seen = batch.keypoints * counts.to(batch.keypoints.scalar_type()).view({-1, 1, 1, 1});
  return {seen, batch.camera_projection, batch.keypoint_scale};
}

PoseNetStage::PoseNetStage(const Dataset& dataset, const Character& character, const PoseNetRunConfig& config)
    : CaptureStage(dataset, character, config.loader),
      config_(config),
      pose_(character.skeleton, config.dofs, character.rest_dofs),
      landmarks_(character.skeleton, landmarks_of(dataset)),
      landmark_names_(names_of(dataset.landmarks())),
      network_(pose_, config.model, at::detail::createCPUGenerator(static_cast<std::uint64_t>(config.subject.seed))),
      surface_(character),
      faces_(face_tensor(character.mesh)) {
  network_->backbone()->load_pretrained();
}

CapturedPose PoseNetStage::capture(const Batch& batch) {
  return capture_pose(network_, pose_, landmarks_, person_view(batch), config_.detections.alignment);
}

LossTerms PoseNetStage::loss(const Batch& batch, StepContext& context) {
  CapturedPose captured;
  {
    ProfileScope scope(*context.profile, "network");
    captured = capture(batch);
  }
  ProfileScope scope(*context.profile, "keypoints");
  const PosePhases::Place place = config_.phases.at(context.step);
  const KeypointTarget target = keypoint_target(batch, captured.valid & batch.person_valid);
  return {{"keypoints",
           keypoint_loss(captured.landmarks, target, landmark_weights(landmark_names_, place.progress),
                         config_.detections.loss),
           place.phase->keypoints},
          {"limits", limits_loss(captured.theta, pose_.lower(), pose_.upper()),
           place.phase->limits_weight(place.progress)}};
}

std::vector<Picture> PoseNetStage::pictures() {
  const std::string legend = "the capture's own motion blue (where it has one), PoseNet red";
  return outline_pictures(faces_, legend, [this](const SampleId& sample) {
    const Batch batch = person_batch(dataset(), sample, loader_options());
    const CapturedPose captured = capture(batch);
    const torch::Tensor dofs = pose_.dofs(captured.theta, captured.rotation, captured.position);
    const torch::Tensor found = surface_->skinned(dofs)[0];
    if (!batch.dofs.defined()) return std::make_pair(found, found);
    return std::make_pair(surface_->skinned(batch.dofs.select(1, -1).contiguous())[0], found);
  });
}

}  // namespace doppel
