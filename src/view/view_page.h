#pragma once

#include <span>
#include <string_view>

namespace doppel {

struct ViewPageFile {
  std::string_view path;  ///< "/index.html"
  std::string_view type;  ///< media type
  std::string_view content;
};

/// The built page of web/dist, which the build puts into the program.
extern const std::span<const ViewPageFile> kViewPage;

}  // namespace doppel
