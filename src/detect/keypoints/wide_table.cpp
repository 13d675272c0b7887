#include <algorithm>
#include <map>

#include "doppel/core/as_size.h"
#include "doppel/core/lower_case.h"
#include "doppel/detect/keypoints/csv_reader.h"
#include "doppel/detect/keypoints/format.h"
#include "doppel/detect/keypoints/json_parts.h"
#include "doppel/detect/keypoints/table_columns.h"

namespace doppel {

namespace {

constexpr std::size_t kMaxWideColumns = 10000;

/// A column like `L0_x`, `nose.y`, `x12` or `left_hip_visibility`.
struct WideColumn {
  std::string point;
  char part = 0;  ///< 'x', 'y', 'c' confidence, 'p' presence in the image; 0: something else
};

/// 0 for words that name no part of a point.
char part_of(const std::string& word) {
  if (word == "x" || word == "y") return word[0];
  for (const char* confidence : {"visibility", "vis", "confidence", "conf", "likelihood", "score", "probability",
                                 "prob", "certainty", "v", "c", "p", "s"})
    if (word == confidence) return 'c';
  return word == "presence" ? 'p' : 0;
}

WideColumn wide_column(std::string name) {
  name = lower_case(std::move(name));
  const std::size_t cut = name.find_last_of("_. ");
  if (cut != std::string::npos && part_of(name.substr(cut + 1)) != 0)
    return {name.substr(0, cut), part_of(name.substr(cut + 1))};
  const std::size_t digits = name.find_first_of("0123456789");
  if (digits == std::string::npos || name.find_first_not_of("0123456789", digits) != std::string::npos) return {};
  std::string word = name.substr(0, digits);
  while (!word.empty() && (word.back() == '_' || word.back() == '.' || word.back() == ' ')) word.pop_back();
  return {name.substr(digits), part_of(word)};
}

/// The number at the end of `l12`, `landmark_12` or `12`; nothing for other names.
std::optional<int> point_number(const std::string& name) {
  const std::size_t digits = name.find_first_of("0123456789");
  if (digits == std::string::npos || name.size() - digits > 4) return std::nullopt;
  if (name.find_first_not_of("0123456789", digits) != std::string::npos) return std::nullopt;
  return std::stoi(name.substr(digits));
}

/// The columns of one point.
struct WidePoint {
  int x = -1, y = -1, confidence = -1;
};

/// What the header says; no points: it is not the header of such a table.
struct WideHeader {
  TableColumns columns{};  ///< of frame, image and person
  std::vector<WidePoint> points;
  std::vector<std::string> names;  ///< empty: the points are numbered
};

/// Puts points that are numbered from 0 or 1 without gaps into their order. @return false: they are not numbered
bool order_by_number(const std::vector<std::string>& names, std::vector<WidePoint>& points) {
  std::map<int, WidePoint> numbered;
  for (std::size_t i = 0; i < names.size(); ++i)
    if (const std::optional<int> number = point_number(names[i])) numbered[*number] = points[i];
  if (numbered.size() != names.size() || numbered.empty()) return false;
  const int first = numbered.begin()->first, last = numbered.rbegin()->first;
  if (first > 1 || as_size(last - first + 1) != names.size()) return false;
  points.clear();
  for (const auto& [number, point] : numbered) points.push_back(point);
  return true;
}

/// Removes what has a confidence and no position, as the score of a person.
void drop_scores(WideHeader& header) {
  for (std::size_t i = header.points.size(); i-- > 0;)
    if (header.points[i].x < 0 && header.points[i].y < 0) {
      header.points.erase(header.points.begin() + static_cast<std::ptrdiff_t>(i));
      header.names.erase(header.names.begin() + static_cast<std::ptrdiff_t>(i));
    }
}

WideHeader read_wide_header(const std::vector<std::string>& columns) {
  WideHeader header;
  header.columns = columns_of_table(columns);
  std::map<std::string, std::size_t> indices;
  for (std::size_t c = 0; c < columns.size() && columns.size() <= kMaxWideColumns; ++c) {
    const WideColumn column = wide_column(columns[c]);
    if (column.part == 0 || column.point.empty()) continue;
    const auto [entry, is_new] = indices.emplace(column.point, header.points.size());
    if (is_new) {
      header.points.emplace_back();
      header.names.push_back(column.point);
    }
    WidePoint& point = header.points[entry->second];
    if (column.part == 'p' && point.confidence >= 0) continue;
    (column.part == 'x' ? point.x : column.part == 'y' ? point.y : point.confidence) = static_cast<int>(c);
  }
  drop_scores(header);
  const bool complete = std::all_of(header.points.begin(), header.points.end(),
                                    [](const WidePoint& point) { return point.x >= 0 && point.y >= 0; });
  if (!complete || header.points.size() < 2) return {};
  if (order_by_number(header.names, header.points)) header.names.clear();
  return header;
}

class WideReader {
 public:
  explicit WideReader(const std::filesystem::path& path)
      : reader_(path, "a table of keypoints"), header_(read_wide_header(reader_.header())) {
    if (header_.points.empty()) reader_.fail_here("reading keypoints: the header names no points with x and y");
    result_.points = header_.names;
    result_.by_name = !header_.names.empty();
    while (reader_.next_row()) read_row();
  }
  Detections take() { return std::move(result_); }

 private:
  void read_row() {
    const int frame = header_.columns[kFrameColumn], image = header_.columns[kImageColumn];
    std::pair<long, std::string> time{-1, ""};
    if (frame >= 0)
      time.first = reader_.integer(as_size(frame), "the frame");
    else if (image >= 0)
      time.second = reader_.cells()[as_size(image)];
    else
      time.first = static_cast<long>(result_.images.size());
    DetectedPerson person;
    for (const WidePoint& point : header_.points)
      person.body.push_back(
          keypoint_of(number(point.x), number(point.y), point.confidence < 0 ? 1.0 : number(point.confidence)));
    const auto [entry, is_new] = image_of_.emplace(time, result_.images.size());
    if (is_new)
      result_.images.push_back({time.first < 0 ? std::nullopt : std::optional(time.first), time.second, {}});
    else if (header_.columns[kPersonColumn] < 0)
      reader_.fail_here("frame {} is given twice; a table of several people needs a column `person`",
                        time.first < 0 ? time.second : std::to_string(time.first));
    result_.images[entry->second].people.push_back(std::move(person));
  }

  double number(int column) const { return reader_.number(as_size(column)); }

  CsvReader reader_;
  WideHeader header_;
  std::map<std::pair<long, std::string>, std::size_t> image_of_;
  Detections result_;
};

/// Tables with one row per frame and person, and columns x, y and perhaps a confidence for each point, as many programs
/// write the landmarks of MediaPipe: `L0_x, L0_y, L0_z, L0_visibility, ...`, `x0, y0, ...`, `nose_x, nose_y, ...`.
/// There is no standard of the header. Numbered points are in the order of the layout, from 0 or 1. A column `frame` or
/// `image` states the frame, otherwise rows count from 0; a column `person` tells several people of a frame apart.
/// MediaPipe's x and y are fractions of the image's size.
class WideKeypoints : public KeypointFormat {
 public:
  std::string name() const override { return "wide_csv"; }
  bool recognises(const KeypointFile& file) const override {
    if (file.document) return false;
    return !read_wide_header(csv_cells(csv_header(file.head))).points.empty();
  }
  Detections read(const KeypointFile& file, const KeypointCamera& /*camera*/) const override {
    return WideReader(file.path).take();
  }
};

}  // namespace

std::unique_ptr<KeypointFormat> make_wide_keypoints() { return std::make_unique<WideKeypoints>(); }

}  // namespace doppel
