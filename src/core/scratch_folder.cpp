#include "doppel/core/scratch_folder.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>

#include "doppel/core/error.h"

namespace doppel {

ScratchFolder::ScratchFolder(const std::filesystem::path& parent) {
  std::string name = (parent / ".doppel-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) fail("no folder can be made in {}: {}", parent.string(), std::strerror(errno));
  path_ = name;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace doppel
