#include <algorithm>
#include <climits>
#include <cmath>

#include "doppel/core/as_size.h"
#include "doppel/core/text_reader.h"
#include "doppel/detect/keypoints/csv_reader.h"
#include "doppel/detect/keypoints/format.h"
#include "doppel/detect/keypoints/json_parts.h"

namespace doppel {

namespace {

/// Where the numbers of one point of one individual stand in a row.
struct DeepLabCutPoint {
  std::size_t person = 0, point = 0;
  int x = -1, y = -1, likelihood = -1;
};

/// The index of a name in a list, to which it is added when it is new.
std::size_t index_in(std::vector<std::string>& names, const std::string& name) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) names.push_back(name);
  return as_size(std::find(names.begin(), names.end(), name) - names.begin());
}

class DeepLabCutReader {
 public:
  explicit DeepLabCutReader(const std::filesystem::path& path)
      : reader_(path, "a table of DeepLabCut"), columns_(reader_.header().size()) {
    read_header();
    while (reader_.next_row()) read_row();
    result_.points = points_;
    result_.by_name = true;
    result_.unit = PointUnit::pixels;
  }
  Detections take() { return std::move(result_); }

 private:
  using Row = std::vector<std::string>;

  /// The next row of the header, which begins with `title`.
  Row header_row(const char* title) {
    if (!reader_.next_line())
      reader_.fail_here("reading a table of DeepLabCut: the file ends where the row '{}' should stand", title);
    Row row = reader_.cells();
    if (row[0] != title || row.size() != columns_)
      reader_.fail_here("reading a table of DeepLabCut: expected the row '{}' with {} columns", title, columns_);
    return row;
  }

  void read_header() {
    // Newer files spread the path of an image over three columns.
    while (first_ < columns_ && reader_.header()[first_].empty()) ++first_;
    Row individuals;
    if (!reader_.next_line()) reader_.fail_here("reading a table of DeepLabCut: the file ends after its first line");
    Row bodyparts = reader_.cells();
    if (bodyparts[0] == "individuals") {
      individuals = bodyparts;
      bodyparts = header_row("bodyparts");
    }
    const Row coords = header_row("coords");
    if (bodyparts.size() != columns_ || (!individuals.empty() && individuals.size() != columns_))
      reader_.fail_here("reading a table of DeepLabCut: the rows of the header differ in length");
    for (std::size_t c = first_; c < columns_; ++c)
      add_column(individuals.empty() ? "" : individuals[c], bodyparts[c], coords[c], static_cast<int>(c));
    if (layout_.empty()) reader_.fail_here("reading a table of DeepLabCut: the header names no point");
    for (const DeepLabCutPoint& point : layout_)
      if (point.x < 0 || point.y < 0)
        reader_.fail_here("reading a table of DeepLabCut: the point '{}' lacks its x or y", points_[point.point]);
  }

  void add_column(const std::string& individual, const std::string& part, const std::string& coord, int column) {
    const std::size_t person = index_in(individuals_, individual), point = index_in(points_, part);
    const bool begins = layout_.empty() || layout_.back().person != person || layout_.back().point != point;
    if (begins) layout_.push_back({person, point});
    if (coord == "x") {
      layout_.back().x = column;
    } else if (coord == "y") {
      layout_.back().y = column;
    } else if (coord == "likelihood") {
      layout_.back().likelihood = column;
    } else {
      reader_.fail_here("reading a table of DeepLabCut: column {} is '{}'; x, y and likelihood are known", column + 1,
                        coord.substr(0, 40));
    }
  }

  double cell(int column) const { return reader_.number(as_size(column)); }

  void read_row() {
    DetectedImage image;
    const std::string& row_name = reader_.cells()[first_ - 1];
    const std::optional<double> number = parse_number(row_name);
    if (!number) {
      image.name = row_name;
    } else if (*number >= 0 && *number <= INT_MAX && *number == std::floor(*number)) {
      image.frame = static_cast<long>(*number);
    } else {
      reader_.fail_here("reading a table of DeepLabCut: the frame '{}' is no integer from 0", row_name.substr(0, 40));
    }
    image.people.resize(individuals_.size());
    for (DetectedPerson& person : image.people) person.body.resize(points_.size());
    for (const DeepLabCutPoint& point : layout_) {
      const double sure = point.likelihood < 0 ? 1.0 : cell(point.likelihood);
      image.people[point.person].body[point.point] = keypoint_of(cell(point.x), cell(point.y), sure);
    }
    result_.images.push_back(std::move(image));
  }

  CsvReader reader_;
  std::size_t columns_, first_ = 1;
  std::vector<std::string> individuals_, points_;
  std::vector<DeepLabCutPoint> layout_;
  Detections result_;
};

/// Whether the first of several cells is this word.
bool begins_with(std::string_view line, const char* word) {
  const std::vector<std::string> cells = csv_cells(line.substr(0, line.find('\r')));
  return cells.size() > 1 && cells[0] == word;
}

/// The CSV files of DeepLabCut, of labelled frames and of analysed videos: rows `scorer`, `bodyparts` and `coords`,
/// with several animals also `individuals`. The first column, or the first three together, is an image's path or a
/// frame number from 0. An empty cell is a point that is not labelled; labelled points without likelihood are sure. The
/// points have names and no order.
class DeepLabCutKeypoints : public KeypointFormat {
 public:
  std::string name() const override { return "deeplabcut"; }
  bool recognises(const KeypointFile& file) const override {
    if (file.document || !begins_with(csv_header(file.head), "scorer")) return false;
    bool bodyparts = false, coords = false;
    for (std::size_t begin = 0; begin < file.head.size();) {
      const std::size_t end = std::min(file.head.find('\n', begin), file.head.size());
      const std::string_view line = std::string_view(file.head).substr(begin, end - begin);
      bodyparts |= begins_with(line, "bodyparts");
      coords |= begins_with(line, "coords");
      begin = end + 1;
    }
    return bodyparts && coords;
  }
  Detections read(const KeypointFile& file, const KeypointCamera& /*camera*/) const override {
    return DeepLabCutReader(file.path).take();
  }
};

}  // namespace

std::unique_ptr<KeypointFormat> make_deeplabcut_keypoints() { return std::make_unique<DeepLabCutKeypoints>(); }

}  // namespace doppel
