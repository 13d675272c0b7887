#include "doppel/io/figure_export/fbx_curves.h"

#include <array>

#include "doppel/core/as_size.h"

namespace doppel {
namespace {

constexpr std::int32_t kLinearKey = 0x4;

class FbxCurves {
 public:
  FbxCurves(FbxDocument& document, std::int64_t layer, const FbxClock& clock)
      : document_(document), layer_(layer), clock_(clock) {}

  /// @param letter name of the curve node: T or R @param frames times of the keys
  void add_vector(std::int64_t model, const char* letter, const char* property, const std::vector<double>& frames,
                  const std::vector<Eigen::Vector3d>& values) {
    static constexpr std::array<const char*, 3> kParts{"d|X", "d|Y", "d|Z"};
    std::vector<FbxNode> first;
    for (int i = 0; i < 3; ++i) first.push_back(property70(kParts[as_size(i)], "Number", "", "A", {values[0][i]}));
    const std::int64_t node = add_node(model, letter, property, std::move(first));
    for (int i = 0; i < 3; ++i) {
      std::vector<float> numbers;
      for (const Eigen::Vector3d& value : values) numbers.push_back(static_cast<float>(value[i]));
      add_curve(node, kParts[as_size(i)], frames, std::move(numbers));
    }
  }

  void add_weight(std::int64_t channel, const std::vector<double>& frames, std::vector<float> percent) {
    const char* part = "d|DeformPercent";
    const std::int64_t node = add_node(channel, "DeformPercent", "DeformPercent",
                                       {property70(part, "Number", "", "A", {static_cast<double>(percent[0])})});
    add_curve(node, part, frames, std::move(percent));
  }

 private:
  std::int64_t add_node(std::int64_t object, const char* name, const char* property, std::vector<FbxNode> first) {
    const std::int64_t node =
        document_.add("AnimationCurveNode", name, "AnimCurveNode", "", {properties70(std::move(first))});
    document_.connect(node, layer_);
    document_.connect(node, object, property);
    return node;
  }

  void add_curve(std::int64_t node, const char* part, const std::vector<double>& frames, std::vector<float> values) {
    std::vector<std::int64_t> ticks;
    for (const double frame : frames) ticks.push_back(clock_.ticks(frame));
    const auto count = static_cast<std::int32_t>(values.size());
    const double first = static_cast<double>(values[0]);
    const std::int64_t curve = document_.add("AnimationCurve", "", "AnimCurve", "",
                                             {{"Default", {first}, {}},
                                              {"KeyVer", {4008}, {}},
                                              {"KeyTime", {std::move(ticks)}, {}},
                                              {"KeyValueFloat", {std::move(values)}, {}},
                                              {"KeyAttrFlags", {std::vector<std::int32_t>{kLinearKey}}, {}},
                                              {"KeyAttrDataFloat", {std::vector<float>(4, 0.0F)}, {}},
                                              {"KeyAttrRefCount", {std::vector<std::int32_t>{count}}, {}}});
    document_.connect(curve, node, part);
  }

  FbxDocument& document_;
  std::int64_t layer_;
  const FbxClock& clock_;
};

/// Most targets rest most of the time, so keys between equal ones are left out.
void add_weight_curve(FbxCurves& curves, std::int64_t channel, const FigureTracks& tracks, Eigen::Index k) {
  std::vector<double> frames;
  std::vector<float> percent;
  const std::vector<int>& keys = tracks.weight_keys;
  const auto value = [&](std::size_t i) { return static_cast<float>(100.0 * tracks.weights(keys[i], k)); };
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const bool held_before = i > 0 && value(i) == value(i - 1);
    const bool held_after = i + 1 == keys.size() || value(i) == value(i + 1);
    if (held_before && held_after) continue;
    frames.push_back(keys[i]);
    percent.push_back(value(i));
  }
  curves.add_weight(channel, frames, std::move(percent));
}

std::int64_t add_layer(FbxDocument& document, const FbxClock& clock, const std::string& name) {
  const auto time = [&](const char* property, int frame) {
    return property70(property, "KTime", "Time", "", {clock.ticks(frame)});
  };
  const std::int64_t stack =
      document.add("AnimationStack", name, "AnimStack", "",
                   {properties70({time("LocalStart", 0), time("LocalStop", clock.last_frame), time("ReferenceStart", 0),
                                  time("ReferenceStop", clock.last_frame)})});
  const std::int64_t layer = document.add("AnimationLayer", "BaseLayer", "AnimLayer", "", {properties70({})});
  document.connect(layer, stack);
  return layer;
}

}  // namespace

void add_fbx_animation(FbxDocument& document, const FbxMoved& moved, const FigureTracks& tracks,
                       const std::vector<EulerTrack>& turns, const FbxClock& clock, const std::string& name) {
  FbxCurves curves(document, add_layer(document, clock, name), clock);
  for (std::size_t i = 0; i < moved.bones.size(); ++i) {
    const std::vector<int>& keys = tracks.translation_keys[i];
    std::vector<Eigen::Vector3d> offsets;
    for (const int key : keys) offsets.push_back(kFbxUnitsPerMetre * tracks.translation[i][as_size(key)]);
    curves.add_vector(moved.bones[i], "T", "Lcl Translation", {keys.begin(), keys.end()}, offsets);
    curves.add_vector(moved.bones[i], "R", "Lcl Rotation", turns[i].frames, turns[i].degrees);
  }
  for (std::size_t k = 0; k < moved.channels.size(); ++k)
    add_weight_curve(curves, moved.channels[k], tracks, static_cast<Eigen::Index>(k));
}

}  // namespace doppel
