#include "doppel/track/energy/outline.h"

#include <gtest/gtest.h>

#include <cmath>

#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/track/energy/drawn_outline.h"
#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::outline_test {
namespace {

TEST(DrawnOutline, HasTheDistanceToTheEdgeAndNothingAwayFromIt) {
  cv::Mat covered = cv::Mat::zeros(32, 32, CV_8UC1);
  covered(cv::Rect(10, 0, 22, 32)).setTo(255);  // its edge is the line u = 10
  const DrawnOutline outline(covered);
  for (const double u : {8.6, 9.5, 10.0, 10.3, 10.9}) {
    ASSERT_TRUE(outline.holds(u, 16.2));
    EXPECT_NEAR(outline.distance(u, 16.2), 10.0 - u, 1e-9);
  }
  EXPECT_FALSE(outline.holds(13.0, 16.0)) << "the surface covers all pixels around";
  EXPECT_FALSE(outline.holds(10.2, 0.5)) << "at the border of the window";
  EXPECT_FALSE(outline.holds(-3.0, 16.0));
  EXPECT_FALSE(outline.holds(NAN, 16.0));
}

/// A surface whose masks are its own outlines is where it should be, however coarse the mesh.
TEST(OutlineFinder, ASurfaceThatFillsItsMasksHasNoResidual) {
  const Character character = make_test_character(4, 12, 20);
  const PoseModel model(character, {}, all_dofs(character));
  const std::vector<PinholeCamera> cameras = ring_of_cameras(2, 512, middle_of(character));
  const std::vector<double> dofs = bent_pose(character, 0.2);
  FrameEvidence frame(2);
  const PosedBody body = model.pose(dofs, false);
  torch::Tensor drawn = Rasterizer(RenderMesh(character.mesh).faces)
                            .coverage_projected(vertex_tensor(posed_vertices(model, body)),
                                                projection_tensor(cameras).unsqueeze(0), 512, 512);
  for (std::size_t c = 0; c < 2; ++c)
    frame[c].outline =
        OutlineField(cv::Mat(512, 512, CV_8UC1, drawn.flatten(0, 1)[static_cast<long>(c)].data_ptr()) > 0, 128);
  const std::vector<OutlineVertex> outline =
      OutlineFinder(character, cameras, 10000).find(frame, posed_vertices(model, body));
  ASSERT_GT(outline.size(), 40U);
  double inside = 0.0;
  for (const OutlineVertex& vertex : outline) inside -= vertex.distance / static_cast<double>(outline.size());
  EXPECT_GT(inside, 0.5) << "without their own distances the vertices would be pulled outwards by as much";
  SilhouetteTerm<PoseModel> term(cameras, frame, outline, 1.0, 1.0, {});
  const Residuals rows = support::frozen_rows(term, model, dofs);
  double sum = 0.0, magnitude = 0.0;
  for (Eigen::Index row = 0; row < rows.num_rows(); ++row) {
    sum += rows.value(row) / static_cast<double>(rows.num_rows());
    magnitude += std::abs(rows.value(row)) / static_cast<double>(rows.num_rows());
  }
  // A pixel of the window has about 5 reference pixels; resizing the mask and drawing the surface round differently.
  EXPECT_LT(std::abs(sum), 0.15 * inside);
  EXPECT_LT(magnitude, 0.5 * inside);
}

}  // namespace
}  // namespace doppel::outline_test
