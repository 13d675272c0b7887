#include "doppel/character/character_folder.h"

#include <algorithm>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// Removes the folder when the writing ends, in whatever way; and the one around it if it was made for nothing.
class TemporaryCharacterFolder {
 public:
  explicit TemporaryCharacterFolder(fs::path path)
      : path_(std::move(path)), outer_existed_(fs::exists(path_.parent_path())) {
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~TemporaryCharacterFolder() {
    std::error_code none;
    fs::remove_all(path_, none);
    if (!outer_existed_) fs::remove(path_.parent_path(), none);  // where it is empty
  }
  TemporaryCharacterFolder(const TemporaryCharacterFolder&) = delete;
  TemporaryCharacterFolder& operator=(const TemporaryCharacterFolder&) = delete;

  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
  bool outer_existed_;
};

void check_target(const fs::path& folder, const std::string& name) {
  std::error_code none;
  if (!fs::exists(folder, none)) return;
  if (!fs::is_directory(folder, none)) fail<UsageError>("{} is a file; give a folder to write into", folder.string());
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string file = entry.path().filename().string();
    if (entry.path().extension() == ".character" && file != name + ".character")
      fail<UsageError>("{} holds another character, {}; give an empty folder", folder.string(), file);
  }
}

/// Labels in the folder would be read with a character that has none.
void check_labels(const fs::path& folder, const fs::path& written) {
  std::error_code none;
  if (fs::exists(folder / "segmentation.txt", none) && !fs::exists(written / "segmentation.txt", none))
    fail<UsageError>(
        "{} holds a segmentation.txt of another character, which would be read with this one; give an empty folder",
        folder.string());
}

void move_files(const fs::path& from, const fs::path& to) {
  fs::create_directories(to);
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(from)) files.push_back(entry.path());
  std::stable_partition(files.begin(), files.end(), [](const fs::path& f) { return f.extension() != ".character"; });
  for (const fs::path& file : files) fs::rename(file, to / file.filename());
}

}  // namespace

void check_character_name(const std::string& name) {
  if (name.empty() || name.find('/') != std::string::npos || name[0] == '.')
    fail<UsageError>("'{}' cannot be the name of a character, because files have it; use letters and digits", name);
}

fs::path write_character_folder(const fs::path& folder, const std::string& name,
                                const std::function<void(const fs::path&)>& write) {
  check_target(folder, name);
  try {
    // In the folder itself, because files beside it may be on another disk.
    const TemporaryCharacterFolder temporary(folder / ".partial");
    write(temporary.path());
    check_labels(folder, temporary.path());
    move_files(temporary.path(), folder);
  } catch (const fs::filesystem_error& error) {
    fail("the character cannot be written to {}: {}", folder.string(), error.code().message());
  }
  return folder / (name + ".character");
}

fs::path character_of_folder(const fs::path& folder) {
  std::vector<fs::path> characters;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".character") characters.push_back(entry.path());
  std::sort(characters.begin(), characters.end());
  if (characters.size() > 1)
    fail<UsageError>("{} is a folder with {} .character files; name one of them, for example {}", folder.string(),
                     characters.size(), characters[0].filename().string());
  return characters.empty() ? fs::path() : characters[0];
}

}  // namespace doppel
