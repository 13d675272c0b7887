#include "doppel/core/file_head.h"

#include <algorithm>
#include <fstream>

namespace doppel {

std::string read_head(const std::filesystem::path& path, std::size_t bytes) {
  std::error_code unreadable;
  if (!std::filesystem::is_regular_file(path, unreadable)) return "";
  std::ifstream file(path, std::ios::binary);
  std::string head(bytes, '\0');
  file.read(head.data(), static_cast<std::streamsize>(bytes));
  head.resize(std::max<std::streamsize>(0, file.gcount()));
  return head;
}

}  // namespace doppel
