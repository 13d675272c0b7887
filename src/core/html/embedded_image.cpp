#include "doppel/core/html/embedded_image.h"

#include "doppel/core/base64.h"
#include "doppel/core/html/svg_chart.h"

namespace doppel {
std::string embedded_image(const std::string& bytes, const std::string& type, const std::string& caption) {
  const std::string text = escape_html(caption);
  return "<figure><img alt=\"" + text + "\" src=\"data:" + type + ";base64," + base64(bytes) + "\"><figcaption>" +
         text + "</figcaption></figure>";
}

}  // namespace doppel
