#include "doppel/track/surface/surface_tracker.h"

#include <gmock/gmock.h>

#include "doppel/core/error.h"
#include "doppel/layers/surface.h"
#include "support/message_of.h"
#include "track/energy/body_fixture.h"

namespace doppel::surface_tracker_test {
namespace {

using support::message_of;

class SurfaceTracking : public ::testing::Test {
 protected:
  SurfaceTracking()
      : character_(make_test_character(3, 12, 20)),
        landmarks_(tube_landmarks(3)),
        cameras_(ring_of_cameras(4, 256, middle_of(character_))),
        dofs_(character_.rest_dofs) {}

  /// What is seen of a surface that the graph bends. @param metres that nodes move by at most
  FrameEvidence bent(double metres) const {
    const GraphModel graph(character_, landmarks_);
    std::vector<double> parameters = graph.undeformed();
    for (std::size_t i = 0; i < parameters.size(); ++i)
      if (i % 6 >= 3) parameters[i] = metres * std::sin(0.7 + 0.4 * static_cast<double>(i));
    Character other = character_;
    other.mesh.vertices = deformed_vertices(graph, graph.pose(parameters, false));
    const PoseModel model(other, landmarks_, {});
    FrameEvidence frame = keypoints_of(model, cameras_, dofs_);
    for (std::size_t c = 0; c < cameras_.size(); ++c)
      frame[c].outline = OutlineField(mask_of(model, cameras_[c], dofs_), 256);
    return frame;
  }

  Character character_;
  std::vector<Marker> landmarks_;
  std::vector<PinholeCamera> cameras_;
  std::vector<double> dofs_;
};

TEST_F(SurfaceTracking, FillsTheMasksWherePosesCannot) {
  SurfaceOptions options;
  options.arap_weight = 300.0;  // neighbours are moved in different directions
  SurfaceTracker tracker(character_, landmarks_, cameras_, options);
  const SurfaceFrame found = tracker.track(bent(0.02), dofs_);
  EXPECT_LT(found.posed_overlap, 0.93);
  EXPECT_LT(1.0 - found.overlap, 0.55 * (1.0 - found.posed_overlap))
      << found.overlap << " from " << found.posed_overlap;
  for (const double x : found.parameters) ASSERT_TRUE(std::isfinite(x));
  const SurfaceFrame next = tracker.track(bent(0.02), dofs_);
  EXPECT_GE(next.overlap, found.overlap - 0.005) << "from where the last frame ended";
}

TEST_F(SurfaceTracking, NobodyInTheMasksChangesNothing) {
  SurfaceTracker tracker(character_, landmarks_, cameras_);
  const SurfaceFrame first = tracker.track(bent(0.02), dofs_);
  FrameEvidence nobody(cameras_.size());
  for (ViewEvidence& view : nobody) view.keypoints.resize(landmarks_.size());
  const SurfaceFrame found = tracker.track(nobody, dofs_);
  EXPECT_EQ(found.parameters, first.parameters);
  EXPECT_EQ(found.overlap, 0.0);
}

TEST_F(SurfaceTracking, SaysWhatIsWrong) {
  SurfaceOptions options;
  options.arap_weight = -1.0;
  EXPECT_THAT(message_of<Error>([&] { SurfaceTracker(character_, landmarks_, cameras_, options); }),
              ::testing::HasSubstr("arap"));
  character_.graph = {};
  EXPECT_THAT(message_of<Error>([&] { SurfaceTracker(character_, landmarks_, cameras_); }),
              ::testing::HasSubstr("no embedded graph"));
}

/// The surface is that of the layer which training uses.
TEST_F(SurfaceTracking, BendsAsTheLayerDoes) {
  const std::vector<double> dofs = bent_pose(character_, 0.3);
  GraphModel model(character_, landmarks_);
  model.set_pose(dofs);
  std::vector<double> parameters = model.undeformed();
  for (std::size_t i = 0; i < parameters.size(); ++i)
    parameters[i] = (i % 6 < 3 ? 0.4 : 0.05) * std::sin(0.7 + 1.7 * static_cast<double>(i));
  const auto all = torch::tensor(parameters, torch::kFloat64).view({1, model.num_nodes(), 6});
  const torch::Tensor expected =
      CharacterSurface(character_)
          ->deformed(torch::tensor(dofs, torch::kFloat64).unsqueeze(0), all.narrow(2, 0, 3), all.narrow(2, 3, 3))
          .squeeze(0)
          .to(torch::kFloat64)
          .contiguous();
  const std::vector<Eigen::Vector3d> found = deformed_vertices(model, model.pose(parameters, false));
  for (int v = 0; v < character_.num_vertices(); ++v) {
    const double* row = expected.data_ptr<double>() + 3 * v;
    EXPECT_LT((found[v] - Eigen::Vector3d(row[0], row[1], row[2])).norm(), 1e-9) << v;
  }
}

}  // namespace
}  // namespace doppel::surface_tracker_test
