#include "doppel/data/capture/dataset_layouts.h"

#include <algorithm>
#include <regex>

#include "doppel/calibration/formats/read_calibration.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// A mask of ZJU-MoCap holds a label or 1 where the person is.
constexpr int kLabels = 1;

bool has_signs(const DatasetLayout& layout, const std::vector<std::string>& files) {
  return std::all_of(layout.signs.begin(), layout.signs.end(), [&](const std::string& sign) {
    const std::regex wanted(sign);
    return std::any_of(files.begin(), files.end(), [&](const auto& file) { return std::regex_search(file, wanted); });
  });
}

void add_calibration_above(const DatasetLayout& layout, FolderContent& content) {
  const std::string path = "../" + layout.calibration_above;
  if (layout.calibration_above.empty() || !fs::is_regular_file(content.root / path)) return;
  content.calibrations.push_back({path, load_calibration(content.root / path)});
}

}  // namespace

const std::vector<DatasetLayout>& dataset_layouts() {
  static const std::vector<DatasetLayout> layouts{
      {"ZJU-MoCap",
       {R"(^annots\.npy$)", R"(^[^/]+/[^/]*[0-9]+\.jpg$)"},
       {{R"(^annots\.npy$)"}, {R"(^[^/]+/[^/]+\.jpg$)"}, {"^mask_cihp/", "^mask/"}, kLabels},
       ""},
      {"EasyMocap",
       {R"(^intri\.yml$)", R"(^extri\.yml$)", "^(images|videos)/"},
       {{R"(^\.$)", R"(^intri\.yml$)", R"(^extri\.yml$)"},
        {"^videos/", "^images/"},
        {"^mask_cihp/", "^mask/"},
        kLabels},
       ""},
      {"ActorsHQ", {R"(^calibration\.csv$)", "^rgbs/"}, {{R"(^calibration\.csv$)"}, {"^rgbs/"}, {"^masks/"}}, ""},
      {"CMU Panoptic",
       {R"(^calibration_[^/]*\.json$)", "^hd(Videos|Imgs)/"},
       {{R"(^calibration_[^/]*\.json$)"}, {"^hdVideos/", "^hdImgs/"}, {}},
       ""},
      {"Human3.6M",
       {R"((^|/)Videos/[^/]+\.(54138969|55011271|58860488|60457274)\.mp4$)"},
       {{}, {R"((^|/)Videos/[^/_]+\.[0-9]{8}\.mp4$)"}, {}},
       ""},
      {"DeepCap",
       {R"(^images[0-9]*\.avi$)"},
       {{"monocularCalibration"}, {R"(^images[0-9]*\.avi$)"}, {}},
       "monocularCalibration.calibration"},
  };
  return layouts;
}

std::vector<std::string> dataset_names() {
  std::vector<std::string> names;
  for (const DatasetLayout& layout : dataset_layouts()) names.push_back(layout.name);
  return names;
}

std::optional<RecognisedCapture> recognise_dataset(const fs::path& folder) {
  if (!fs::is_directory(folder)) return std::nullopt;
  const std::vector<std::string> files = list_folder(folder);
  for (const DatasetLayout& layout : dataset_layouts()) {
    if (!has_signs(layout, files)) continue;
    FolderContent content = read_folder(folder);
    add_calibration_above(layout, content);
    CaptureGuess guess = guess_capture(content, layout.hints);
    if (!guess.complete) continue;
    return RecognisedCapture{std::move(guess.capture), layout.name, std::move(guess.found), std::move(guess.missing)};
  }
  return std::nullopt;
}

}  // namespace doppel
