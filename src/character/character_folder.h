#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace doppel {

/// @throws UsageError for a name that the files of a character cannot have
void check_character_name(const std::string& name);

/// Writes the folder of a character so that nothing is half written: `write` fills a temporary folder in it, whose
/// files then move into place. The `.character` file moves last, so a folder that has it is complete.
/// @param name of the character: `write` writes `<name>.character`
/// @return the path of the `.character` file
/// @throws UsageError when `folder` is a file, or holds another character or a `segmentation.txt` that load_character
///   would read with this one; Error when the files cannot be written; whatever `write` throws
std::filesystem::path write_character_folder(const std::filesystem::path& folder, const std::string& name,
                                             const std::function<void(const std::filesystem::path&)>& write);

/// The one `.character` file in a folder; empty when there is none.
/// @throws UsageError when there are several, with their names
std::filesystem::path character_of_folder(const std::filesystem::path& folder);

}  // namespace doppel
