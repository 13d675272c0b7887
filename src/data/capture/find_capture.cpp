#include "doppel/data/capture/find_capture.h"

#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/path_pattern.h"
#include "doppel/data/capture/layouts/dataset_layout.h"
#include "doppel/data/capture/layouts/studio_layout.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

/// A mask of ZJU-MoCap holds a label or 1 where the person is.
constexpr int kLabels = 1;

/// All layouts, in the order in which a folder is asked for their signs: the surest first. The last one fits every
/// folder.
const std::vector<FolderLayout>& folder_layouts() {
  static const std::vector<FolderLayout> layouts{
      studio_layout({"ASH/TriHuman",
                     "stream",
                     {{"videos", "foregroundSegmentation"},
                      {"images", "foregroundSegmentation"},
                      {"", "foregroundSegmentation"},
                      {"videos", "segmentation_videos"}}}),
      studio_layout({"DynaCap", "c_", {{"img", "fg"}}, /*largest_component=*/true}),
      dataset_layout({"ZJU-MoCap",
                      {R"(^annots\.npy$)", R"(^[^/]+/[^/]*[0-9]+\.jpg$)"},
                      {{R"(^annots\.npy$)"}, {R"(^[^/]+/[^/]+\.jpg$)"}, {"^mask_cihp/", "^mask/"}, kLabels}}),
      dataset_layout({"EasyMocap",
                      {R"(^intri\.yml$)", R"(^extri\.yml$)", "^(images|videos)/"},
                      {{R"(^\.$)", R"(^intri\.yml$)", R"(^extri\.yml$)"},
                       {"^videos/", "^images/"},
                       {"^mask_cihp/", "^mask/"},
                       kLabels}}),
      dataset_layout(
          {"ActorsHQ", {R"(^calibration\.csv$)", "^rgbs/"}, {{R"(^calibration\.csv$)"}, {"^rgbs/"}, {"^masks/"}}}),
      dataset_layout({"CMU Panoptic",
                      {R"(^calibration_[^/]*\.json$)", "^hd(Videos|Imgs)/"},
                      {{R"(^calibration_[^/]*\.json$)"}, {"^hdVideos/", "^hdImgs/"}, {}}}),
      dataset_layout({"Human3.6M",
                      {R"((^|/)Videos/[^/]+\.(54138969|55011271|58860488|60457274)\.mp4$)"},
                      {{}, {R"((^|/)Videos/[^/_]+\.[0-9]{8}\.mp4$)"}, {}}}),
      dataset_layout({"DeepCap",
                      {R"(^images[0-9]*\.avi$)"},
                      {{"monocularCalibration"}, {R"(^images[0-9]*\.avi$)"}, {}},
                      "monocularCalibration.calibration"}),
      dataset_layout({"", {}, {}}),
  };
  return layouts;
}

/// The guess by the first layout that the folder has with all its parts.
/// @param only_sure whether the last resort, which fits every folder, is left out
std::optional<CaptureGuess> first_guess(const fs::path& folder, bool only_sure) {
  const FolderListing listing(folder);
  std::vector<std::string> told;
  for (const FolderLayout& layout : folder_layouts()) {
    if (only_sure && !layout.sure) continue;
    const std::optional<std::string> sign = layout.sign(listing);
    if (!sign) continue;
    const auto doubt = [&](const std::string& reason) {
      told.push_back(fmt::format("the folder looks like {} ({}), but: {}", layout.name, *sign, reason));
    };
    try {
      CaptureGuess guess = layout.guess(listing);
      if (guess.complete || !layout.sure) {
        if (layout.sure) told.push_back(fmt::format("layout of {} ({})", layout.name, *sign));
        guess.layout = layout.name;
        guess.found.insert(guess.found.begin(), told.begin(), told.end());
        return guess;
      }
      doubt("its calibration or its footage is missing");
    } catch (const Error& e) {
      if (only_sure || !layout.sure) throw;
      doubt(e.what());
    }
  }
  return std::nullopt;
}

/// For messages: "ASH/TriHuman, DynaCap, ...".
std::string public_layouts() {
  std::string names;
  for (const FolderLayout& layout : folder_layouts())
    if (layout.sure) names += (names.empty() ? "" : ", ") + layout.name;
  return names;
}

}  // namespace

std::optional<CaptureGuess> recognise_capture(const fs::path& path) {
  const bool is_folder = fs::is_directory(path);
  const std::string extension = path.extension().string();
  if (is_folder ? fs::exists(path / "capture.yaml") : extension == ".yaml" || extension == ".yml")
    return CaptureGuess{"", read_capture(path), {}, {}, true};
  return is_folder ? first_guess(path, true) : std::nullopt;
}

Capture find_capture(const fs::path& path) {
  if (!fs::exists(path)) fail("there is no file or folder {}", path.string());
  if (!fs::is_directory(path)) return read_capture(path);
  std::optional<CaptureGuess> recognised = recognise_capture(path);
  if (!recognised)
    fail(
        "{} has no capture.yaml and is not laid out like a public dataset that is known ({}); let `doppel capture init "
        "{}` write a capture.yaml, or write one as docs/capture.md shows, with the folders of these datasets",
        path.string(), public_layouts(), path.string());
  if (!recognised->layout.empty()) log::info("{}: recognised by its files", path.string());
  for (const std::string& sentence : recognised->found) log::info("  {}", sentence);
  for (const std::string& sentence : recognised->missing) log::info("  missing: {}", sentence);
  return std::move(recognised->capture);
}

CaptureGuess guess_folder(const fs::path& folder) {
  check_without_braces(fs::absolute(folder).string());
  return first_guess(folder, false).value();
}

}  // namespace doppel
