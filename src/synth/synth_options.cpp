#include "doppel/synth/synth_options.h"

#include <cmath>

#include "doppel/core/error.h"
#include "doppel/synth/other_body.h"

namespace doppel::synth {

namespace {

constexpr double kMaxTurn = 360.0;  ///< degrees per second

}  // namespace

ClothModel cloth_model(const std::string& name) {
  if (name == "springs") return ClothModel::springs;
  if (name == "xpbd") return ClothModel::xpbd;
  fail<UsageError>("doppel synth: there is no cloth model '{}'; use springs or xpbd", name);
}

std::string cloth_name(ClothModel model) { return model == ClothModel::xpbd ? "xpbd" : "springs"; }

Lens synth_lens(const std::string& name) {
  if (name == "pinhole") return Lens::opencv;
  if (name == "fisheye") return Lens::fisheye;
  fail<UsageError>("doppel synth: there is no lens '{}'; use pinhole or fisheye", name);
}

SynthOptions SynthOptions::preset(const std::string& name) {
  SynthOptions o;
  if (name == "small") return o;
  if (name == "studio") {
    o.cameras = 12;
    o.size = 512;
    o.frames = 3000;
    o.test_frames = 500;
    o.take_frames = 250;
    o.movements = Movements::varied;
    o.room = 0.5;
    o.keypoint_tables = true;
    o.cloth.model = ClothModel::xpbd;
    return o;
  }
  if (name != "tiny") fail<UsageError>("doppel synth: there is no preset '{}'; use tiny, small or studio", name);
  o.actor.vertices = 1500;
  o.actor.nodes = 150;
  o.actor.texture_size = 512;
  o.cameras = 4;
  o.size = 192;
  o.frames = 24;
  o.test_frames = 12;
  return o;
}

void check_options(const SynthOptions& o) {
  const auto within = [](const char* what, long value, long low, long high) {
    if (value < low || value > high)
      fail<UsageError>("doppel synth: {} is {}; it must be {} to {}", what, value, low, high);
  };
  within("the number of cameras", o.cameras, 1, 64);
  within("the image size", o.size, 64, 2048);
  if (o.frames != 0 || o.clips.empty()) within("the number of training frames", o.frames, 4, 100000);
  if (o.test_frames != 0 || o.test_clips.empty()) within("the number of test frames", o.test_frames, 2, 100000);
  if (o.size % 2 != 0)
    fail<UsageError>("doppel synth: the image size is {}; video encoders need an even number", o.size);
  if (o.body != kOwnBody) measures_of(o.body);  // refuses a word that names no body
  if (o.movements == Movements::varied && o.turn != 0)
    fail<UsageError>(
        "doppel synth: with varied movements, the person turns anyway; leave out --turn, or use the preset tiny or "
        "small");
  if (o.turn != 0 && o.frames == 0 && o.test_frames == 0)
    fail<UsageError>("doppel synth: motions of files turn as they are; leave out --turn, or generate frames too");
  if (!(std::abs(o.turn) <= kMaxTurn))
    fail<UsageError>("doppel synth: the person turns by {} degrees per second; this must be {} to {}", o.turn,
                     -kMaxTurn, kMaxTurn);
}

}  // namespace doppel::synth
