#include "doppel/character/landmarks.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <set>

#include "doppel/character/file_text.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/config.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace {

constexpr char kLandmarkHeader[] = "index,name,joint,x_mm,y_mm,z_mm";

int find_joint(const TextReader& reader, const Skeleton& skeleton, const std::string& name) {
  if (const auto joint = skeleton.find_joint(name)) return *joint;
  std::vector<std::string> known;
  for (const Joint& joint : skeleton.joints) known.push_back(joint.name);
  reader.fail_here("the skeleton has no joint '{}'{}", excerpt(name), nearest_word_hint(name, known));
}

Marker read_row(const TextReader& reader, const Skeleton& skeleton,
                const std::vector<Eigen::Affine3d>& world_from_joint) {
  Marker marker;
  marker.name = reader.tokens()[1];
  if (marker.name.empty()) reader.fail_here("a landmark needs a name");
  marker.joint = find_joint(reader, skeleton, std::string(reader.tokens()[2]));
  const Eigen::Vector3d millimetres(reader.number(3, "x_mm"), reader.number(4, "y_mm"), reader.number(5, "z_mm"));
  if (!(millimetres.cwiseAbs().maxCoeff() < 1e9)) reader.fail_here("the position is farther away than 1000 km");
  marker.position =
      world_from_joint[marker.joint].inverse(Eigen::Isometry) * Eigen::Vector3d(millimetres * kMetresPerMillimetre);
  return marker;
}

/// Rounded to a nanometre, the precision after the transform through the joint's frame.
std::string rounded_millimetres(double metres) {
  return exact_text(std::round(metres / kMetresPerMillimetre * 1e6) / 1e6);
}

}  // namespace

std::vector<Marker> read_landmarks(const std::filesystem::path& csv, const Character& character) {
  TextReader reader(csv, "a table of landmarks", Separator::comma);
  reader.require_header(kLandmarkHeader);
  const auto world_from_joint = character.skeleton.pose(character.rest_dofs);
  std::vector<Marker> landmarks;
  std::set<std::string> names;
  while (reader.next_row(6)) {
    const long index = reader.integer(0, "index", 0, INT_MAX);
    if (index != static_cast<long>(landmarks.size()))
      reader.fail_here("the row has index {}, expected {}: rows count up from 0", index, landmarks.size());
    landmarks.push_back(read_row(reader, character.skeleton, world_from_joint));
    if (!names.insert(landmarks.back().name).second)
      reader.fail_here("the landmark '{}' stands twice; names must be unique", excerpt(landmarks.back().name));
  }
  if (landmarks.empty()) reader.fail_here("no landmarks follow the header; each line is one");
  return landmarks;
}

void write_landmarks(const std::filesystem::path& csv, const Character& character,
                     const std::vector<Marker>& landmarks) {
  const auto positions = landmark_positions(character.skeleton, landmarks, character.rest_dofs);
  std::string text = std::string(kLandmarkHeader) + "\n";
  for (std::size_t m = 0; m < landmarks.size(); ++m) {
    text += fmt::format("{},{},{}", m, landmarks[m].name, character.skeleton.joints[landmarks[m].joint].name);
    for (int i = 0; i < 3; ++i) text += "," + rounded_millimetres(positions[m][i]);
    text += "\n";
  }
  write_atomically(csv, text);
}

std::vector<std::string> landmark_names(const std::vector<Marker>& landmarks) {
  std::vector<std::string> names;
  names.reserve(landmarks.size());
  for (const Marker& landmark : landmarks) names.push_back(landmark.name);
  return names;
}

std::vector<Marker> markers_named(const Skeleton& skeleton, const std::vector<std::string>& names) {
  std::vector<Marker> markers;
  for (const std::string& name : names) {
    const auto found = std::find_if(skeleton.markers.begin(), skeleton.markers.end(),
                                    [&](const Marker& marker) { return marker.name == name; });
    if (found == skeleton.markers.end()) fail("the skeleton has no marker {}", name);
    markers.push_back(*found);
  }
  return markers;
}

Character with_markers(Character character, const std::vector<Marker>& landmarks) {
  std::vector<Marker>& markers = character.skeleton.markers;
  for (const Marker& landmark : landmarks) {
    std::erase_if(markers, [&](const Marker& marker) { return marker.name == landmark.name; });
    markers.push_back(landmark);
  }
  return character;
}

std::vector<Eigen::Vector3d> landmark_positions(const Skeleton& skeleton, const std::vector<Marker>& landmarks,
                                                const std::vector<double>& dofs) {
  const auto world_from_joint = skeleton.pose(dofs);
  std::vector<Eigen::Vector3d> positions;
  for (const Marker& landmark : landmarks) {
    if (landmark.joint < 0 || landmark.joint >= skeleton.num_joints())
      fail("the landmark '{}' rides on joint {}; the skeleton has the joints 0 to {}", landmark.name, landmark.joint,
           skeleton.num_joints() - 1);
    positions.push_back(world_from_joint[landmark.joint] * landmark.position);
  }
  return positions;
}

std::vector<int> nearest_nodes(const Character& character, const std::vector<Marker>& landmarks) {
  if (character.num_nodes() == 0) fail("the character has no graph; landmarks need its nodes");
  std::vector<int> nodes;
  for (const Eigen::Vector3d& position : landmark_positions(character.skeleton, landmarks, character.rest_dofs)) {
    int nearest = 0;
    double smallest = HUGE_VAL;
    for (int k = 0; k < character.num_nodes(); ++k) {
      const double distance = (character.mesh.vertices[character.graph.node_vertex[k]] - position).squaredNorm();
      if (distance < smallest) {
        smallest = distance;
        nearest = k;
      }
    }
    nodes.push_back(nearest);
  }
  return nodes;
}

}  // namespace doppel
