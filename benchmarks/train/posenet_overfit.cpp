/// Whether PoseNet can learn at all: eight frames of the synthetic actor seen by four cameras, ResNet-18 at 128 x 128,
/// keypoints alone.
/// Prints the error of the same frames every so often; done when MPJPE is below 10 mm, or after the given minutes.
///   posenet_overfit FOLDER [minutes] [threads]

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "doppel/data/prepare/prepare.h"
#include "doppel/eval/pose_metrics.h"
#include "doppel/synth/synth.h"
#include "doppel/train/pose_net_stage.h"

namespace {

namespace fs = std::filesystem;
using doppel::Dataset;
using torch::Tensor;

constexpr double kEnough = 10.0;  // mm

fs::path prepared_actor(const fs::path& folder) {
  doppel::synth::SynthOptions actor = doppel::synth::SynthOptions::preset("tiny");
  actor.frames = 8;
  actor.size = 384;
  actor.force = true;
  doppel::synth::write_synthetic_capture(folder / "capture", actor);
  doppel::PrepareOptions options;
  options.out = folder / "prepared";
  options.image_size = 192;
  options.mask_size = 96;
  options.overwrite = true;
  doppel::prepare_capture(doppel::read_capture(folder / "capture"), options);
  return options.out;
}

doppel::PoseNetRunConfig configuration(const fs::path& capture) {
  const std::string text =
      "capture: " + capture.string() +
      "\nstage: posenet\ndata: {batch_size: 8}\nmodel: {backbone: resnet18, input_size: 128}\n"
      "phases:\n  - {iterations: 400, learning_rate: 1e-3, limits: 100, limits_reduced_at: 1, limits_off_at: 1}\n"
      "  - {iterations: 300, learning_rate: 3e-4}\n  - {iterations: 200, learning_rate: 1e-4}\n"
      "  - {iterations: 100000, learning_rate: 3e-5}\n";
  doppel::PoseNetRunConfig config = doppel::PoseNetRunConfig::read(doppel::ConfigDocument::parse(text, "overfit.yaml"));
  config.loader.augment = false;  // one image of each frame
  return config;
}

/// Joints of the training frames, as PoseNet has them and as they are.
doppel::PoseScores score(const Dataset& dataset, doppel::PoseNetStage& stage, const doppel::LoaderOptions& options) {
  const torch::NoGradGuard no_grad;
  stage.model().eval();
  std::vector<std::string> names;
  for (const doppel::Marker& landmark : dataset.landmarks()) names.push_back(landmark.name);
  const Tensor rows = torch::tensor(doppel::common_joint_rows(names), torch::kInt64);
  doppel::Character character = doppel::load_character(dataset.character_path());
  const doppel::Landmarks landmarks(character.skeleton, dataset.landmarks());
  std::vector<Tensor> found, ground_truth;
  for (const doppel::SampleId& sample : dataset.samples(doppel::Split::train)) {
    const doppel::Batch batch = person_batch(dataset, sample, options);
    found.push_back(stage.capture(batch).landmarks.index_select(1, rows));
    ground_truth.push_back(landmarks->forward(batch.dofs.select(1, -1).contiguous()).index_select(1, rows));
  }
  stage.model().train();
  return doppel::compare_poses(torch::cat(found), torch::cat(ground_truth));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "posenet_overfit FOLDER [minutes] [threads]\n");
    return 2;
  }
  const double minutes = argc > 2 ? std::atof(argv[2]) : 5.0;
  at::set_num_threads(argc > 3 ? std::atoi(argv[3]) : 2);
  const fs::path prepared = prepared_actor(argv[1]);
  const doppel::PoseNetRunConfig config = configuration(prepared);
  const Dataset dataset = Dataset::open(prepared);
  const doppel::Character character = doppel::load_character(dataset.character_path());
  doppel::PoseNetStage stage(dataset, character, config);
  doppel::Adam adam(stage.model(), config.trainer.adam);
  doppel::Profile profile;
  doppel::StepContext context{0, at::detail::createCPUGenerator(1), &profile};
  stage.model().train();
  const auto start = std::chrono::steady_clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
  while (seconds() < 60.0 * minutes) {
    adam.zero_grad();
    Tensor total;
    for (const doppel::LossTerm& term : static_cast<doppel::Stage&>(stage).loss(context))
      total = total.defined() ? total + term.weight * term.value : term.weight * term.value;
    total.backward();
    adam.step(config.trainer.schedule.rate(context.step), adam.gradient_norm());
    if (++context.step % 50 != 0) continue;
    const doppel::PoseScores scores = score(dataset, stage, config.loader);
    const double processor = static_cast<double>(std::clock()) / CLOCKS_PER_SEC;  // of all threads
    std::printf("%5ld steps %6.1f s (processor %6.1f s)  loss %9.4f  MPJPE %6.1f mm  GLE %6.1f mm  3DPCK %5.1f %%\n",
                static_cast<long>(context.step), seconds(), processor, total.item<double>(), scores.MPJPE_mm,
                scores.GLE_mm, scores.PCK);
    std::fflush(stdout);
    if (scores.MPJPE_mm < kEnough) return 0;
  }
  std::printf("MPJPE did not fall below %.0f mm in %.0f minutes\n", kEnough, minutes);
  return 1;
}
