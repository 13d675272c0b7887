#include <gtest/gtest.h>

#include <fstream>

#include "doppel/rigging/body/body_shapes.h"
#include "doppel/rigging/body/measures.h"
#include "doppel/track/shape/fit_character.h"
#include "support/shared_folder.h"
#include "support/temporary_folder.h"

namespace doppel::real_fit_test {
namespace {

namespace fs = std::filesystem;

class RealFit : public support::SharedFolderTest {};

/// Four cameras, OpenPose's points, no masks, no scan.
TEST_F(RealFit, AManIsMeasuredByHisKeypoints) {
  const support::TemporaryFolder folder;
  const fs::path p2s = shared_ / "captures/p2s";
  std::ofstream capture(folder / "capture.yaml");
  capture << "doppel_capture: 1\nname: man\nroot: " << p2s.string()
          << "\ncalibration: calibration.toml\nfps: 60\nkeypoint_map: body25b\nsequences:\n"
          << "  - name: man\n    split: train\n    first_frame: 0\n    videos:\n";
  for (int c = 1; c <= 4; ++c) capture << "      cam_0" << c << ": videos/cam0" << c << ".mp4\n";
  capture << "    keypoints:\n";
  for (int c = 1; c <= 4; ++c)
    capture << "      cam_0" << c << ": openpose/cam0" << c << "/cam0" << c << ".{frame:04}.json\n";
  capture.close();
  const BodyModel model(2000, 200);
  const BodyShapes family("man", model);
  FitCharacterOptions options;
  options.frames = 8;
  options.texture_size = 0;
  const auto footage = Footage::open_for(family.character(family.mean()), folder / "man.character",
                                         folder / "capture.yaml", options.config.fit.outline_pixels);
  const FittedCharacter fitted = fit_character(family, *footage, options);
  RecordProperty("keypoint_error_px", std::to_string(fitted.poses.keypoint_error));
  EXPECT_EQ(fitted.poses.frames.size(), 8u);
  EXPECT_GT(fitted.poses.inlier_ratio, 0.9);
  EXPECT_LT(fitted.poses.keypoint_error, 12.0) << "the points of the cameras are 10 pixels apart";
  double top = 0.0;
  for (const Eigen::Vector3d& p : fitted.character.mesh.vertices) top = std::max(top, p.y());
  EXPECT_NEAR(top, 1.72, 0.1) << "a man of usual height";
}

}  // namespace
}  // namespace doppel::real_fit_test
