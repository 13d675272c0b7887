#include "doppel/detect/keypoints/read_space_points.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <nlohmann/json.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/file_head.h"
#include "doppel/core/text_reader.h"
#include "doppel/detect/keypoints/c3d_file.h"
#include "doppel/detect/keypoints/json_parts.h"

namespace doppel {

namespace {

using nlohmann::json;
using Row = std::vector<std::string>;

constexpr std::uintmax_t kMaxBytesOfPoints = std::uintmax_t{1} << 30;
constexpr std::size_t kMaxSpacePoints = 10000;

Row split_at(std::string_view line, char separator) {
  Row cells(1);
  for (const char c : line) {
    if (c == separator)
      cells.emplace_back();
    else if (c != '\r')
      cells.back() += c;
  }
  for (std::string& cell : cells) {
    cell.erase(0, cell.find_first_not_of(' '));
    cell.erase(cell.find_last_not_of(' ') + 1);
  }
  return cells;
}

/// The lines of a text file; tabs at their ends have a meaning.
class Lines {
 public:
  Lines(const std::filesystem::path& path, char separator)
      : where_{path.string(), 0}, separator_(separator), text_(read_file(path, kMaxBytesOfPoints)) {
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;
  }
  /// The cells of the next line; false at the end.
  bool next(Row& cells) {
    if (at_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    cells = split_at(std::string_view(text_).substr(at_, end - at_), separator_);
    at_ = end + 1;
    ++where_.line;
    return true;
  }
  Row require(const char* what) {
    Row cells;
    if (!next(cells)) fail_at(where_, "reading points in space: the file ends where {} should stand", what);
    return cells;
  }
  const FileLocation& where() const { return where_; }

 private:
  FileLocation where_;
  char separator_;
  std::string text_;
  std::size_t at_ = 0;
};

long frame_of_cell(const std::string& cell, const FileLocation& where) {
  const std::optional<double> number = parse_number(cell);
  if (!number || !(*number >= 0 && *number <= INT_MAX) || *number != std::floor(*number))
    fail_at(where, "reading points in space: the frame '{}' is no integer from 0", cell.substr(0, 40));
  return static_cast<long>(*number);
}

/// Nothing when one of the three cells is empty or NaN.
std::optional<Eigen::Vector3d> point_of_cells(const std::string* cells, double metres, const FileLocation& where) {
  Eigen::Vector3d point;
  for (int i = 0; i < 3; ++i) {
    const std::optional<double> number = cells[i].empty() ? std::nan("") : parse_number(cells[i]);
    if (!number)
      fail_at(where, "reading points in space: found '{}' where a number is expected", cells[i].substr(0, 40));
    point[i] = metres * *number;
  }
  if (point.hasNaN()) return std::nullopt;
  require_near(point, where);
  return point;
}

std::string beginning_of(const std::filesystem::path& path) {
  if (!std::filesystem::is_regular_file(path))
    fail_at({path.string(), 0}, "reading points in space: there is no such file");
  return read_head(path, 4096);
}

// ---- TRC ----

class TrcReader {
 public:
  TrcReader(const std::filesystem::path& path, std::optional<double> metres_per_unit) : lines_(path, '\t') {
    lines_.require("the line 'PathFileType'");
    read_settings(metres_per_unit);
    read_names();
    lines_.require("the line 'X1 Y1 Z1'");
    for (Row cells; lines_.next(cells);) read_row(cells);
    if (points_.frames.empty()) fail_at(lines_.where(), "reading points in space: the file has no frames");
  }
  SpacePoints take() { return std::move(points_); }

 private:
  void read_settings(std::optional<double> metres_per_unit) {
    const Row keys = lines_.require("the line 'DataRate'"), values = lines_.require("the values of 'DataRate'");
    points_.format = "trc";
    for (std::size_t i = 0; i < std::min(keys.size(), values.size()); ++i) {
      if (keys[i] == "Units") points_.unit = values[i];
      if (keys[i] == "DataRate") points_.rate = parse_number(values[i]).value_or(0.0);
    }
    if (!(points_.rate >= 0.0 && points_.rate < 1e6))
      fail_at(lines_.where(), "reading points in space: the rate of {} frames per second is impossible", points_.rate);
    metres_ = metres_per_unit ? *metres_per_unit : metres_of_unit(points_.unit, lines_.where());
    if (points_.unit == "meters") points_.unit = "m";
  }

  /// A name stands above its x; the two cells after it are empty.
  void read_names() {
    const Row cells = lines_.require("the line 'Frame#'");
    if (cells[0] != "Frame#")
      fail_at(lines_.where(), "reading points in space: the line of names must begin with 'Frame#'");
    for (std::size_t i = 2; i < cells.size(); i += 3) {
      if (cells[i].empty()) break;
      if (std::find(points_.names.begin(), points_.names.end(), cells[i]) != points_.names.end())
        fail_at(lines_.where(), "reading points in space: the point '{}' is given twice", cells[i].substr(0, 60));
      points_.names.push_back(cells[i]);
    }
    if (points_.names.empty() || points_.names.size() > kMaxSpacePoints)
      fail_at(lines_.where(), "reading points in space: found {} names of points, expected 1 to {}",
              points_.names.size(), kMaxSpacePoints);
  }

  void read_row(Row& cells) {
    if (std::all_of(cells.begin(), cells.end(), [](const std::string& cell) { return cell.empty(); })) return;
    const std::size_t columns = 2 + 3 * points_.names.size();
    const bool surplus = cells.size() > columns && std::any_of(cells.begin() + static_cast<std::ptrdiff_t>(columns),
                                                               cells.end(), [](const auto& c) { return !c.empty(); });
    if (surplus || cells.size() < 3)
      fail_at(lines_.where(), "reading points in space: the line has {} columns, the names are for {}", cells.size(),
              columns);
    cells.resize(columns);  // some writers leave out empty cells at the end
    auto [frame, is_new] = points_.frames.try_emplace(frame_of_cell(cells[0], lines_.where()));
    if (!is_new) fail_at(lines_.where(), "reading points in space: the frame {} is given twice", frame->first);
    for (std::size_t i = 0; i < points_.names.size(); ++i)
      frame->second.push_back(point_of_cells(&cells[2 + 3 * i], metres_, lines_.where()));
  }

  Lines lines_;
  double metres_ = 1.0;
  SpacePoints points_;
};

// ---- Caliscope ----

class CaliscopePointReader {
 public:
  explicit CaliscopePointReader(const std::filesystem::path& path) : lines_(path, ',') {
    const Row header = lines_.require("the header");
    frame_ = column(header, {"sync_index"});
    id_ = column(header, {"point_id", "keypoint_id"});
    x_ = column(header, {"x_coord"});
    if (column(header, {"y_coord"}) != x_ + 1 || column(header, {"z_coord"}) != x_ + 2)
      fail_at(lines_.where(), "reading points in space: y_coord and z_coord must follow x_coord");
    for (Row cells; lines_.next(cells);)
      if (cells.size() > 1) read_row(cells, header.size());
    if (rows_.empty()) fail_at(lines_.where(), "reading points in space: the table has no rows");
  }

  SpacePoints take() const {
    SpacePoints points;
    points.format = "caliscope";
    points.unit = "m";
    std::map<long, std::size_t> indices;
    for (const auto& [frame, row] : rows_)
      for (const auto& [id, point] : row) indices.emplace(id, 0);
    for (auto& [id, index] : indices) {
      index = points.names.size();
      points.names.push_back(std::to_string(id));
    }
    for (const auto& [frame, row] : rows_) {
      auto& found = points.frames[frame];
      found.resize(points.names.size());
      for (const auto& [id, point] : row) found[indices.at(id)] = point;
    }
    return points;
  }

 private:
  std::size_t column(const Row& header, std::initializer_list<const char*> names) const {
    for (const char* name : names)
      if (const auto found = std::find(header.begin(), header.end(), name); found != header.end())
        return as_size(found - header.begin());
    fail_at(lines_.where(), "reading points in space: the header has no column '{}'", *names.begin());
  }

  void read_row(const Row& cells, std::size_t columns) {
    if (cells.size() != columns)
      fail_at(lines_.where(), "reading points in space: the line has {} columns, the table has {}", cells.size(),
              columns);
    const long id = frame_of_cell(cells[id_], lines_.where());
    if (ids_.insert({id, 0}).second && ids_.size() > kMaxSpacePoints)
      fail_at(lines_.where(), "reading points in space: the table has more than {} points", kMaxSpacePoints);
    const auto point = point_of_cells(&cells[x_], 1.0, lines_.where());
    const bool is_new = rows_[frame_of_cell(cells[frame_], lines_.where())].emplace(id, point).second;
    if (!is_new) fail_at(lines_.where(), "reading points in space: the point {} is given twice in its frame", id);
  }

  Lines lines_;
  std::size_t frame_ = 0, id_ = 0, x_ = 0;
  std::map<long, int> ids_;
  std::map<long, std::map<long, std::optional<Eigen::Vector3d>>> rows_;
};

// ---- MMPose's 3D lifter ----

/// The first person's points of an image: an instance, or a list of instances.
std::vector<std::optional<Eigen::Vector3d>> lifted_person(const json& node, const FileLocation& where) {
  std::vector<std::optional<Eigen::Vector3d>> points;
  if (node.is_array() && node.empty()) return points;
  const json* list = find_key(node.is_array() ? node[0] : node, {"keypoints"});
  if (!list || !list->is_array()) fail_at(where, "reading points in space: an instance has no `keypoints`");
  for (const json& point : *list) {
    if (!point.is_array() || point.size() != 3)
      fail_at(where, "reading points in space: the keypoints must have three coordinates each");
    std::string cells[3];
    for (int i = 0; i < 3; ++i) cells[i] = point[i].dump(-1, ' ', false, json::error_handler_t::replace);
    points.push_back(point_of_cells(cells, 1.0, where));
  }
  return points;
}

SpacePoints read_lifted(const std::filesystem::path& path) {
  const FileLocation where{path.string(), 0};
  const auto document = parse_keypoint_json(path);
  SpacePoints points;
  points.format = "mmpose";
  points.unit = "m";
  const bool of_frames = document->is_array() && !document->empty() && find_key((*document)[0], {"frame_id"});
  if (of_frames) {
    for (const json& image : *document) {
      const std::optional<long> frame = json_frame(find_key(image, {"frame_id"}));
      const json* instances = find_key(image, {"instances"});
      if (!frame || !instances) fail_at(where, "reading points in space: an entry lacks `frame_id` or `instances`");
      points.frames[*frame] = lifted_person(*instances, where);
    }
  } else {
    points.frames[0] = lifted_person(*document, where);
  }
  std::size_t count = 0;
  for (const auto& [frame, found] : points.frames) count = std::max(count, found.size());
  if (count == 0) fail_at(where, "reading points in space: nobody is in the file");
  for (std::size_t i = 0; i < count; ++i) points.names.push_back(std::to_string(i));
  for (auto& [frame, found] : points.frames) found.resize(count);
  return points;
}

}  // namespace

SpacePoints read_space_points(const std::filesystem::path& path, std::optional<double> metres_per_unit) {
  const std::string head = beginning_of(path);
  if (is_c3d(head)) return parse_c3d(read_file(path, kMaxBytesOfPoints), {path.string()}, metres_per_unit);
  const std::string line = head.substr(0, head.find('\n'));
  if (line.find("PathFileType") != std::string::npos) return TrcReader(path, metres_per_unit).take();
  if (line.find("sync_index") != std::string::npos) return CaliscopePointReader(path).take();
  const std::size_t begin = head.find_first_not_of(" \t\r\n");
  if (begin != std::string::npos && (head[begin] == '[' || head[begin] == '{')) return read_lifted(path);
  fail_at({path.string(), 0},
          "reading points in space: this is no C3D file, no TRC file, no table of Caliscope (sync_index, point_id, "
          "x_coord, ...) and "
          "no JSON of MMPose's 3D lifter");
}

}  // namespace doppel
