#include "doppel/data/capture/layouts/dataset_layout.h"

#include <algorithm>
#include <regex>

#include "doppel/calibration/formats/read_calibration.h"

namespace doppel {

namespace {

/// For each of the signs, the first file that matches.
std::optional<std::string> find_signs(const std::vector<std::string>& signs, const FolderListing& listing) {
  std::string found;
  for (const std::string& sign : signs) {
    const std::regex wanted(sign);
    const auto file = std::find_if(listing.files().begin(), listing.files().end(),
                                   [&](const auto& path) { return std::regex_search(path, wanted); });
    if (file == listing.files().end()) return std::nullopt;
    found += (found.empty() ? "" : ", ") + *file;
  }
  return found;
}

CaptureGuess guess_dataset(const PublicDataset& dataset, const FolderListing& listing) {
  FolderContent content = read_folder(listing);
  const std::string above = "../" + dataset.calibration_above;
  if (!dataset.calibration_above.empty() && listing.has_file(above))
    content.calibrations.push_back({above, load_calibration(listing.full(above))});
  return guess_capture(content, dataset.hints);
}

}  // namespace

FolderLayout dataset_layout(PublicDataset dataset) {
  return {dataset.name, !dataset.signs.empty(),
          [signs = dataset.signs](const FolderListing& listing) { return find_signs(signs, listing); },
          [dataset](const FolderListing& listing) { return guess_dataset(dataset, listing); }};
}

}  // namespace doppel
