#include "faults/tiny_work.h"

#include <algorithm>
#include <cstdlib>
#include <stdexcept>

#include "detect/networks/small_networks.h"
#include "doppel/core/atomic_file.h"
#include "faults/program_run.h"
#include "support/hostile_files.h"

namespace doppel::faults {

namespace fs = std::filesystem;

using Words = std::vector<std::string>;

namespace {

Words joined(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

}  // namespace

Words Recipe::with_out(const fs::path& out) const {
  Words result = words;
  for (std::string& word : result)
    if (const auto at = word.find("OUT"); at != std::string::npos) word.replace(at, 3, out.string());
  return result;
}

bool is_wanted(const Recipe& recipe, const std::string& otherwise) {
  const char* names = std::getenv("DOPPEL_FAULT_RECIPES");
  const std::string wanted = names ? names : otherwise;
  return wanted == "all" || ("," + wanted + ",").find("," + recipe.name + ",") != std::string::npos;
}

TinyWork::TinyWork() {
  make(synth(at("capture")));
  make(prepare(at("prepared")));
  write_atomically(at("egnet.yaml"),
                   "stage: egnet\n"
                   "data: {batch_size: 4, cameras_per_sample: 2, pose_noise: 0.2, input_noise: 0.05}\n"
                   "model: {preset: paper, features: 8, residual_blocks: 2, rings: 2}\n"
                   "loss: {silhouette: 100, arap: 100}\n"
                   "train: {learning_rate: 2e-3, schedule: cosine}\n");
  make(train(at("run"), 4, 1));
  make_broken_run();
  for (const std::string part : {"0", "1"}) make(joined(prepare(at("parts/" + part)), {"--shard", part + "/2"}));
  make_detector();
  make_footage();
}

Words TinyWork::synth(const std::string& out, int frames) const {
  return {"synth",     "--preset", "tiny",  "--frames", std::to_string(frames), "--test-frames", "2",
          "--cameras", "3",        "--out", out};
}

Words TinyWork::prepare(const std::string& out) const {
  return {"prepare", at("capture"), "--mask-size", "32", "--image-size", "32", "--out", out};
}

Words TinyWork::train(const std::string& out, int steps, int every) const {
  return {"train", at("egnet.yaml"),
          "--set", "capture=" + at("prepared").string(),
          "--set", "train.iterations=" + std::to_string(steps),
          "--set", "train.checkpoint_every=" + std::to_string(every),
          "--set", "train.log_every=1",
          "--set", "train.keep_last=1000",
          "--out", out};
}

Words TinyWork::track(const std::string& out) const {
  return {"track", at("capture"), "--limit-frames", "2",     "--sheet-frames",
          "1",     "--surface",   "--vertices",     "--out", out};
}

void TinyWork::make(const Words& words) const {
  const Ending ending = run(words);
  if (!ending.succeeded()) throw std::runtime_error("doppel " + words.front() + ": " + ending.err);
}

void TinyWork::make_detector() const {
  using namespace test_networks;
  support::write_bytes(
      at("pose.onnx"),
      centre_net(80, 60, {x_of(0), y_of(0), sum_of(0), x_of(1), y_of(1), sum_of(1), x_of(2), y_of(2), sum_of(2)},
                 {0, 0, 0, 1, 1, 1, 2, 2, 2}, {1, 3, 3}));
  support::write_bytes(at("net.yaml"), "input: [80, 60]\n");
  support::write_bytes(at("map.yaml"), "points: [blue, green, red]\nevery_point: true\n");
}

void TinyWork::make_broken_run() const {
  fs::copy(at("run"), at("broken"), fs::copy_options::recursive);
  for (const char* step : {"000003", "000004"})
    fs::remove(at("broken") / "checkpoints" / fmt::format("step-{}.pt", step));
}

void TinyWork::make_footage() const {
  const auto copy = [&](const fs::path& part) {
    fs::create_directories((at("footage") / part).parent_path());
    fs::copy(at("capture") / part, at("footage") / part, fs::copy_options::recursive);
  };
  for (const fs::path sequence : {"training", "testing"})
    for (const char* kind : {"videos", "keypoints"}) copy(sequence / kind);
  for (const char* part : {"calibration/cameras.yml", "background", "character"}) copy(part);
}

void TinyWork::restore(const Recipe& recipe, const fs::path& out) const {
  fs::remove_all(out);
  fs::remove_all(out.parent_path() / ("." + out.filename().string() + ".making"));  // of synth
  if (!recipe.before.empty()) fs::copy(at(recipe.before), out, fs::copy_options::recursive);
}

std::vector<Recipe> TinyWork::recipes_to_kill() const {
  std::vector<Recipe> all = recipes();
  all.push_back({"long train", train("OUT", 60, 7), ""});
  all.push_back({"make", {"make", at("footage"), "--stop-after", "prepare", "--out", "OUT"}, ""});
  return all;
}

std::vector<Recipe> TinyWork::recipes() const {
  const std::string character = at("capture/character/actor.character");
  const std::string motion = at("capture/testing/skeletoolToGTPose/poseAngles.motion");
  const std::string video = at("capture/testing/videos/stream000.mp4");
  return {
      {"synth", synth("OUT"), ""},
      {"prepare", prepare("OUT"), ""},
      {"train", train("OUT", 4, 1), ""},
      {"train resumed", train("OUT", 4, 1), "broken"},
      {"track", track("OUT"), ""},
      {"track livecap",
       {"track", "livecap", at("capture"), "--camera", "0", "--limit-frames", "2", "--vertices", "--preview",
        "OUT/film.mp4", "--out", "OUT"},
       ""},
      {"track live",
       {"track", "live", at("capture"), "--camera", "0", "--sequence", "testing", "--source", video, "--vertices",
        "--out", "OUT"},
       ""},
      {"detect",
       {"detect", at("capture"), "--network", at("pose.onnx"), "--config", at("net.yaml"), "--layout", at("map.yaml"),
        "--out", "OUT"},
       ""},
      {"export", {"export", "--run", at("run"), "--out", "OUT/actor.pt"}, ""},
      {"export onnx", {"export", "--run", at("run"), "--format", "onnx", "--out", "OUT/actor.onnx"}, ""},
      {"export safetensors",
       {"export", "--run", at("run"), "--format", "safetensors", "--out", "OUT/actor.safetensors"},
       ""},
      {"animate",
       {"animate", "--character", character, "--motion", motion, "--format", "npy,obj,glb,usda,pc2,mdd,mp4,png",
        "--video-size", "64", "--out", "OUT"},
       ""},
      {"evaluate", {"evaluate", "--run", "OUT", "--split", "all"}, "run"},
      {"merge", {"merge", at("parts"), "--out", "OUT"}, "", true},
  };
}

}  // namespace doppel::faults
