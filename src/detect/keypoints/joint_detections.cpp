#include "doppel/detect/keypoints/joint_detections.h"

#include <climits>

#include "doppel/core/as_size.h"
#include "doppel/core/file_head.h"
#include "doppel/core/text_reader.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/landmark_key.h"

namespace doppel {

namespace {

constexpr char kHeader[] = "frame,index,name,x_mm,y_mm,z_mm";
constexpr double kMillimetre = 1e-3;
constexpr double kMaxDistance = 10.0;

bool is_same_point(std::string_view name, const std::string& point) {
  return name == point || landmark_key(std::string(name)) == landmark_key(point);
}

/// Whether every row has a point of the layout with its index and name.
bool fits_layout(const std::filesystem::path& csv, const PointLayout& layout) {
  TextReader reader(csv, "a table of joints in space", Separator::comma);
  reader.require_header(kHeader);
  while (reader.next_row(6)) {
    const auto index = as_size(reader.integer(1, "the point's index", 0, INT_MAX));
    if (index >= layout.points.size() || !is_same_point(reader.tokens()[2], layout.points[index])) return false;
  }
  return true;
}

/// The layout of a table: the given one if it fits, otherwise a built-in one that does, otherwise the given one, whose
/// misfit the reader of the rows reports.
const PointLayout& layout_of(const std::filesystem::path& csv, const PointLayout& given) {
  if (fits_layout(csv, given)) return given;
  for (const PointLayout& layout : builtin_layouts())
    if (fits_layout(csv, layout)) return layout;
  return given;
}

/// The index of the row's point in the layout.
std::size_t point_of(const TextReader& reader, const PointLayout& layout) {
  const auto index = as_size(reader.integer(1, "the point's index", 0, static_cast<long>(layout.points.size()) - 1));
  if (!is_same_point(reader.tokens()[2], layout.points[index]))
    reader.fail_here("point {} is called '{}', but in '{}' it is '{}'", index, reader.tokens()[2].substr(0, 60),
                     layout.name, layout.points[index]);
  return index;
}

/// For each point of a layout its index in another; -1: the other does not have the point.
std::vector<int> indices_in(const PointLayout& from, const PointLayout& to) {
  std::vector<int> indices;
  for (const std::string& point : from.points) indices.push_back(to.find(point).value_or(-1));
  return indices;
}

}  // namespace

bool is_joint_table(const std::filesystem::path& path) {
  const std::string_view header = kHeader;
  const std::string head = read_head(path, header.size() + 1);
  return head.starts_with(header) && (head.size() == header.size() || head.back() == '\n' || head.back() == '\r');
}

std::map<long, std::vector<JointDetection>> read_joint_detections(const std::filesystem::path& csv,
                                                                  const PointLayout& layout) {
  const PointLayout& own = layout_of(csv, layout);
  const std::vector<int> indices = indices_in(own, layout);
  const double noise = own.name.starts_with("mediapipe") ? kBlazePoseJointNoise : kJointNoise;
  TextReader reader(csv, "a table of joints in space", Separator::comma);
  reader.require_header(kHeader);
  std::map<long, std::vector<JointDetection>> frames;
  while (reader.next_row(6)) {
    const long frame = reader.integer(0, "the frame", 0, INT_MAX);
    std::vector<JointDetection>& joints = frames.try_emplace(frame, layout.points.size()).first->second;
    const int index = indices[point_of(reader, own)];
    if (index < 0) continue;
    if (joints[index].seen) reader.fail_here("the point '{}' of frame {} is given twice", layout.points[index], frame);
    const Eigen::Vector3d millimetres(reader.number(3, "x"), reader.number(4, "y"), reader.number(5, "z"));
    joints[index] = {kMillimetre * millimetres, true, noise};
    if (joints[index].position.norm() > kMaxDistance)
      reader.fail_here("the point '{}' is {:.4g} m from the body's root; millimetres relative to it are expected",
                       layout.points[index], joints[index].position.norm());
  }
  return frames;
}

}  // namespace doppel
