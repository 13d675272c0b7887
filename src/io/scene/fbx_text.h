#pragma once

#include <filesystem>
#include <string>

#include "doppel/io/scene/fbx_record.h"

namespace doppel {

/// Reads the text form of FBX. Arrays (`*9 { a: 1,2,... }`) become the array value of their record.
/// @throws FileError with the line
FbxRecord read_fbx_text(const std::filesystem::path& path, const std::string& text);

}  // namespace doppel
