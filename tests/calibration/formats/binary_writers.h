#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

/// Small writers of binary calibrations, from the formats' own descriptions: independent of the readers.
namespace doppel::support {

template <typename Number>
inline std::string little_endian(Number value) {
  return {reinterpret_cast<const char*>(&value), sizeof(Number)};
}

/// Records of COLMAP's cameras.bin and images.bin.
inline std::string binary_camera(std::uint32_t id, std::int32_t model, std::uint64_t width, std::uint64_t height,
                                 const std::vector<double>& parameters) {
  std::string bytes = little_endian(id) + little_endian(model) + little_endian(width) + little_endian(height);
  for (double value : parameters) bytes += little_endian(value);
  return bytes;
}

inline std::string binary_image(std::uint32_t camera, const std::string& name, std::uint64_t points = 0,
                                std::vector<double> pose = {0.5, 0.5, 0.5, 0.5, 0.1, 0.2, 3}) {
  std::string bytes = little_endian(std::uint32_t{9});
  for (double value : pose) bytes += little_endian(value);
  bytes += little_endian(camera) + name + '\0' + little_endian(points);
  for (std::uint64_t i = 0; i < points; ++i) bytes += little_endian(1.0) + little_endian(2.0) + std::string(8, '\xff');
  return bytes;
}

inline std::string counted(std::uint64_t count, const std::string& records) { return little_endian(count) + records; }

// Parts of pickles, as Python writes them: the opcodes of one value.
inline std::string py_text(const std::string& text) {
  return "X" + little_endian(static_cast<std::uint32_t>(text.size())) + text;
}
inline std::string py_bytes(const std::string& text) {
  return "B" + little_endian(static_cast<std::uint32_t>(text.size())) + text;
}
inline std::string py_int(std::int32_t value) { return "J" + little_endian(value); }
inline std::string py_list(const std::vector<std::string>& items) {
  std::string bytes = "](";
  for (const std::string& item : items) bytes += item;
  return bytes + "e";
}
inline std::string py_tuple(const std::vector<std::string>& items) {
  std::string bytes = "(";
  for (const std::string& item : items) bytes += item;
  return bytes + "t";
}
inline std::string py_dict(const std::vector<std::pair<std::string, std::string>>& items) {
  std::string bytes = "}(";
  for (const auto& [key, value] : items) bytes += py_text(key) + value;
  return bytes + "u";
}
inline std::string py_dtype(const std::string& type, const std::string& order) {
  const std::string state = py_tuple({py_int(3), py_text(order), "N", "N", "N", py_int(-1), py_int(-1), py_int(0)});
  return "cnumpy\ndtype\n" + py_tuple({py_text(type), "\x89", "\x88"}) + "R" + state + "b";
}
inline std::string py_array(const std::vector<int>& shape, const std::string& dtype, const std::string& data,
                            bool fortran = false) {
  std::vector<std::string> axes;
  for (int axis : shape) axes.push_back(py_int(axis));
  return "cnumpy.core.multiarray\n_reconstruct\n" + py_tuple({"cnumpy\nndarray\n", py_tuple({py_int(0)}), "C\1b"}) +
         "R" + py_tuple({py_int(1), py_tuple(axes), dtype, fortran ? "\x88" : "\x89", data}) + "b";
}
inline std::string py_matrix(const std::vector<int>& shape, const std::vector<double>& values) {
  std::string data;
  for (double value : values) data += little_endian(value);
  return py_array(shape, py_dtype("f8", "<"), py_bytes(data));
}
inline std::string pickled(const std::string& value) { return "\x80\x03" + value + "."; }

/// The content of a cameraIntrinsics.pickle of OpenCap.
inline std::string opencap_dict(const std::vector<std::pair<std::string, std::string>>& more = {}) {
  std::vector<std::pair<std::string, std::string>> items = {
      {"distortion", py_matrix({1, 5}, {0.1, -0.2, 0.001, 0.002, 0.05})},
      {"intrinsicMat", py_matrix({3, 3}, {900, 0, 360, 0, 905, 640, 0, 0, 1})},
      {"imageSize", py_matrix({2, 1}, {1280, 720})}};
  items.insert(items.end(), more.begin(), more.end());
  return pickled(py_dict(items));
}

inline std::vector<std::pair<std::string, std::string>> opencap_pose() {
  return {{"rotation", py_matrix({3, 3}, {1, 0, 0, 0, 0, -1, 0, 1, 0})},
          {"translation", py_matrix({3, 1}, {100, 200, 3000})},
          {"rotation_EulerAngles", py_matrix({3, 1}, {1.5707963267948966, 0, 0})}};
}

/// The dict of ZJU-MoCap's annots.npy.
inline std::string zju_dict(const std::string& K, const std::string& D, const std::string& R, const std::string& T,
                            const std::vector<std::string>& paths) {
  std::vector<std::string> texts;
  for (const std::string& path : paths) texts.push_back(py_text(path));
  const std::string frame = py_dict({{"ims", py_list(texts)}});
  return py_dict({{"cams", py_dict({{"K", K}, {"D", D}, {"R", R}, {"T", T}})}, {"ims", py_list({frame, frame})}});
}

inline std::string npy_of_objects(const std::string& object, const std::string& type = "|O") {
  std::string header = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (), }";
  header.resize(117, ' ');
  header += '\n';
  return std::string("\x93NUMPY\1\0", 8) + little_endian(static_cast<std::uint16_t>(header.size())) + header +
         pickled(py_array({}, py_dtype("O8", "|"), py_list({object})));
}

inline const std::string kZjuK = py_matrix({3, 3}, {1500, 0, 512, 0, 1510, 500, 0, 0, 1});
inline const std::string kZjuD = py_matrix({5, 1}, {0.1, -0.2, 0.001, 0.002, 0.05});
inline const std::string kZjuT = py_matrix({3, 1}, {100, 200, 3000});
/// [[1, 0, 0], [0, 0, -1], [0, 1, 0]], stored column by column.
inline std::string zju_rotation() {
  std::string data;
  for (double value : {1, 0, 0, 0, 0, 1, 0, -1, 0}) data += little_endian(value);
  return py_array({3, 3}, py_dtype("f8", "<"), py_bytes(data), true);
}

inline std::string two_zju_cameras(const std::vector<std::string>& paths = {"Camera_B4/000001.jpg",
                                                                            "Camera_B7/000001.jpg"}) {
  return zju_dict(py_list({kZjuK, kZjuK}), py_list({kZjuD, kZjuD}), py_list({zju_rotation(), zju_rotation()}),
                  py_list({kZjuT, kZjuT}), paths);
}

}  // namespace doppel::support
