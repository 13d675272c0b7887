#include <gtest/gtest.h>

#include <fstream>
#include <type_traits>

#include "doppel/train/stage_table.h"
#include "extending/displacement.h"
#include "extending/displacement_metric.h"
#include "extending/ground_term.h"
#include "extending/plain.h"
#include "extending/sketch_stage.h"
#include "support/temporary_folder.h"
#include "track/energy/body_fixture.h"
#include "track/energy/term_check.h"

namespace doppel::extending_test {
namespace {

TEST(ExtendingPage, TheLossIsTheMeanSquaredDisplacement) {
  const torch::Tensor before = torch::zeros({1, 4, 3}), after = torch::full({1, 4, 3}, 2.0);
  EXPECT_NEAR(displacement_loss(after, before).item<double>(), 12.0, 1e-6);
}

TEST(ExtendingPage, TheTermHasTheJacobianOfItsResiduals) {
  const Character character = make_test_character(4);
  const PoseModel model(character, tube_landmarks(4), all_dofs(character));
  std::vector<double> dofs = bent_pose(character, 0.2);
  dofs[character.skeleton.root().translation[1]] -= 5.0;
  GroundTerm term(3.0);
  support::check_term(term, model, dofs);
}

TEST(ExtendingPage, TheReaderReadsItsFormat) {
  const support::TemporaryFolder folder;
  std::ofstream(folder / "cameras.txt") << "plain left 640 480 500\n";
  const PlainCalibration format;
  const CalibrationSource source{folder / "cameras.txt", "plain left"};
  EXPECT_TRUE(format.recognises(source));
  const Camera camera = format.read(source).cameras.at(0);
  EXPECT_EQ(camera.name, "left");
  EXPECT_TRUE(camera.faults().empty());
}

TEST(ExtendingPage, TheStageChecksItsOptions) {
  const StageEntry entry = sketch_entry();
  entry.check_options(ConfigDocument::parse("stage: sketch\ncapture: /prepared\n", "sketch.yaml"));
  EXPECT_THROW(entry.check_options(ConfigDocument::parse("stage: sketch\ncapture: /a\nsize: 3\n", "sketch.yaml")),
               FileError);
}

// The metric needs a trained run. Here it only has to compile as a row of an evaluation.
static_assert(std::is_invocable_r_v<nlohmann::ordered_json, decltype(evaluate_displacement), const ActorEvaluation&>);

}  // namespace
}  // namespace doppel::extending_test
