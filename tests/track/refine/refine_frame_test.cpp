// A tube with a painted texture, filmed by drawing it: its ground truth is known to the last bit.
#include "doppel/track/refine/refine_frame.h"

#include <gmock/gmock.h>

#include <opencv2/imgproc.hpp>

#include "doppel/core/error.h"
#include "doppel/core/statistics.h"
#include "doppel/track/shape/texture_bake.h"
#include "support/message_of.h"
#include "track/energy/body_fixture.h"

namespace doppel::refine_frame_test {
namespace {

/// Blobs of some pixels of film, the same on every machine.
cv::Mat painted_texture() {
  cv::Mat noise(40, 40, CV_8UC3), texture;
  cv::RNG random(7);
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  cv::resize(noise, texture, {512, 512}, 0, 0, cv::INTER_CUBIC);
  return texture;
}

class RefineFrameTest : public ::testing::Test {
 protected:
  RefineFrameTest()
      : character_(painted()),
        landmarks_(tube_landmarks(4)),
        model_(character_, landmarks_, all_dofs(character_)),
        cameras_(ring_of_cameras(4, 320, middle_of(character_))) {
    for (const Dof& dof : character_.skeleton.dofs) config_.dofs.dofs.push_back(dof.name);
    config_.fit.limit_weight = 0.0;
  }

  static Character painted() {
    Character character = make_test_character(4, 16, 28);
    character.mesh.texture = painted_texture();
    return character;
  }

  /// What the cameras see of a pose. @param keypoint_error pixels that every keypoint is too low
  FootageFrame film(const std::vector<double>& dofs, float keypoint_error = 0.0F) const {
    SurfaceDrawer drawer(character_.mesh);
    FootageFrame seen;
    seen.evidence = keypoints_of(model_, cameras_, dofs);
    const auto surface = posed_vertices(model_, model_.pose(dofs, false));
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      for (Keypoint& keypoint : seen.evidence[c].keypoints) keypoint.y += keypoint_error;
      const DrawnSurface drawn = drawer.draw(surface, cameras_[c]);
      cv::Mat image(cameras_[c].height, cameras_[c].width, CV_8UC3, cv::Scalar(90, 60, 30));
      drawn.colour.copyTo(image(drawn.box), drawn.covered);
      cv::Mat mask = cv::Mat::zeros(image.size(), CV_8U);
      drawn.covered.copyTo(mask(drawn.box));
      seen.evidence[c].outline = OutlineField(mask, 200);
      seen.images.push_back(image);
      seen.masks.push_back(mask);
    }
    return seen;
  }

  double landmark_error(const std::vector<double>& a, const std::vector<double>& b) const {
    const PosedBody first = model_.pose(a, false), second = model_.pose(b, false);
    double sum = 0.0;
    for (int m = 0; m < model_.num_landmarks(); ++m)
      sum += (model_.landmark(first, m) - model_.landmark(second, m)).norm() / model_.num_landmarks();
    return sum;
  }

  FrameRefiner refiner() const { return {character_, landmarks_, cameras_, config_, {}}; }

  Character character_;
  std::vector<Marker> landmarks_;
  PoseModel model_;
  std::vector<PinholeCamera> cameras_;
  TrackConfig config_;
};

TEST_F(RefineFrameTest, MatchesAreWhereTheFilmShowsTheVertices) {
  const std::vector<double> filmed = bent_pose(character_, 0.1), drawn = bent_pose(character_, 0.08);
  const FrameFlow flow = refiner().flow(film(filmed), drawn);
  ASSERT_GT(flow.matches.size(), 200u);
  const PosedBody ground_truth = model_.pose(filmed, false), start = model_.pose(drawn, false);
  std::vector<double> before, after;
  for (const SurfaceMatch& match : flow.matches) {
    const Eigen::Vector2d seen = cameras_[match.camera].project(model_.vertex(ground_truth, match.vertex));
    before.push_back((cameras_[match.camera].project(model_.vertex(start, match.vertex)) - seen).norm());
    after.push_back((match.pixel - seen).norm());
  }
  EXPECT_GT(median(before), 1.0);
  EXPECT_LT(median(after), 0.15 * median(before));
}

TEST_F(RefineFrameTest, ThePoseFollowsTheTextureThoughKeypointsAreOff) {
  const std::vector<double> filmed = bent_pose(character_, 0.1);
  std::vector<double> dofs = bent_pose(character_, 0.07);
  const double before = landmark_error(dofs, filmed);
  FootageFrame seen = film(filmed, 2.0F);
  for (ViewEvidence& view : seen.evidence) view.outline = OutlineField();
  FrameRefiner refiner = this->refiner();
  for (int pass = 0; pass < 2; ++pass) dofs = refiner.fit(seen, refiner.flow(seen, dofs).matches, dofs).dofs;
  const double with_texture = landmark_error(dofs, filmed);
  std::vector<double> alone = bent_pose(character_, 0.07);
  for (int pass = 0; pass < 2; ++pass) alone = refiner.fit(seen, {}, alone).dofs;
  EXPECT_LT(with_texture, 0.3 * before);
  EXPECT_LT(with_texture, 0.7 * landmark_error(alone, filmed)) << "keypoints alone";
}

TEST_F(RefineFrameTest, FramesTogetherFindTheTemplate) {
  const Character narrow = [&] {
    Character changed = character_;
    for (int v = 0; v < changed.num_vertices(); ++v) changed.mesh.vertices[v] -= 0.012 * model_.rest_normal(v);
    return changed;
  }();
  FrameRefiner refiner(narrow, landmarks_, cameras_, config_, {});
  SurfaceOffset offset(narrow.mesh);
  constexpr int kFrames = 4;
  for (int f = 0; f < kFrames; ++f) {
    const std::vector<double> dofs = bent_pose(character_, 0.1, 0.3 + f);
    const FootageFrame seen = film(dofs);
    refiner.add_to(offset, seen, refiner.flow(seen, dofs).matches, dofs);
  }
  const auto found = offset.solve(kFrames * 1e5, kFrames * 1e3);
  double before = 0.0, after = 0.0;
  for (std::size_t v = 0; v < found.size(); ++v) {
    before += (narrow.mesh.vertices[v] - character_.mesh.vertices[v]).norm();
    after += (narrow.mesh.vertices[v] + found[v] - character_.mesh.vertices[v]).norm();
  }
  EXPECT_LT(after, 0.6 * before);
}

TEST_F(RefineFrameTest, ATextureOfFilmThatIsMovedIsSharp) {
  // The poses are off, each in its own way: unmoved film averages the details away.
  TextureBake blurred(character_.mesh, 256), sharp(character_.mesh, 256);
  FrameRefiner refiner = this->refiner();
  for (int f = 0; f < 6; ++f) {
    const std::vector<double> filmed = bent_pose(character_, 0.1, f), wrong = bent_pose(character_, 0.1, f + 0.25);
    const FootageFrame seen = film(filmed);
    const FrameFlow flow = refiner.flow(seen, wrong);
    const auto surface = posed_vertices(model_, model_.pose(wrong, false));
    for (std::size_t c = 0; c < cameras_.size(); ++c) {
      const AlignedFilm aligned = align_film(flow.views[c], seen.images[c]);
      sharp.add(surface, cameras_[c], static_cast<int>(c), aligned.image, aligned.mask);
      blurred.add(surface, cameras_[c], static_cast<int>(c), seen.images[c], seen.masks[c]);
    }
  }
  cv::Mat expected;
  cv::resize(character_.mesh.texture, expected, {256, 256}, 0, 0, cv::INTER_AREA);
  const cv::Rect middle(0, 64, 256, 128);
  const auto error = [&](const cv::Mat& texture) { return cv::norm(texture(middle), expected(middle), cv::NORM_L2); };
  EXPECT_LT(error(sharp.texture()), 0.7 * error(blurred.texture()));
}

TEST_F(RefineFrameTest, ACharacterWithoutTextureIsRefused) {
  character_.mesh.texture = cv::Mat();
  EXPECT_THAT(support::message_of<Error>([&] { static_cast<void>(refiner()); }), ::testing::HasSubstr("no texture"));
}

}  // namespace
}  // namespace doppel::refine_frame_test
