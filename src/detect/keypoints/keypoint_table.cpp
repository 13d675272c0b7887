#include "doppel/detect/keypoints/keypoint_table.h"

#include <climits>
#include <cmath>
#include <set>

#include "doppel/core/atomic_file.h"
#include "doppel/core/file_head.h"
#include "doppel/core/text_reader.h"
#include "doppel/detect/keypoints/format.h"
#include "doppel/detect/keypoints/json_parts.h"

namespace doppel {

namespace {

constexpr char kTableHeader[] = "frame,name,x,y,confidence";
constexpr char kTableOfCameras[] = "frame,camera,name,x,y,confidence";  ///< one table may hold several cameras
constexpr double kMaxTableCoordinate = 1e7;
constexpr std::size_t kOthersInMessage = 20;

/// The first line without blanks and byte order mark.
std::string table_header(const std::string& text) {
  std::string line = text.substr(0, text.find_first_of("\r\n"));
  if (line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);
  std::erase(line, ' ');
  return line;
}
bool has_table_header(const std::string& text) {
  const std::string header = table_header(text);
  return header == kTableHeader || header == kTableOfCameras;
}

/// Reads the rows of one camera: all rows of a table without a column `camera`.
class TableReader {
 public:
  TableReader(const KeypointFile& file, std::string camera)
      : reader_(file.path, "a table of keypoints", Separator::comma),
        camera_(std::move(camera)),
        name_column_(table_header(file.head) == kTableOfCameras ? 2 : 1) {
    reader_.require_header(name_column_ == 2 ? kTableOfCameras : kTableHeader);
    while (reader_.next_row(name_column_ + 4)) read_row();
    if (images_.empty() && name_column_ == 1) reader_.fail_here("the table has no rows");
    if (images_.empty())
      reader_.fail_here("the table has no row of camera '{}'; it has rows of: {}", camera_, fmt::join(others_, ", "));
  }

  Detections take() {
    result_.by_name = true;
    result_.unit = PointUnit::pixels;
    for (auto& [frame, points] : images_) {
      points.resize(result_.points.size());
      result_.images.push_back({frame, "", {{std::move(points), {}}}});
    }
    return std::move(result_);
  }

 private:
  void read_row() {
    const long frame = reader_.integer(0, "the frame", 0, INT_MAX);
    const double x = reader_.number(name_column_ + 1, "x"), y = reader_.number(name_column_ + 2, "y");
    const double sure = reader_.number(name_column_ + 3, "the confidence");
    if (sure < 0.0 || sure > 1.0) reader_.fail_here("the confidence is {}, allowed is 0 to 1", sure);
    if (std::abs(x) > kMaxTableCoordinate || std::abs(y) > kMaxTableCoordinate)
      reader_.fail_here("({}, {}) lies in no image", x, y);
    if (name_column_ == 2 && reader_.tokens()[1] != camera_) {
      if (others_.size() < kOthersInMessage) others_.emplace(reader_.tokens()[1].substr(0, 60));
      return;
    }
    const auto [entry, is_new] =
        indices_.emplace(std::string(reader_.tokens()[name_column_]), static_cast<int>(result_.points.size()));
    if (is_new) result_.points.push_back(entry->first);
    if (!given_.emplace(frame, entry->second).second)
      reader_.fail_here("the point '{}' of frame {} is given twice", entry->first, frame);
    Person& points = images_[frame];
    if (points.size() < result_.points.size()) points.resize(result_.points.size());
    points[entry->second] = keypoint_of(x, y, sure);
  }

  TextReader reader_;
  std::string camera_;
  std::size_t name_column_;
  std::map<std::string, int> indices_;
  std::map<long, Person> images_;
  std::set<std::pair<long, int>> given_;
  std::set<std::string> others_;
  Detections result_;
};

/// Doppel's own table: one row per point, one person per frame, pixels. Points without a row are not seen.
class TableKeypoints : public KeypointFormat {
 public:
  std::string name() const override { return "table"; }
  bool recognises(const KeypointFile& file) const override { return has_table_header(file.head); }
  Detections read(const KeypointFile& file, const KeypointCamera& camera) const override {
    return TableReader(file, camera.name).take();
  }
};

}  // namespace

std::unique_ptr<KeypointFormat> make_table_keypoints() { return std::make_unique<TableKeypoints>(); }

bool is_keypoint_table(const std::filesystem::path& path) {
  const std::string head = read_head(path, 4096);
  return has_table_header(head.substr(0, head.find('\n')));
}

void write_keypoint_table(const std::filesystem::path& path, const PointLayout& layout,
                          const std::map<long, People>& frames) {
  const std::string header = std::string(kTableHeader) + "\n";
  std::string text = header;
  for (const auto& [frame, people] : frames) {
    for (std::size_t i = 0; !people.empty() && i < layout.points.size(); ++i) {
      const Keypoint& point = people[0].at(i);
      if (point.confidence > 0.0f)
        text +=
            fmt::format("{},{},{:.3f},{:.3f},{:.4f}\n", frame, layout.points[i], point.x, point.y, point.confidence);
    }
  }
  if (text == header && !frames.empty())
    text += fmt::format("{},{},0,0,0\n", frames.begin()->first, layout.points.at(0));
  write_atomically(path, text);
}

}  // namespace doppel
