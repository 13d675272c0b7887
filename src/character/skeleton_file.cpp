#include <cmath>
#include <functional>
#include <queue>
#include <unordered_map>

#include "doppel/character/file_text.h"
#include "doppel/character/skeleton.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace {

/// Names are searched from the first one on, which takes the square of this number.
constexpr std::size_t kMaxEntries = 10'000;
constexpr char kSkeletonHeader[] = "Skeletool Skeleton Definition V1.0";

/// Joints as the file lists them; `parent` may point forwards.
struct FileJoint {
  Joint joint;
  std::string parent;
  FileLocation where;
};

Eigen::Vector3d read_vector(const TextReader& reader, std::size_t first, const char* what) {
  return {reader.number(first, what), reader.number(first + 1, what), reader.number(first + 2, what)};
}

/// Millimetres in the file.
Eigen::Vector3d read_xyz(const TextReader& reader, std::size_t first, const char* what) {
  return {reader.length(first, what, kMetresPerMillimetre), reader.length(first + 1, what, kMetresPerMillimetre),
          reader.length(first + 2, what, kMetresPerMillimetre)};
}

void expect_tokens(const TextReader& reader, std::size_t count, const char* layout) {
  if (reader.tokens().size() != count)
    reader.fail_here("the line has {} columns, expected {}: {}", reader.tokens().size(), count, layout);
}

/// Reads `<title> <count>`; sections come in a fixed order.
std::size_t read_section(TextReader& reader, std::string_view title) {
  reader.require_line(fmt::format("the section '{} <count>'", title));
  std::string found(reader.tokens()[0]);
  std::size_t count_token = 1;
  if (title == "scaling joints:" && reader.tokens().size() > 1) {  // the only title of two words
    found += " " + std::string(reader.tokens()[1]);
    count_token = 2;
  }
  if (found != title) reader.fail_here("expected the section '{} <count>', found '{}'", title, excerpt(reader.line()));
  expect_tokens(reader, count_token + 1, "the section's title and its count");
  const std::size_t count = reader.count(count_token, "count");
  if (count > kMaxEntries)
    reader.fail_here("the section '{}' has {} entries, allowed are {}", title, count, kMaxEntries);
  return count;
}

Joint::Type read_type(const TextReader& reader) {
  const std::string_view word = reader.tokens()[1];
  if (word == "revolute") return Joint::Type::revolute;
  if (word == "prismatic") return Joint::Type::prismatic;
  reader.fail_here("joint type '{}' is not known; V1.0 files have revolute and prismatic", excerpt(word));
}

Eigen::Vector3d read_axis(const TextReader& reader, Joint::Type type) {
  if (type == Joint::Type::prismatic) return read_xyz(reader, 6, "axis");
  const Eigen::Vector3d axis = read_vector(reader, 6, "axis");
  const double length = axis.norm();
  if (!(length > 1e-9) || !std::isfinite(length)) reader.fail_here("the axis of a revolute joint has no direction");
  // A unit axis keeps its last digit, so that writing and reading do not change it.
  return std::abs(length - 1.0) < 1e-14 ? axis : Eigen::Vector3d(axis / length);
}

FileJoint read_joint(const TextReader& reader) {
  expect_tokens(reader, 10, "name, type, parent, offset x y z, axis x y z, scale");
  FileJoint entry;
  entry.where = reader.where();
  entry.parent = reader.tokens()[2];
  entry.joint.name = reader.tokens()[0];
  entry.joint.type = read_type(reader);
  entry.joint.axis = read_axis(reader, entry.joint.type);
  const double scale = reader.number(9, "scale");
  const Eigen::Vector3d offset = read_vector(reader, 3, "offset");
  entry.joint.offset = (scale == 1.0 ? offset : Eigen::Vector3d(scale * offset)) * kMetresPerMillimetre;
  if (!(entry.joint.offset.cwiseAbs().maxCoeff() <= kMaxMetres))
    reader.fail_here("the offset of the joint '{}' times its scale exceeds {:g} m", excerpt(entry.joint.name),
                     kMaxMetres);
  return entry;
}

std::vector<FileJoint> read_joints(TextReader& reader) {
  const std::size_t count = read_section(reader, "joints:");
  if (count == 0) reader.fail_here("the skeleton has no joints; at least the root is needed");
  std::vector<FileJoint> entries;
  std::unordered_map<std::string, int> seen;
  for (std::size_t j = 0; j < count; ++j) {
    reader.require_line(fmt::format("joint {} of {}", j + 1, count));
    entries.push_back(read_joint(reader));
    if (!seen.emplace(entries.back().joint.name, 0).second)
      reader.fail_here("the joint '{}' is defined twice; names must be unique", excerpt(entries.back().joint.name));
  }
  return entries;
}

/// The index of each joint's parent in the file, -1 for the root.
std::vector<int> find_parents(const std::vector<FileJoint>& entries) {
  std::unordered_map<std::string, int> row_of;
  for (std::size_t j = 0; j < entries.size(); ++j) row_of.emplace(entries[j].joint.name, static_cast<int>(j));
  std::vector<int> parents(entries.size(), -1);
  int root = -1;
  for (std::size_t j = 0; j < entries.size(); ++j) {
    const FileJoint& entry = entries[j];
    if (entry.parent == "none") {
      if (root >= 0)
        fail_at(entry.where, "'{}' is a second root beside '{}'; a skeleton has one joint whose parent is 'none'",
                excerpt(entry.joint.name), excerpt(entries[root].joint.name));
      root = static_cast<int>(j);
      continue;
    }
    const auto found = row_of.find(entry.parent);
    if (found == row_of.end())
      fail_at(entry.where, "the parent '{}' of joint '{}' is not a joint of this file; the root's parent is 'none'",
              excerpt(entry.parent), excerpt(entry.joint.name));
    parents[j] = found->second;
  }
  return parents;
}

/// The joints of the file, reordered so that parents come first, otherwise in the order of the file.
std::vector<int> parents_first(const std::vector<FileJoint>& entries, const std::vector<int>& parents) {
  std::vector<std::vector<int>> children(entries.size());
  std::priority_queue<int, std::vector<int>, std::greater<int>> ready;
  for (std::size_t j = 0; j < entries.size(); ++j) {
    if (parents[j] < 0)
      ready.push(static_cast<int>(j));
    else
      children[parents[j]].push_back(static_cast<int>(j));
  }
  std::vector<int> order;
  std::vector<bool> placed(entries.size(), false);
  while (!ready.empty()) {
    order.push_back(ready.top());
    ready.pop();
    placed[order.back()] = true;
    for (const int child : children[order.back()]) ready.push(child);
  }
  for (std::size_t j = 0; j < entries.size(); ++j)
    if (!placed[j])
      fail_at(entries[j].where, "the parents of the joint '{}' form a circle that never reaches the root",
              excerpt(entries[j].joint.name));
  return order;
}

void order_joints(Skeleton& skeleton, const std::vector<FileJoint>& entries) {
  const std::vector<int> parents = find_parents(entries);
  const std::vector<int> order = parents_first(entries, parents);
  std::vector<int> index(entries.size());
  bool moved = false;
  for (std::size_t i = 0; i < order.size(); ++i) {
    index[order[i]] = static_cast<int>(i);
    moved = moved || order[i] != static_cast<int>(i);
  }
  for (const int row : order) {
    skeleton.joints.push_back(entries[row].joint);
    skeleton.joints.back().parent = parents[row] < 0 ? -1 : index[parents[row]];
  }
  if (moved) skeleton.file_order = index;
}

/// The joint of that name, or the first joint of the file whose name begins with it, as in the original reader.
int find_joint_of(const TextReader& reader, const Skeleton& skeleton, std::string_view name) {
  if (const auto exact = skeleton.find_joint(std::string(name))) return *exact;
  for (int row = 0; row < skeleton.num_joints(); ++row) {
    const int joint = skeleton.file_order.empty() ? row : skeleton.file_order[row];
    if (skeleton.joints[joint].name.compare(0, name.size(), name) == 0) return joint;
  }
  reader.fail_here("no joint is named '{}', and no joint's name begins with it", excerpt(name));
}

Marker read_marker(const TextReader& reader, const Skeleton& skeleton) {
  const std::size_t columns = reader.tokens().size();
  if (columns >= 3 && reader.tokens()[2] == "oriented")
    reader.fail_here("oriented markers are not supported; no published file has them. Change it to a 'point' marker");
  if (columns >= 3 && reader.tokens()[2] != "point")
    reader.fail_here("marker type '{}' is not known, expected 'point'", excerpt(reader.tokens()[2]));
  if (columns != 6 && columns != 7 && columns != 10)
    reader.fail_here("a marker has 6, 7 or 10 columns (name, joint, point, x y z, size, r g b), this one has {}",
                     columns);
  Marker marker;
  marker.name = reader.tokens()[0];
  marker.joint = find_joint_of(reader, skeleton, reader.tokens()[1]);
  marker.position = read_xyz(reader, 3, "position");
  if (columns > 6) marker.size = reader.length(6, "size", kMetresPerMillimetre);
  for (std::size_t i = 7; i < columns; ++i) reader.number(i, "colour");
  return marker;
}

std::optional<std::array<double, 2>> read_limits(TextReader& reader, const std::string& dof) {
  reader.require_line(fmt::format("'nolimits' or 'limits <min> <max>' of the DoF '{}'", excerpt(dof)));
  if (reader.tokens()[0] == "nolimits") {
    expect_tokens(reader, 1, "nolimits");
    return std::nullopt;
  }
  if (reader.tokens()[0] != "limits")
    reader.fail_here("expected 'nolimits' or 'limits <min> <max>' of the DoF '{}', found '{}'", excerpt(dof),
                     excerpt(reader.line()));
  expect_tokens(reader, 3, "limits <min> <max>");
  const std::array<double, 2> limits{reader.number(1, "lower limit"), reader.number(2, "upper limit")};
  if (limits[0] > limits[1])
    reader.fail_here("the lower limit {} of the DoF '{}' is above the upper one, {}", limits[0], excerpt(dof),
                     limits[1]);
  return limits;
}

/// @param drives counts the driven joints of all DoFs
Dof read_dof(TextReader& reader, const Skeleton& skeleton, std::size_t& drives) {
  expect_tokens(reader, 2, "a DoF's name and the number of joints it drives");
  Dof dof;
  dof.name = reader.tokens()[0];
  const std::size_t count = reader.count(1, "number of joints");
  dof.limits = read_limits(reader, dof.name);
  for (std::size_t i = 0; i < count; ++i) {
    reader.require_line(fmt::format("joint {} of {} that the DoF '{}' drives", i + 1, count, excerpt(dof.name)));
    expect_tokens(reader, 2, "a joint and its weight");
    if (++drives > kMaxEntries) reader.fail_here("the DoFs drive more than {} joints", kMaxEntries);
    dof.joints.push_back({find_joint_of(reader, skeleton, reader.tokens()[0]), reader.number(1, "weight")});
  }
  return dof;
}

void read_markers(TextReader& reader, Skeleton& skeleton) {
  const std::size_t count = read_section(reader, "markers:");
  for (std::size_t m = 0; m < count; ++m) {
    reader.require_line(fmt::format("marker {} of {}", m + 1, count));
    skeleton.markers.push_back(read_marker(reader, skeleton));
  }
}

/// Bone symmetry, which Doppel does not use. Only the syntax is checked.
void skip_scaling_joints(TextReader& reader) {
  const std::size_t count = read_section(reader, "scaling joints:");
  for (std::size_t s = 0; s < count; ++s) {
    reader.require_line(fmt::format("scaling joint {} of {}", s + 1, count));
    expect_tokens(reader, 2, "a name and a number of joints");
    const std::size_t joints = reader.count(1, "number of joints");
    for (std::size_t j = 0; j < joints; ++j) reader.require_line("a scaling joint's member");
  }
}

void read_dofs(TextReader& reader, Skeleton& skeleton) {
  const std::size_t count = read_section(reader, "dofs:");
  std::size_t drives = 0;
  for (std::size_t d = 0; d < count; ++d) {
    reader.require_line(fmt::format("DoF {} of {}", d + 1, count));
    Dof dof = read_dof(reader, skeleton, drives);
    if (skeleton.find_dof(dof.name))
      reader.fail_here("the DoF '{}' is defined twice; names must be unique", excerpt(dof.name));
    skeleton.dofs.push_back(std::move(dof));
  }
}

void skip_texture_entries(TextReader& reader) {
  const std::size_t count = read_section(reader, "textureEntries:");
  for (std::size_t t = 0; t < count; ++t) reader.require_line(fmt::format("texture entry {} of {}", t + 1, count));
  if (reader.next_line()) reader.fail_here("unexpected line after the last section: '{}'", excerpt(reader.line()));
}

std::string vector_text(const Eigen::Vector3d& v, bool millimetres) {
  std::string text;
  for (int i = 0; i < 3; ++i) text += " " + (millimetres ? millimetre_text(v[i]) : exact_text(v[i]));
  return text;
}

std::string joints_text(const Skeleton& skeleton) {
  std::string text = fmt::format("joints: {}\n", skeleton.num_joints());
  for (int row = 0; row < skeleton.num_joints(); ++row) {
    const Joint& joint = skeleton.joints[skeleton.file_order.empty() ? row : skeleton.file_order[row]];
    const bool prismatic = joint.type == Joint::Type::prismatic;
    text += fmt::format("  {} {} {}{}{} 1.0\n", joint.name, prismatic ? "prismatic" : "revolute",
                        joint.parent < 0 ? "none" : skeleton.joints[joint.parent].name, vector_text(joint.offset, true),
                        vector_text(joint.axis, prismatic));
  }
  return text;
}

std::string markers_text(const Skeleton& skeleton) {
  std::string text = fmt::format("markers: {}\n", skeleton.markers.size());
  for (const Marker& marker : skeleton.markers)
    text += fmt::format("  {} {} point{} {}\n", marker.name, skeleton.joints[marker.joint].name,
                        vector_text(marker_to_file(skeleton, marker, skeleton.marker_reading), true),
                        millimetre_text(marker.size));
  return text;
}

std::string dofs_text(const Skeleton& skeleton) {
  std::string text = fmt::format("dofs: {}\n", skeleton.num_dofs());
  for (const Dof& dof : skeleton.dofs) {
    text += fmt::format("  {} {}\n", dof.name, dof.joints.size());
    text += dof.limits ? fmt::format("      limits {} {}\n", exact_text((*dof.limits)[0]), exact_text((*dof.limits)[1]))
                       : "      nolimits\n";
    for (const Dof::Drive& drive : dof.joints)
      text += fmt::format("      {} {}\n", skeleton.joints[drive.joint].name, exact_text(drive.weight));
  }
  return text;
}

}  // namespace

Skeleton read_skeleton(const std::filesystem::path& path, MarkerReading reading) {
  TextReader reader(path, "a skeleton file");
  require_version(reader, kSkeletonHeader, "skeleton", "keleton");
  Skeleton skeleton;
  order_joints(skeleton, read_joints(reader));
  read_markers(reader, skeleton);
  skip_scaling_joints(reader);
  read_dofs(reader, skeleton);
  skip_texture_entries(reader);
  reread_markers(skeleton, reading);
  return skeleton;
}

void write_skeleton(const std::filesystem::path& path, const Skeleton& skeleton) {
  write_atomically(path, std::string(kSkeletonHeader) + "\n" + joints_text(skeleton) + markers_text(skeleton) +
                             "scaling joints: 0\n" + dofs_text(skeleton) + "textureEntries: 0\n");
}

}  // namespace doppel
