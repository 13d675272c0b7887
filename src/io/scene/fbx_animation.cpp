#include "doppel/io/scene/fbx_animation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

constexpr std::int64_t kConstantKey = 0x2, kCubicKey = 0x8;
/// Largest angle between two samples of a rotation, degrees: between them the shortest arc replaces the Euler angles.
constexpr double kMaxTurn = 3.0;
constexpr int kPiecesOfCubic = 16;
/// Seconds. Half a turn in less time is a change of the Euler angles, not of the rotation.
constexpr double kFrame = 0.1;
/// A value that is held ends so near to the next key, as a part of the piece.
constexpr double kHeldEnd = 1e-3;

/// One number over time.
struct Curve {
  std::vector<double> times;  ///< seconds, ascending
  std::vector<double> values;
  std::vector<std::int64_t> flags;       ///< per key
  std::vector<double> right, next_left;  ///< slopes per second of the piece after each key
  double fallback = 0.0;

  bool cubic(std::size_t k) const { return (flags[k] & kCubicKey) != 0; }

  double at(double seconds) const {
    if (times.empty()) return fallback;
    const auto next = std::upper_bound(times.begin(), times.end(), seconds);
    if (next == times.begin()) return values.front();
    if (next == times.end()) return values.back();
    const auto k = as_size(next - times.begin() - 1);
    if (flags[k] & kConstantKey) return values[k];
    const double gap = times[k + 1] - times[k], s = (seconds - times[k]) / gap, s2 = s * s, s3 = s2 * s;
    if (!cubic(k)) return values[k] + s * (values[k + 1] - values[k]);
    return (2 * s3 - 3 * s2 + 1) * values[k] + (s3 - 2 * s2 + s) * gap * right[k] + (3 * s2 - 2 * s3) * values[k + 1] +
           (s3 - s2) * gap * next_left[k];
  }
};

/// Keys share their attributes in runs: `KeyAttrRefCount[r]` keys have flags r and the four numbers from 4 r.
void read_attributes(const FbxRecord& record, Curve& curve) {
  const FbxRecord *flags = record.child("KeyAttrFlags"), *data = record.child("KeyAttrDataFloat"),
                  *counts = record.child("KeyAttrRefCount");
  curve.flags.assign(curve.times.size(), 0);
  curve.right.assign(curve.times.size(), 0.0);
  curve.next_left.assign(curve.times.size(), 0.0);
  if (!flags || !counts) return;
  const auto flag = flags->integers(), count = counts->integers();
  const auto slopes = data ? data->numbers() : std::vector<double>();
  std::size_t key = 0;
  for (std::size_t run = 0; run < std::min(flag.size(), count.size()); ++run)
    for (std::int64_t i = 0; i < count[run] && key < curve.times.size(); ++i, ++key) {
      curve.flags[key] = flag[run];
      if (4 * run + 1 < slopes.size()) {
        curve.right[key] = slopes[4 * run];
        curve.next_left[key] = slopes[4 * run + 1];
      }
      if (!std::isfinite(curve.right[key]) || !std::isfinite(curve.next_left[key])) curve.flags[key] = 0;
    }
}

Curve read_curve(const FbxRecord& record, double fallback, double ticks_per_second) {
  Curve curve;
  curve.fallback = fallback;
  const FbxRecord *times = record.child("KeyTime"), *values = record.child("KeyValueFloat");
  if (!times || !values) return curve;
  const auto ticks = times->integers();
  curve.values = values->numbers();
  curve.values.resize(std::min(ticks.size(), curve.values.size()));
  for (std::size_t k = 0; k < curve.values.size(); ++k)
    curve.times.push_back(static_cast<double>(ticks[k]) / ticks_per_second);
  read_attributes(record, curve);
  return curve;
}

/// The times at which three curves are sampled: all keys, and points between them where a piece is curved or turns far.
std::vector<double> sample_times(const std::array<Curve, 3>& curves, bool angles, const SceneLimits& limits) {
  std::set<double> keys;
  for (const Curve& curve : curves) keys.insert(curve.times.begin(), curve.times.end());
  std::vector<double> times;
  for (auto key = keys.begin(); key != keys.end(); ++key) {
    times.push_back(*key);
    const auto next = std::next(key);
    if (next == keys.end()) break;
    const double gap = *next - *key;
    double pieces = 1.0;
    bool held = false;
    for (const Curve& curve : curves) {
      const auto after = std::upper_bound(curve.times.begin(), curve.times.end(), *key);
      if (after == curve.times.begin() || after == curve.times.end()) continue;
      const auto k = as_size(after - curve.times.begin() - 1);
      if (curve.flags[k] & kConstantKey) {
        held = held || (curve.times[k + 1] == *next && curve.values[k + 1] != curve.values[k]);
        continue;
      }
      if (curve.cubic(k)) pieces = std::max(pieces, double(kPiecesOfCubic));
      const double turn = std::abs(curve.at(*next) - curve.at(*key));
      if (angles && (turn < 180.0 || gap > kFrame)) pieces = std::max(pieces, std::ceil(turn / kMaxTurn));
    }
    if (static_cast<double>(times.size()) + pieces > static_cast<double>(limits.keys))
      fail("the animations have more than {} keys", limits.keys);
    for (int i = 1; i < pieces; ++i) times.push_back(*key + gap * i / pieces);
    const double before = *next - kHeldEnd * gap / pieces;
    if (held && before > times.back() && before < *next) times.push_back(before);
  }
  return times;
}

bool all_constant(const std::array<Curve, 3>& curves) {
  for (const Curve& curve : curves)
    for (std::size_t k = 0; k + 1 < curve.times.size(); ++k)
      if (!(curve.flags[k] & kConstantKey)) return false;
  return true;
}

Eigen::Vector3d model_default(const FbxRecord& model, const std::string& property) {
  const FbxRecord* found = fbx_property(model, property.c_str());
  const double usual = property == "Lcl Scaling" ? 1.0 : 0.0;
  if (!found) return Eigen::Vector3d::Constant(usual);
  return {found->number(4, usual), found->number(5, usual), found->number(6, usual)};
}

SceneChannel read_fbx_channel(const FbxObjects& objects, const FbxRecord& curve_node, const FbxRecord& model,
                              const std::string& property, double ticks_per_second, std::set<double>& keys,
                              const SceneLimits& limits) {
  static const std::array<const char*, 3> kAxes{"d|X", "d|Y", "d|Z"};
  const Eigen::Vector3d usual = model_default(model, property);
  std::array<Curve, 3> curves;
  for (int axis = 0; axis < 3; ++axis) {
    const char* name = kAxes[axis];
    curves[axis].fallback = fbx_number(curve_node, name, usual[axis]);
    const auto found = objects.below(curve_node, "AnimationCurve", name);
    if (!found.empty()) curves[axis] = read_curve(*found[0], curves[axis].fallback, ticks_per_second);
    keys.insert(curves[axis].times.begin(), curves[axis].times.end());
  }
  SceneChannel channel;
  const bool angles = property == "Lcl Rotation";
  channel.target = angles                      ? SceneChannel::Target::rotation
                   : property == "Lcl Scaling" ? SceneChannel::Target::scale
                                               : SceneChannel::Target::translation;
  if (all_constant(curves)) channel.interpolation = SceneChannel::Interpolation::step;
  const int order = fbx_choice(model, "RotationOrder", 0, 5);
  channel.times = sample_times(curves, angles, limits);
  for (const double time : channel.times) {
    const Eigen::Vector3d value(curves[0].at(time), curves[1].at(time), curves[2].at(time));
    channel.values.push_back(angles ? fbx_rotation(order, value).coeffs()
                                    : Eigen::Vector4d(value.x(), value.y(), value.z(), 0));
  }
  return channel;
}

}  // namespace

Eigen::Quaterniond fbx_rotation(int order, const Eigen::Vector3d& degrees) {
  static const std::array<std::array<int, 3>, 6> kOrders{
      {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}, {1, 0, 2}, {2, 0, 1}, {2, 1, 0}}};
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  for (const int axis : kOrders[std::clamp(order, 0, 5)])
    rotation = Eigen::AngleAxisd(degrees[axis] * (M_PI / 180), Eigen::Vector3d::Unit(axis)) * rotation;
  return rotation;
}

double fbx_ticks_per_second(const FbxRecord& root) {
  constexpr double kNewTicks = 141120000.0, kOldDefinition = 127;
  const auto number = [](const FbxRecord* parent, const char* name) {
    const FbxRecord* record = parent ? parent->child(name) : nullptr;
    return record ? std::optional(record->number(0)) : std::nullopt;
  };
  const FbxRecord* header = root.child("FBXHeaderExtension");
  const auto definition = number(header ? header->child("OtherFlags") : nullptr, "TCDefinition");
  const double version = number(header, "FBXVersion").value_or(0.0);
  const bool is_new = version >= 8000 || (version >= 7700 && definition && *definition != kOldDefinition);
  return is_new ? kNewTicks : kFbxTicksPerSecond;
}

std::vector<SceneAnimation> read_fbx_animations(const FbxObjects& objects, double ticks_per_second,
                                                const std::map<const FbxRecord*, int>& node_of,
                                                std::vector<std::string>& warnings, const SceneLimits& limits) {
  std::vector<SceneAnimation> animations;
  std::int64_t keys = 0;
  for (const FbxRecord* stack : objects.all("AnimationStack")) {
    SceneAnimation animation;
    animation.name = fbx_name(*stack);
    std::set<double> own_keys;
    const auto layers = objects.below(*stack, "AnimationLayer");
    if (layers.size() > 1)
      warnings.push_back(fmt::format("animation '{}' has {} layers; the first is read", animation.name, layers.size()));
    if (layers.empty()) continue;
    for (const FbxRecord* curve_node : objects.below(*layers[0], "AnimationCurveNode"))
      for (const auto& [model, property] : objects.above_with_property(*curve_node, "Model")) {
        const auto node = node_of.find(model);
        if (node == node_of.end()) continue;
        if (property != "Lcl Translation" && property != "Lcl Rotation" && property != "Lcl Scaling") continue;
        SceneChannel channel =
            read_fbx_channel(objects, *curve_node, *model, property, ticks_per_second, own_keys, limits);
        channel.node = node->second;
        keys += static_cast<std::int64_t>(channel.times.size());
        if (keys > limits.keys) fail("the animations have more than {} keys", limits.keys);
        animation.channels.push_back(std::move(channel));
      }
    animation.keys.assign(own_keys.begin(), own_keys.end());
    if (!animation.channels.empty()) animations.push_back(std::move(animation));
  }
  return animations;
}

}  // namespace doppel
