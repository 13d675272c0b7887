// Trains the toy stage into a run folder: what the resume test starts, kills and starts again.
//   resume_driver RUN ITERATIONS
// Prints a line per checkpoint, so that its parent knows how far it is.

#include <cstdio>
#include <cstdlib>

#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/train/trainer.h"
#include "train/toy_stage.h"

namespace {

class ReportingStage : public doppel::testing::ToyStage {
 public:
  doppel::LossTerms loss(doppel::StepContext& context) override {
    std::printf("%ld\n", static_cast<long>(context.step));
    std::fflush(stdout);
    return ToyStage::loss(context);
  }
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  doppel::setup_logging("warn");
  doppel::setup_process();
  at::set_num_threads(2);
  ReportingStage stage;
  doppel::TrainerOptions options;
  options.iterations = std::atol(argv[2]);
  options.schedule.kind = doppel::Schedule::Kind::cosine;
  options.schedule.iterations = options.iterations;
  options.schedule.learning_rate = 1e-2;
  options.adam.mean_decay = 0.95;
  options.adam.weight_decay = 0.01;
  options.checkpoint_every = 7;
  options.log_every = 5;
  const doppel::RunFolder run(argv[1]);
  run.open("stage: toy\n", doppel::RunMode::automatic);
  const auto summary = doppel::Trainer(stage, options, run).run();
  return summary.reason == doppel::StopReason::finished ? 0 : 1;
}
