#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "doppel/core/atomic_file.h"
#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/core/json_bounds.h"
#include "doppel/rigging/joints/body_joints.h"

namespace doppel {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxJsonDepth = 100;

std::string full_name(const std::string& name) {
  if (name.starts_with("l_")) return "left_" + name.substr(2);
  if (name.starts_with("r_")) return "right_" + name.substr(2);
  return name;
}

/// @param what for messages @throws FileError unless `value` is a list of `count` finite numbers
std::vector<double> numbers(const FileLocation& file, const Json& value, std::size_t count, const std::string& what) {
  std::vector<double> result;
  if (value.is_array())
    for (const Json& item : value)
      if (item.is_number() && std::isfinite(item.get<double>())) result.push_back(item.get<double>());
  if (!value.is_array() || value.size() != count || result.size() != count)
    fail_at(file, "{} must be a list of {} finite numbers", what, count);
  return result;
}

Eigen::Affine3d read_matrix(const FileLocation& file, const Json& value) {
  if (!value.is_array() || value.size() != 4) fail_at(file, "'file_from_character' must have 4 rows of 4 numbers");
  Eigen::Affine3d result = Eigen::Affine3d::Identity();
  for (int row = 0; row < 4; ++row) {
    const auto line = numbers(file, value[static_cast<std::size_t>(row)], 4, "a row of 'file_from_character'");
    for (int column = 0; column < 4; ++column) result.matrix()(row, column) = line[static_cast<std::size_t>(column)];
  }
  if (!result.matrix().row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1)))
    fail_at(file, "the last row of 'file_from_character' must be 0 0 0 1");
  const Eigen::Matrix3d square = result.linear() * result.linear().transpose();
  const double scale2 = square.trace() / 3;
  if (!(scale2 > 0) || !square.isApprox(scale2 * Eigen::Matrix3d::Identity(), 1e-4) ||
      !(result.linear().determinant() > 0))
    fail_at(file, "'file_from_character' must consist of one scale, a rotation and a translation, without a mirror");
  return result;
}

void check_name(const FileLocation& file, const std::string& written, const std::string& name) {
  std::vector<std::string> known = body_joint_names();
  known.insert(known.end(), extra_point_names().begin(), extra_point_names().end());
  if (std::find(known.begin(), known.end(), name) != known.end()) return;
  std::string list;
  for (const std::string& word : body_joint_names()) list += (list.empty() ? "" : ", ") + word;
  fail_at(file, "'{}' is not the name of a joint; known are {}, and the points of fingers, {} to {}{}", written, list,
          finger_point("left_", kFingers.front(), 1), finger_point("right_", kFingers.back(), kFingerPoints),
          nearest_word_hint(name, known));
}

Json parse(const std::filesystem::path& path) {
  const std::string text = read_file(path, 1 << 24);
  if (is_json_deeper_than(text, kMaxJsonDepth))
    fail_at({path.string(), 0}, "not a JSON file of joints: lists and objects are nested more than {} deep",
            kMaxJsonDepth);
  try {
    return Json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    fail_at({path.string(), 0}, "not a JSON file of joints: {}", error.what());
  }
}

}  // namespace

JointsFile read_joints(const std::filesystem::path& path, const std::optional<Eigen::Affine3d>& file_from_character) {
  const FileLocation file{path.string(), 0};
  const Json json = parse(path);
  if (!json.is_object() || !json.contains("joints") || !json["joints"].is_object())
    fail_at(file, "the file must hold {{\"joints\": {{\"left_elbow\": [x, y, z], ...}}}}");
  JointsFile result;
  if (json.contains("file_from_character"))
    result.file_from_character = read_matrix(file, json["file_from_character"]);
  else if (file_from_character)
    result.file_from_character = *file_from_character;
  else
    fail_at(file, "'file_from_character' is missing: the 4x4 matrix from metres to the coordinates of the file");
  const Eigen::Affine3d character_from_file = result.file_from_character.inverse();
  for (const auto& [written, value] : json["joints"].items()) {
    const std::string name = full_name(written);
    check_name(file, written, name);
    if (value.is_null()) continue;
    const auto xyz = numbers(file, value, 3, "the joint '" + written + "'");
    if (!result.joints.positions.emplace(name, character_from_file * Eigen::Vector3d(xyz[0], xyz[1], xyz[2])).second)
      fail_at(file, "the joint '{}' stands twice", name);
  }
  return result;
}

void write_joints(const std::filesystem::path& path, const JointsFile& file) {
  Json json;
  json["file_from_character"] = Json::array();
  for (int row = 0; row < 4; ++row) {
    Json line = Json::array();
    for (int column = 0; column < 4; ++column) line.push_back(file.file_from_character.matrix()(row, column));
    json["file_from_character"].push_back(line);
  }
  json["joints"] = Json::object();
  std::vector<std::string> names = body_joint_names();
  for (const char* side : {"left_", "right_"})
    for (const Finger& finger : kFingers)
      for (int k = 1; k <= kFingerPoints; ++k) names.push_back(finger_point(side, finger, k));
  for (const std::string& name : names) {
    if (!file.joints.has(name)) continue;
    const Eigen::Vector3d p = file.file_from_character * file.joints.at(name);
    json["joints"][name] = {p.x(), p.y(), p.z()};
  }
  write_atomically(path, json.dump(1) + "\n");
}

}  // namespace doppel
