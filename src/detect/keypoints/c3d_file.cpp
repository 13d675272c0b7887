#include "doppel/detect/keypoints/c3d_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <set>

#include "doppel/core/as_size.h"

namespace doppel {

namespace {

constexpr std::size_t kC3dBlock = 512;
constexpr unsigned char kC3dMark = 0x50;
constexpr std::size_t kMaxC3dPoints = 10000;
constexpr double kMaxC3dFrames = 1e9;

/// The numbers of a C3D file, in the byte order of the machine that wrote it.
class C3dBytes {
 public:
  enum Machine { kIntel = 84, kDec = 85, kMips = 86 };

  C3dBytes(std::string_view bytes, const FileLocation& where) : bytes_(bytes), where_(where) {}

  void set_machine(int machine) {
    if (machine < kIntel || machine > kMips)
      fail_at(where_, "reading a C3D file: the machine has the number {}; 84 (Intel), 85 (DEC) and 86 (MIPS) are known",
              machine);
    machine_ = machine;
  }
  std::size_t size() const { return bytes_.size(); }
  const FileLocation& where() const { return where_; }

  int byte(std::size_t at) const {
    require(at, 1);
    return static_cast<unsigned char>(bytes_[at]);
  }
  int signed_byte(std::size_t at) const { return static_cast<std::int8_t>(byte(at)); }
  int word(std::size_t at) const {
    return machine_ == kMips ? byte(at) << 8 | byte(at + 1) : byte(at + 1) << 8 | byte(at);
  }
  int integer(std::size_t at) const { return static_cast<std::int16_t>(word(at)); }
  double real(std::size_t at) const {
    const auto first = static_cast<std::uint32_t>(word(at)), second = static_cast<std::uint32_t>(word(at + 2));
    // A DEC machine stores the upper half first, and its exponents count from 128 of a mantissa below 1.
    const std::uint32_t bits = machine_ == kIntel ? second << 16 | first : first << 16 | second;
    const double value = std::bit_cast<float>(bits);
    return machine_ == kDec ? value / 4 : value;
  }
  std::string text(std::size_t at, std::size_t length) const {
    require(at, length);
    std::string result(bytes_.substr(at, length));
    result.erase(std::find(result.begin(), result.end(), '\0'), result.end());
    result.erase(0, std::min(result.find_first_not_of(' '), result.size()));
    result.erase(result.find_last_not_of(' ') + 1);
    return result;
  }
  void require(std::size_t at, std::size_t length) const {
    if (at > bytes_.size() || length > bytes_.size() - at)
      fail_at(where_, "reading a C3D file: the file ends at byte {}, where more should stand; it is truncated",
              bytes_.size());
  }

 private:
  std::string_view bytes_;
  const FileLocation& where_;
  int machine_ = kIntel;
};

/// An array of the parameter section.
struct C3dParameter {
  int type = 0;  ///< -1 text, 1 byte, 2 integer, 4 float
  std::vector<std::size_t> axes;
  std::size_t at = 0;  ///< of its first byte

  std::size_t count() const {
    std::size_t product = 1;
    for (const std::size_t axis : axes) product *= axis;
    return product;
  }
};

/// The parameters of a file by `GROUP:NAME`.
class C3dParameters {
 public:
  C3dParameters(const C3dBytes& bytes, std::size_t begin) : bytes_(bytes) {
    std::map<int, std::string> groups;
    std::map<std::pair<int, std::string>, C3dParameter> found;
    for (std::size_t at = begin + 4; at + 2 < bytes.size();) {
      const auto length = as_size(std::abs(bytes.signed_byte(at)));
      const int id = bytes.signed_byte(at + 1);
      if (length == 0) break;
      const std::string name = upper_case(bytes.text(at + 2, length));
      const std::size_t next = at + 2 + length;
      if (id < 0)
        groups[-id] = name;
      else
        found[{id, name}] = parameter(next + 2);
      const auto way = as_size(bytes.word(next));
      if (way == 0) break;
      at = next + way;
    }
    for (const auto& [key, value] : found)
      if (groups.count(key.first) != 0) parameters_[groups.at(key.first) + ":" + key.second] = value;
  }

  const C3dParameter* find(const std::string& name) const {
    const auto found = parameters_.find(name);
    return found == parameters_.end() || found->second.count() == 0 ? nullptr : &found->second;
  }
  /// The first number of a parameter; integers are counts without a sign.
  std::optional<double> number(const std::string& name, std::size_t index = 0) const {
    const C3dParameter* parameter = find(name);
    if (!parameter || index >= parameter->count()) return std::nullopt;
    switch (parameter->type) {
      case 1:
        return bytes_.byte(parameter->at + index);
      case 2:
        return bytes_.word(parameter->at + 2 * index);
      case 4:
        return bytes_.real(parameter->at + 4 * index);
      default:
        return std::nullopt;
    }
  }
  /// The texts of a parameter; a text without a list is one text.
  std::vector<std::string> texts(const std::string& name) const {
    std::vector<std::string> result;
    const C3dParameter* parameter = find(name);
    if (!parameter || parameter->type != -1) return result;
    const std::size_t length = parameter->axes.empty() ? 1 : parameter->axes[0];
    for (std::size_t i = 0; i < parameter->count() / length; ++i)
      result.push_back(bytes_.text(parameter->at + i * length, length));
    return result;
  }

 private:
  static std::string upper_case(std::string text) {
    for (char& c : text)
      if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
    return text;
  }
  C3dParameter parameter(std::size_t at) const {
    C3dParameter result;
    result.type = bytes_.signed_byte(at);
    const auto axes = as_size(bytes_.byte(at + 1));
    std::size_t bytes = as_size(std::abs(result.type));
    for (std::size_t i = 0; i < axes; ++i) {
      result.axes.push_back(as_size(bytes_.byte(at + 2 + i)));
      bytes *= result.axes.back();
      if (bytes > bytes_.size()) break;  // so that the product stays a number; the check below refuses it
    }
    result.at = at + 2 + axes;
    bytes_.require(result.at, bytes);
    return result;
  }

  const C3dBytes& bytes_;
  std::map<std::string, C3dParameter> parameters_;
};

/// Where the points of a file are, and what they mean.
class C3dReader {
 public:
  C3dReader(std::string_view bytes, const FileLocation& where, std::optional<double> metres_per_unit)
      : bytes_(bytes, where), parameters_(bytes_, begin_of_parameters(bytes_)) {
    points_.format = "c3d";
    read_counts();
    read_meaning(metres_per_unit);
    read_names();
  }

  SpacePoints read() {
    const std::size_t item = floats_ ? 4 : 2;
    const std::size_t frame_bytes = item * (4 * count_ + analog_);
    bytes_.require(data_, 0);
    if (frames_ > (bytes_.size() - data_) / frame_bytes)
      fail_at(bytes_.where(),
              "reading a C3D file: {} frames of {} points need {} bytes, the file has {} for them; it is truncated",
              frames_, count_, frames_ * frame_bytes, bytes_.size() - data_);
    for (std::size_t f = 0; f < frames_; ++f) {
      auto& frame = points_.frames[first_ + static_cast<long>(f)];
      for (std::size_t p = 0; p < count_; ++p) frame.push_back(point(data_ + f * frame_bytes + 4 * item * p));
    }
    return std::move(points_);
  }

 private:
  static std::size_t begin_of_parameters(C3dBytes& bytes) {
    const auto block = as_size(bytes.byte(0));
    if (block < 2 || bytes.byte(1) != kC3dMark)
      fail_at(bytes.where(), "reading a C3D file: the file begins with {} and {}, not with a block and 80",
              bytes.byte(0), bytes.byte(1));
    const std::size_t begin = (block - 1) * kC3dBlock;
    bytes.set_machine(bytes.byte(begin + 3));
    return begin;
  }

  void read_counts();
  void read_meaning(std::optional<double> metres_per_unit);
  void read_names();

  std::optional<Eigen::Vector3d> point(std::size_t at) const {
    Eigen::Vector3d raw;
    for (std::size_t i = 0; i < 3; ++i)
      raw[static_cast<int>(i)] = floats_ ? bytes_.real(at + 4 * i) : scale_ * bytes_.integer(at + 2 * i);
    const double residual = floats_ ? bytes_.real(at + 12) : bytes_.integer(at + 6);
    if (!(residual >= 0) || raw.hasNaN() || raw.isZero(0.0)) return std::nullopt;
    const Eigen::Vector3d metres = metres_ * raw;
    require_near(metres, bytes_.where());
    return metres;
  }

  C3dBytes bytes_;
  C3dParameters parameters_;
  SpacePoints points_;
  std::size_t count_ = 0, analog_ = 0, frames_ = 0, data_ = 0;
  long first_ = 1;
  bool floats_ = false;
  double scale_ = 1.0, metres_ = 1.0;
};

void C3dReader::read_counts() {
  const auto count = [&](const char* name, std::size_t header) {
    const double value = parameters_.number(name).value_or(bytes_.word(header));
    if (!(value >= 0 && value <= 65535))
      fail_at(bytes_.where(), "reading a C3D file: {} is {}; 0 to 65535 are possible", name, value);
    return as_size(value);
  };
  count_ = count("POINT:USED", 2);
  analog_ = as_size(bytes_.word(4));
  if (count_ == 0) fail_at(bytes_.where(), "reading a C3D file: it holds no points (POINT:USED is 0)");
  if (count_ > kMaxC3dPoints)
    fail_at(bytes_.where(), "reading a C3D file: it holds {} points; at most {} are read", count_, kMaxC3dPoints);
  const std::size_t block = count("POINT:DATA_START", 16);
  if (block < 2)
    fail_at(bytes_.where(), "reading a C3D file: the points begin in block {}, inside of the header", block);
  data_ = (block - 1) * kC3dBlock;
  // The header counts to 65535. Longer files state both frames as two words, the lower first, or their number as a
  // real.
  const auto field = [&](const char* name) -> std::optional<long> {
    const auto low = parameters_.number(name, 0), high = parameters_.number(name, 1);
    if (!low || !high || !(*low >= 0 && *low <= 65535 && *high >= 0 && *high <= 65535)) return std::nullopt;
    return std::lround(*low) + 65536 * std::lround(*high);
  };
  first_ = bytes_.word(6);
  long last = bytes_.word(8);
  const auto start = field("TRIAL:ACTUAL_START_FIELD"), end = field("TRIAL:ACTUAL_END_FIELD");
  if (start && end && *end >= *start) {
    first_ = *start;
    last = *end;
  } else if (const auto frames = parameters_.number("POINT:LONG_FRAMES");
             last == 65535 && frames && *frames >= 1.0 && *frames <= kMaxC3dFrames) {
    last = first_ + std::lround(*frames) - 1;
  }
  if (last < first_)
    fail_at(bytes_.where(), "reading a C3D file: the frames are {} to {}, so there are none", first_, last);
  frames_ = as_size(last - first_ + 1);
}

void C3dReader::read_meaning(std::optional<double> metres_per_unit) {
  points_.rate = parameters_.number("POINT:RATE").value_or(bytes_.real(20));
  if (!(points_.rate >= 0.0 && points_.rate < 1e6))
    fail_at(bytes_.where(), "reading a C3D file: the rate of {} frames per second is impossible", points_.rate);
  scale_ = parameters_.number("POINT:SCALE").value_or(bytes_.real(12));
  if (!std::isfinite(scale_) || scale_ == 0.0)
    fail_at(bytes_.where(), "reading a C3D file: POINT:SCALE is {}; a negative number means floats, another scales",
            scale_);
  floats_ = scale_ < 0;
  const std::vector<std::string> units = parameters_.texts("POINT:UNITS");
  points_.unit = units.empty() ? "" : units.front();
  metres_ = metres_per_unit ? *metres_per_unit : metres_of_unit(points_.unit, bytes_.where());
  const std::vector<std::string> up = parameters_.texts("POINT:Y_SCREEN");
  if (up.empty() || up.front().size() < 2) return;
  const int axis = (up.front()[1] | 0x20) - 'x';
  if (axis < 0 || axis > 2 || (up.front()[0] != '+' && up.front()[0] != '-')) return;
  points_.up = Eigen::Vector3d((up.front()[0] == '-' ? -1.0 : 1.0) * Eigen::Vector3d::Unit(axis));
}

/// LABELS holds up to 255 names, LABELS2 the next, and so on.
void C3dReader::read_names() {
  std::vector<std::string> labels;
  for (int part = 1; labels.size() < count_; ++part) {
    const auto more = parameters_.texts("POINT:LABELS" + (part == 1 ? std::string() : std::to_string(part)));
    if (more.empty()) break;
    labels.insert(labels.end(), more.begin(), more.end());
  }
  std::set<std::string> taken;
  for (std::size_t p = 0; p < count_; ++p) {
    std::string name = p < labels.size() && !labels[p].empty() ? labels[p] : fmt::format("point_{}", p + 1);
    while (!taken.insert(name).second) name += "'";
    points_.names.push_back(name);
  }
}

}  // namespace

bool is_c3d(std::string_view bytes) {
  return bytes.size() >= 2 && static_cast<unsigned char>(bytes[0]) >= 2 &&
         static_cast<unsigned char>(bytes[1]) == kC3dMark;
}

SpacePoints parse_c3d(std::string_view bytes, const FileLocation& where, std::optional<double> metres_per_unit) {
  return C3dReader(bytes, where, metres_per_unit).read();
}

}  // namespace doppel
