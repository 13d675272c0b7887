#include "doppel/data/capture/layouts/folder_listing.h"

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/core/folder_path.h"
#include "doppel/detect/keypoints/frame_names.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr int kDepth = 6;
constexpr std::size_t kMaxFiles = 500'000;

}  // namespace

FolderListing::FolderListing(const fs::path& folder) : root_(folder_path(fs::absolute(folder))) {
  if (!fs::is_directory(folder)) fail("{} is not a folder", folder.string());
}

const FolderListing::Folder& FolderListing::at(const std::string& path) const {
  const auto [entry, is_new] = read_.try_emplace(path);
  Folder& folder = entry->second;
  if (!is_new) return folder;
  std::error_code error;  // a folder that must not be read holds nothing for us
  for (const auto& file : fs::directory_iterator(full(path), error))
    if (file.is_directory(error))
      folder.folders.push_back(file.path().filename().string());
    else if (file.is_regular_file(error))
      folder.files.push_back(file.path().filename().string());
  std::sort(folder.files.begin(), folder.files.end());
  std::sort(folder.folders.begin(), folder.folders.end());
  return folder;
}

void FolderListing::enter(const std::string& folder, int depth, std::set<fs::path>& seen) const {
  std::error_code error;
  const fs::path real = fs::canonical(full(folder), error);
  if (error || !seen.insert(real).second) return;  // links may lead in circles
  folders_.push_back(folder.empty() ? "." : folder);
  const std::string prefix = folder.empty() ? "" : folder + "/";
  for (const std::string& name : at(folder).files)
    if (name.front() != '.') files_.push_back(prefix + name);
  if (files_.size() > kMaxFiles)
    fail("{} holds more than {} files; name the folder of one capture", root_.string(), kMaxFiles);
  for (const std::string& name : at(folder).folders)
    if (depth > 0 && name.front() != '.' && !fs::exists(full(prefix + name + "/capture.yaml"), error))
      enter(prefix + name, depth - 1, seen);
}

void FolderListing::walk() const {
  if (!folders_.empty()) return;
  std::set<fs::path> seen;
  enter("", kDepth, seen);
  for (std::vector<std::string>* names : {&files_, &folders_}) std::sort(names->begin(), names->end(), natural_less);
}

}  // namespace doppel
