#pragma once

#include <zlib.h>

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "doppel/core/npy.h"
#include "support/number_bytes.h"

/// Small writers of motion files, from the formats' own descriptions: independent of the readers.
namespace doppel::support {

inline void put(std::string& bytes, std::uint32_t value, int count) { bytes += number_bytes(value, count, false); }

/// A zip archive of `.npy` files (APPNOTE.TXT 4.3).
class NpzWriter {
 public:
  explicit NpzWriter(bool deflated = false) : deflated_(deflated) {}

  void add(const std::string& name, const std::vector<double>& values, const std::vector<std::int64_t>& shape) {
    add_bytes(name + ".npy", npy_bytes(values.data(), "<f8", shape));
  }
  void add_bytes(const std::string& name, const std::string& content) {
    const std::string packed = deflated_ ? deflate_raw(content) : content;
    std::string entry;
    put(entry, 20, 2);  // version needed; then flags, method, time, date
    put(entry, 0, 2);
    put(entry, deflated_ ? 8 : 0, 2);
    put(entry, 0, 4);
    put(entry,
        static_cast<std::uint32_t>(
            crc32(0, reinterpret_cast<const Bytef*>(content.data()), static_cast<uInt>(content.size()))),
        4);
    put(entry, static_cast<std::uint32_t>(packed.size()), 4);
    put(entry, static_cast<std::uint32_t>(content.size()), 4);
    put(entry, static_cast<std::uint32_t>(name.size()), 2);
    put(entry, 0, 2);
    put(directory_, 0x02014b50, 4);
    put(directory_, 20, 2);
    directory_ += entry;
    for (int i = 0; i < 5; ++i) put(directory_, 0, 2);  // comment, volume, attributes
    put(directory_, static_cast<std::uint32_t>(bytes_.size()), 4);
    directory_ += name;
    put(bytes_, 0x04034b50, 4);
    bytes_ += entry + name + packed;
    ++entries_;
  }
  std::string bytes() const {
    std::string file = bytes_ + directory_;
    put(file, 0x06054b50, 4);
    put(file, 0, 4);
    put(file, entries_, 2);
    put(file, entries_, 2);
    put(file, static_cast<std::uint32_t>(directory_.size()), 4);
    put(file, static_cast<std::uint32_t>(bytes_.size()), 4);
    put(file, 0, 2);
    return file;
  }

 private:
  static std::string deflate_raw(const std::string& content) {
    z_stream stream{};
    deflateInit2(&stream, 9, Z_DEFLATED, -MAX_WBITS, 9, Z_DEFAULT_STRATEGY);
    std::string packed(deflateBound(&stream, static_cast<uLong>(content.size())), '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(content.data()));
    stream.avail_in = static_cast<uInt>(content.size());
    stream.next_out = reinterpret_cast<Bytef*>(packed.data());
    stream.avail_out = static_cast<uInt>(packed.size());
    deflate(&stream, Z_FINISH);
    packed.resize(stream.total_out);
    deflateEnd(&stream);
    return packed;
  }

  bool deflated_;
  std::string bytes_, directory_;
  std::uint32_t entries_ = 0;
};

/// A C3D file (c3d.org) of points alone.
struct C3dWriter {
  int machine = 84;   ///< 84 Intel, 85 DEC, 86 MIPS
  double scale = -1;  ///< negative: floats; else the unit of the integers
  double rate = 100.0;
  std::string units = "mm", up = "+Z";
  int first_frame = 1;
  std::vector<std::string> labels;
  std::vector<std::vector<Eigen::Vector3d>> frames;  ///< [F][labels] in units; NaN: missing

  std::string bytes() const {
    std::string parameters;
    parameters += '\x01';
    parameters += '\x50';
    parameters += '\x02';  // blocks
    parameters += static_cast<char>(machine);
    group(parameters, 1, "POINT");
    integer_parameter(parameters, "USED", static_cast<int>(labels.size()));
    integer_parameter(parameters, "DATA_START", 6);
    real_parameter(parameters, "RATE", rate);
    real_parameter(parameters, "SCALE", scale);
    if (last_frame() > 65535) real_parameter(parameters, "LONG_FRAMES", static_cast<double>(frames.size()));
    text_parameter(parameters, "UNITS", {units});
    text_parameter(parameters, "X_SCREEN", {"+X"});
    text_parameter(parameters, "Y_SCREEN", {up});
    text_parameter(parameters, "LABELS", labels);
    parameters.resize(4 * 512, '\0');
    std::string file = header() + parameters;
    for (const auto& frame : frames)
      for (const Eigen::Vector3d& point : frame) write_point(file, point);
    return file;
  }

 private:
  void word(std::string& bytes, int value) const {
    const char low = static_cast<char>(value & 0xff), high = static_cast<char>(value >> 8 & 0xff);
    bytes += machine == 86 ? high : low;
    bytes += machine == 86 ? low : high;
  }
  void real(std::string& bytes, double value) const {
    const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(machine == 85 ? 4 * value : value));
    const int high = static_cast<int>(bits >> 16), low = static_cast<int>(bits & 0xffff);
    word(bytes, machine == 84 ? low : high);
    word(bytes, machine == 84 ? high : low);
  }
  int last_frame() const { return first_frame + static_cast<int>(frames.size()) - 1; }
  std::string header() const {
    std::string bytes("\x02\x50", 2);
    word(bytes, static_cast<int>(labels.size()));
    word(bytes, 0);
    word(bytes, first_frame);
    word(bytes, std::min(65535, last_frame()));
    word(bytes, 10);
    real(bytes, scale);
    word(bytes, 6);
    word(bytes, 0);
    real(bytes, rate);
    bytes.resize(512, '\0');
    return bytes;
  }
  void group(std::string& bytes, int id, const std::string& name) const {
    bytes += static_cast<char>(name.size());
    bytes += static_cast<char>(-id);
    bytes += name;
    word(bytes, 3);
    bytes += '\0';
  }
  void parameter(std::string& bytes, const std::string& name, const std::string& content) const {
    bytes += static_cast<char>(name.size());
    bytes += '\x01';
    bytes += name;
    word(bytes, static_cast<int>(content.size()) + 3);
    bytes += content;
    bytes += '\0';
  }
  void integer_parameter(std::string& bytes, const std::string& name, int value) const {
    std::string content("\x02\x00", 2);
    word(content, value);
    parameter(bytes, name, content);
  }
  void real_parameter(std::string& bytes, const std::string& name, double value) const {
    std::string content("\x04\x00", 2);
    real(content, value);
    parameter(bytes, name, content);
  }
  void text_parameter(std::string& bytes, const std::string& name, const std::vector<std::string>& texts) const {
    constexpr std::size_t kLength = 24;
    std::string content("\xff\x02", 2);
    content += static_cast<char>(kLength);
    content += static_cast<char>(texts.size());
    for (std::string text : texts) {
      text.resize(kLength, ' ');
      content += text;
    }
    parameter(bytes, name, content);
  }
  void write_point(std::string& bytes, const Eigen::Vector3d& point) const {
    const bool missing = point.hasNaN();
    for (int i = 0; i < 4; ++i) {
      const double value = i == 3 ? (missing ? -1.0 : 0.0) : missing ? 0.0 : point[i];
      if (scale < 0)
        real(bytes, value);
      else
        word(bytes, i == 3 ? static_cast<int>(value) : static_cast<int>(std::lround(value / scale)));
    }
  }
};

}  // namespace doppel::support
