#include "doppel/data/capture/layouts/layout_table.h"

#include "doppel/data/capture/layouts/dataset_layout.h"
#include "doppel/data/capture/layouts/studio_layout.h"

namespace doppel {

namespace {

/// A mask of ZJU-MoCap holds a label or 1 where the person is.
constexpr int kLabels = 1;

}  // namespace

const std::vector<FolderLayout>& folder_layouts() {
  static const std::vector<FolderLayout> layouts{
      studio_layout({"ASH/TriHuman",
                     "training/videos/streamNNN.mp4 with training/foregroundSegmentation/",
                     "stream",
                     {{"videos", "foregroundSegmentation"},
                      {"images", "foregroundSegmentation"},
                      {"", "foregroundSegmentation"},
                      {"videos", "segmentation_videos"}}}),
      studio_layout({"DynaCap",
                     "training/img/c_<camera>.avi with training/fg/",
                     "c_",
                     {{"img", "fg"}},
                     /*largest_component=*/true}),
      dataset_layout({"ZJU-MoCap",
                      "annots.npy with <camera>/NNNNNN.jpg",
                      {R"(^annots\.npy$)", R"(^[^/]+/[^/]*[0-9]+\.jpg$)"},
                      {{R"(^annots\.npy$)"}, {R"(^[^/]+/[^/]+\.jpg$)"}, {"^mask_cihp/", "^mask/"}, kLabels}}),
      dataset_layout({"EasyMocap",
                      "intri.yml and extri.yml with videos/ or images/",
                      {R"(^intri\.yml$)", R"(^extri\.yml$)", "^(images|videos)/"},
                      {{R"(^\.$)", R"(^intri\.yml$)", R"(^extri\.yml$)"},
                       {"^videos/", "^images/"},
                       {"^mask_cihp/", "^mask/"},
                       kLabels}}),
      dataset_layout({"ActorsHQ",
                      "calibration.csv with rgbs/",
                      {R"(^calibration\.csv$)", "^rgbs/"},
                      {{R"(^calibration\.csv$)"}, {"^rgbs/"}, {"^masks/"}}}),
      dataset_layout({"CMU Panoptic",
                      "calibration_<sequence>.json with hdVideos/ or hdImgs/",
                      {R"(^calibration_[^/]*\.json$)", "^hd(Videos|Imgs)/"},
                      {{R"(^calibration_[^/]*\.json$)"}, {"^hdVideos/", "^hdImgs/"}, {}}}),
      dataset_layout({"Human3.6M",
                      "Videos/<action>.<camera>.mp4 with the camera parameters",
                      {R"((^|/)Videos/[^/]+\.(54138969|55011271|58860488|60457274)\.mp4$)"},
                      {{}, {R"((^|/)Videos/[^/_]+\.[0-9]{8}\.mp4$)"}, {}}}),
      dataset_layout({"DeepCap",
                      "images<k>.avi below the folder of monocularCalibration.calibration",
                      {R"(^images[0-9]*\.avi$)"},
                      {{"monocularCalibration"}, {R"(^images[0-9]*\.avi$)"}, {}},
                      "monocularCalibration.calibration"}),
      dataset_layout({"", "a calibration and footage", {}, {}}),
  };
  return layouts;
}

}  // namespace doppel
