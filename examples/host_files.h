// What the example hosts read and write besides TorchScript: numbers out of an exported file's extra files, and
// images in PPM format.
#pragma once

#include <cstdint>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace host {

/// The number behind a key of metadata.json.
inline double number_in(const std::string& json, const std::string& key) {
  const size_t at = json.find("\"" + key + "\":");
  if (at == std::string::npos) throw std::runtime_error("the file's metadata.json lacks " + key);
  return std::stod(json.substr(at + key.size() + 3));
}

/// The words in the list behind a key of metadata.json.
inline std::vector<std::string> words_in(const std::string& json, const std::string& key) {
  std::vector<std::string> words;
  size_t at = json.find("\"" + key + "\": [");
  if (at == std::string::npos) return words;
  const size_t end = json.find(']', at);
  for (at = json.find('"', json.find('[', at)); at < end; at = json.find('"', at + 1)) {
    const size_t close = json.find('"', at + 1);
    words.push_back(json.substr(at + 1, close - at - 1));
    at = close;
  }
  return words;
}

/// The numbers of a .npy file of 4-byte elements.
template <typename T>
std::vector<T> numbers(const std::string& npy) {
  if (npy.size() < 10) throw std::runtime_error("the exported file lacks an array");
  const size_t header = 10 + (static_cast<unsigned char>(npy[8]) | static_cast<unsigned char>(npy[9]) << 8);
  std::vector<T> out((npy.size() - header) / sizeof(T));
  std::memcpy(out.data(), npy.data() + header, out.size() * sizeof(T));
  return out;
}

/// Red, green, blue, row by row.
struct Image {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;

  Image() = default;
  Image(int width_in, int height_in, uint8_t grey)
      : width(width_in), height(height_in), rgb(size_t(3) * width * height, grey) {}
  uint8_t* at(int x, int y) { return &rgb[3 * (size_t(y) * width + x)]; }
  const uint8_t* at(int x, int y) const { return &rgb[3 * (size_t(y) * width + x)]; }
};

inline Image read_ppm(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string magic;
  Image image;
  int largest = 0;
  in >> magic >> image.width >> image.height >> largest;
  in.get();  // the one white space before the pixels
  if (!in || magic != "P6" || largest != 255 || image.width < 1 || image.height < 1 || image.width > 32768 ||
      image.height > 32768)
    throw std::runtime_error(path + " is not a binary PPM image (P6, 255) without comments");
  image.rgb.resize(size_t(3) * image.width * image.height);
  if (!in.read(reinterpret_cast<char*>(image.rgb.data()), static_cast<std::streamsize>(image.rgb.size())))
    throw std::runtime_error(path + " ends before its last pixel");
  return image;
}

inline void write_ppm(const std::string& path, const Image& image) {
  std::ofstream out(path, std::ios::binary);
  out << "P6\n" << image.width << " " << image.height << "\n255\n";
  out.write(reinterpret_cast<const char*>(image.rgb.data()), static_cast<std::streamsize>(image.rgb.size()));
  if (!out) throw std::runtime_error(path + " cannot be written");
}

}  // namespace host
