#include "doppel/html/embedded_image.h"

#include <cstddef>

#include "doppel/html/svg_chart.h"

namespace doppel {
namespace {

std::string base64(const std::string& bytes) {
  static const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned word = 0;
    for (std::size_t k = 0; k < 3; ++k)
      word = (word << 8) | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += i + k <= bytes.size() ? digits[(word >> (18 - 6 * k)) & 63u] : '=';
  }
  return out;
}

}  // namespace

std::string embedded_image(const std::string& bytes, const std::string& type, const std::string& caption) {
  const std::string text = escape_html(caption);
  return "<figure><img alt=\"" + text + "\" src=\"data:" + type + ";base64," + base64(bytes) + "\"><figcaption>" +
         text + "</figcaption></figure>";
}

}  // namespace doppel
