#include "doppel/detect/keypoints/keypoint_table.h"

#include <algorithm>
#include <numeric>
#include <optional>
#include <set>
#include <tuple>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/file_head.h"
#include "doppel/detect/keypoints/csv_reader.h"
#include "doppel/detect/keypoints/format.h"
#include "doppel/detect/keypoints/json_parts.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/table_columns.h"

namespace doppel {

namespace {

constexpr char kTableHeader[] = "frame,name,x,y,confidence";
constexpr char kTableOfCameras[] = "frame,camera,name,x,y,confidence";  ///< one table may hold several cameras
constexpr std::size_t kOthersInMessage = 20;

using Columns = TableColumns;

bool has_point(const Columns& columns) { return columns[kXColumn] >= 0 && columns[kYColumn] >= 0; }
bool has_name(const Columns& columns) { return columns[kNameColumn] >= 0 || columns[kNumberColumn] >= 0; }
bool has_time(const Columns& columns) { return columns[kFrameColumn] >= 0 || columns[kImageColumn] >= 0; }
/// Programs that write depths beside points of an image also write how sure they are.
bool is_in_space(const Columns& columns) { return columns[kZColumn] >= 0 && columns[kConfidenceColumn] < 0; }

/// Doppel's own tables have exactly these columns, and are written in pixels.
bool is_own(const std::vector<std::string>& header) {
  const std::string joined = fmt::format("{}", fmt::join(header, ","));
  return joined == kTableHeader || joined == kTableOfCameras;
}

/// Reads the rows of one camera: all rows of a table without a column for cameras.
class TableReader {
 public:
  TableReader(const KeypointFile& file, std::string camera)
      : reader_(file.path, "a table of keypoints"),
        camera_(std::move(camera)),
        columns_(columns_of_table(reader_.header())),
        own_(is_own(reader_.header())) {
    require_columns();
    while (reader_.next_row()) read_row();
    if (images_.empty() && columns_[kCameraColumn] < 0) reader_.fail_here("the table has no rows");
    if (images_.empty())
      reader_.fail_here("the table has no row of camera '{}'; it has rows of: {}", camera_, fmt::join(others_, ", "));
  }

  Detections take() {
    const std::vector<int> order = order_of_points();
    if (own_) result_.unit = PointUnit::pixels;
    for (auto& [image, people] : images_) {
      DetectedImage found{image.first < 0 ? std::nullopt : std::optional(image.first), image.second, {}};
      for (auto& [person, points] : people) {
        Person body(num_points_);
        for (std::size_t i = 0; i < points.size(); ++i) body[as_size(order[i])] = points[i];
        found.people.push_back({std::move(body), {}});
      }
      result_.images.push_back(std::move(found));
    }
    return std::move(result_);
  }

 private:
  void require_columns() const {
    std::vector<std::string> missing;
    if (!has_time(columns_)) missing.emplace_back("the frame (frame, frame_id, ...; or image)");
    if (!has_name(columns_)) missing.emplace_back("the point (name, joint, keypoint, bodypart, landmark, ...)");
    if (columns_[kXColumn] < 0) missing.emplace_back("x");
    if (columns_[kYColumn] < 0) missing.emplace_back("y");
    if (!missing.empty())
      reader_.fail_here("reading a table of keypoints: there is no column for {}; the first line names {}",
                        fmt::join(missing, " and "),
                        excerpt(fmt::format("{}", fmt::join(reader_.header(), ", ")), 300));
    if (is_in_space(columns_))
      reader_.fail_here(
          "reading a table of keypoints: with x, y, z and no confidence these are points in space; points in the image "
          "are needed. If z may be ignored, add a column `confidence`");
  }

  const std::string& cell(TableRole role) const { return reader_.cells()[as_size(columns_[role])]; }
  double number(TableRole role) const { return reader_.number(as_size(columns_[role])); }

  void read_row() {
    std::pair<long, std::string> image{-1, ""};
    if (columns_[kFrameColumn] >= 0)
      image.first = reader_.integer(as_size(columns_[kFrameColumn]), "the frame");
    else
      image.second = cell(kImageColumn);
    const double sure = columns_[kConfidenceColumn] < 0 ? 1.0 : number(kConfidenceColumn);
    if (own_ && (sure < 0.0 || sure > 1.0)) reader_.fail_here("the confidence is {}, allowed is 0 to 1", sure);
    const Keypoint point = keypoint_of(number(kXColumn), number(kYColumn), sure);
    if (columns_[kCameraColumn] >= 0 && cell(kCameraColumn) != camera_) {
      if (others_.size() < kOthersInMessage) others_.emplace(excerpt(cell(kCameraColumn)));
      return;
    }
    const std::string &name = cell(columns_[kNameColumn] >= 0 ? kNameColumn : kNumberColumn),
                      person = columns_[kPersonColumn] >= 0 ? cell(kPersonColumn) : "";
    const auto [entry, is_new] = indices_.emplace(name, indices_.size());
    if (is_new) names_.push_back(name);
    if (!given_.emplace(image, person, entry->second).second)
      reader_.fail_here("the point '{}' of frame {}{} is given twice{}", excerpt(name),
                        image.first < 0 ? excerpt(image.second) : std::to_string(image.first),
                        person.empty() ? "" : " of a person",
                        columns_[kPersonColumn] < 0 ? "; a table of several people needs a column `person`" : "");
    Person& points = images_[image][person];
    if (points.size() < names_.size()) points.resize(names_.size());
    points[entry->second] = point;
  }

  /// The position of each point: as named, or by its number from 0 or 1.
  std::vector<int> order_of_points() {
    std::vector<int> order;
    num_points_ = names_.size();
    for (const std::string& name : names_)
      if (const std::optional<int> number = number_of_point(name)) order.push_back(*number);
    if (!own_ && order.size() == names_.size() && !order.empty()) {
      const auto [least, most] = std::minmax_element(order.begin(), order.end());
      const int first = *least > 0 && has_layout_of(*most) ? 1 : 0;
      num_points_ = as_size(*most + 1 - first);
      for (int& number : order) number -= first;
      return order;
    }
    result_.points = names_;
    result_.by_name = true;
    order.resize(names_.size());
    std::iota(order.begin(), order.end(), 0);
    return order;
  }

  static std::optional<int> number_of_point(const std::string& name) {
    const bool digits = !name.empty() && name.size() < 4 && name.find_first_not_of("0123456789") == std::string::npos;
    return digits ? std::optional(std::stoi(name)) : std::nullopt;
  }

  static bool has_layout_of(int count) {
    const std::vector<PointLayout>& layouts = builtin_layouts();
    return std::any_of(layouts.begin(), layouts.end(),
                       [&](const PointLayout& layout) { return layout.points.size() == as_size(count); });
  }

  CsvReader reader_;
  std::string camera_;
  Columns columns_;
  bool own_;
  std::map<std::string, std::size_t> indices_;
  std::vector<std::string> names_;  ///< in the order of their first rows
  std::size_t num_points_ = 0;
  std::map<std::pair<long, std::string>, std::map<std::string, Person>> images_;
  std::set<std::tuple<std::pair<long, std::string>, std::string, std::size_t>> given_;
  std::set<std::string> others_;
  Detections result_;
};

/// Tables with one row per point. The columns go by their names, in any order. Points without a row are not seen.
class TableKeypoints : public KeypointFormat {
 public:
  std::string name() const override { return "table"; }
  bool recognises(const KeypointFile& file) const override {
    if (file.document) return false;
    const Columns columns = columns_of_table(csv_cells(csv_header(file.head)));
    return has_point(columns) && (has_name(columns) || has_time(columns));
  }
  Detections read(const KeypointFile& file, const KeypointCamera& camera) const override {
    return TableReader(file, camera.name).take();
  }
};

}  // namespace

std::unique_ptr<KeypointFormat> make_table_keypoints() { return std::make_unique<TableKeypoints>(); }

bool is_keypoint_table(const std::filesystem::path& path) {
  const std::string head = read_head(path, 4096);
  const Columns columns = columns_of_table(csv_cells(csv_header(head)));
  return has_point(columns) && has_name(columns) && has_time(columns) && !is_in_space(columns);
}

void write_keypoint_table(const std::filesystem::path& path, const PointLayout& layout,
                          const std::map<long, People>& frames) {
  const std::string header = std::string(kTableHeader) + "\n";
  std::string text = header;
  for (const auto& [frame, people] : frames) {
    for (std::size_t i = 0; !people.empty() && i < layout.points.size(); ++i) {
      const Keypoint& point = people[0].at(i);
      if (point.confidence > 0.0f)
        text += fmt::format("{},{},{:.3f},{:.3f},{:.4f}\n", frame, csv_cell(layout.points[i]), point.x, point.y,
                            point.confidence);
    }
  }
  if (text == header && !frames.empty())
    text += fmt::format("{},{},0,0,0\n", frames.begin()->first, csv_cell(layout.points.at(0)));
  write_atomically(path, text);
}

}  // namespace doppel
