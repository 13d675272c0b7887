#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "doppel/core/atomic_file.h"

namespace doppel::support {

/// The posed vertices of a .glb file with one skinned mesh and animations, by the equations of the glTF 2.0
/// specification: morph targets first, then linear blend skinning. Shares no code with readers or writers.
class GltfPose {
 public:
  using Json = nlohmann::json;
  Json json;

  explicit GltfPose(const std::filesystem::path& path) : bytes_(read_file(path)) {
    std::uint32_t size = 0;
    std::memcpy(&size, bytes_.data() + 12, 4);
    json = Json::parse(bytes_.substr(20, size));
    binary_ = 28 + size;
  }

  const Json& primitive() const { return json["meshes"][0]["primitives"][0]; }
  /// The rows of an accessor.
  std::vector<std::vector<double>> rows(int index) const {
    const Json& accessor = json["accessors"][index];
    const Json& view = json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    const int kind = accessor["componentType"].get<int>();
    const std::size_t bytes = kind == 5123 ? 2 : 4, width = widths().at(accessor["type"].get<std::string>());
    const std::size_t first =
        binary_ + view.value("byteOffset", std::size_t{0}) + accessor.value("byteOffset", std::size_t{0});
    std::vector<std::vector<double>> result(accessor["count"].get<std::size_t>(), std::vector<double>(width));
    for (std::size_t i = 0; i < result.size() * width; ++i)
      result[i / width][i % width] = value_at(first + bytes * i, kind);
    return result;
  }

  /// [vertices of the file] @param seconds on the time axis of the animation @param animation number
  std::vector<Eigen::Vector3d> vertices(double seconds, std::size_t animation = 0) const {
    Json nodes = json["nodes"];
    std::vector<double> weights = json["meshes"][0].value("weights", std::vector<double>{});
    const Json& moving = json["animations"][animation];
    for (const Json& channel : moving["channels"])
      apply(channel, moving["samplers"][channel["sampler"].get<std::size_t>()], seconds, nodes, weights);
    const std::vector<Eigen::Affine3d> world = world_of(nodes);
    const Json& skin = json["skins"][0];
    const auto inverse = rows(skin["inverseBindMatrices"].get<int>());
    std::vector<Eigen::Matrix4d> matrices;
    for (std::size_t j = 0; j < inverse.size(); ++j)
      matrices.push_back(world[skin["joints"][j].get<std::size_t>()].matrix() *
                         Eigen::Map<const Eigen::Matrix4d>(inverse[j].data()));
    const Json& attributes = primitive()["attributes"];
    const auto joints = rows(attributes["JOINTS_0"].get<int>()), shares = rows(attributes["WEIGHTS_0"].get<int>());
    std::vector<Eigen::Vector3d> points = morphed(weights);
    for (std::size_t v = 0; v < points.size(); ++v) {
      Eigen::Vector4d sum = Eigen::Vector4d::Zero();
      for (std::size_t i = 0; i < 4; ++i)
        sum += shares[v][i] * (matrices[static_cast<std::size_t>(joints[v][i])] * points[v].homogeneous());
      points[v] = sum.head<3>();
    }
    return points;
  }

 private:
  static const std::map<std::string, std::size_t>& widths() {
    static const std::map<std::string, std::size_t> all{
        {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};
    return all;
  }
  double value_at(std::size_t at, int kind) const {
    if (kind == 5126) return read<float>(at);
    return kind == 5125 ? read<std::uint32_t>(at) : read<std::uint16_t>(at);
  }
  template <typename T>
  double read(std::size_t at) const {
    T value;
    std::memcpy(&value, bytes_.data() + at, sizeof value);
    return static_cast<double>(value);
  }

  void apply(const Json& channel, const Json& sampler, double seconds, Json& nodes,
             std::vector<double>& weights) const {
    const auto times = rows(sampler["input"].get<int>()), values = rows(sampler["output"].get<int>());
    std::size_t after = 0;
    while (after < times.size() && times[after][0] < seconds) ++after;
    const std::size_t b = std::min(after, times.size() - 1), a = after == 0 ? 0 : after - 1;
    const double span = times[b][0] - times[a][0], share = span > 0 ? (seconds - times[a][0]) / span : 0.0;
    Json& node = nodes[channel["target"]["node"].get<std::size_t>()];
    const std::string path = channel["target"]["path"].get<std::string>();
    if (path == "weights") {
      for (std::size_t k = 0; k < weights.size(); ++k)
        weights[k] = (1 - share) * values[a * weights.size() + k][0] + share * values[b * weights.size() + k][0];
    } else if (path == "rotation") {
      const Eigen::Quaterniond from(values[a].data()), to(values[b].data()), at = from.slerp(share, to);
      node[path] = {at.x(), at.y(), at.z(), at.w()};
    } else {
      std::vector<double> mixed;
      for (std::size_t i = 0; i < 3; ++i) mixed.push_back((1 - share) * values[a][i] + share * values[b][i]);
      node[path] = mixed;
    }
  }

  static std::vector<Eigen::Affine3d> world_of(const Json& nodes) {
    std::vector<Eigen::Affine3d> world(nodes.size(), Eigen::Affine3d::Identity());
    std::vector<int> parent(nodes.size(), -1);
    for (std::size_t i = 0; i < nodes.size(); ++i)
      for (const Json& child : nodes[i].value("children", Json::array()))
        parent[child.get<std::size_t>()] = static_cast<int>(i);
    for (std::size_t i = 0; i < nodes.size(); ++i)
      for (int at = static_cast<int>(i); at >= 0; at = parent[at]) world[i] = local_of(nodes[at]) * world[i];
    return world;
  }
  static Eigen::Affine3d local_of(const Json& node) {
    const auto t = node.value("translation", std::vector<double>{0, 0, 0});
    const auto r = node.value("rotation", std::vector<double>{0, 0, 0, 1});
    return Eigen::Translation3d(t[0], t[1], t[2]) * Eigen::Quaterniond(r.data()).normalized();
  }

  std::vector<Eigen::Vector3d> morphed(const std::vector<double>& weights) const {
    const auto base = rows(primitive()["attributes"]["POSITION"].get<int>());
    std::vector<Eigen::Vector3d> points;
    for (const auto& row : base) points.emplace_back(row.data());
    for (std::size_t k = 0; k < weights.size(); ++k) {
      const auto target = rows(primitive()["targets"][k]["POSITION"].get<int>());
      for (std::size_t v = 0; v < points.size(); ++v) points[v] += weights[k] * Eigen::Vector3d(target[v].data());
    }
    return points;
  }

  std::string bytes_;
  std::size_t binary_ = 0;
};

}  // namespace doppel::support
