#include "doppel/train/trainer.h"

#include <ATen/CPUGeneratorImpl.h>
#include <fmt/ranges.h>

#include <cmath>
#include <functional>
#include <opencv2/imgcodecs.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/cpu_dispatch.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/nets/shared_norm.h"
#include "doppel/train/report.h"
#include "doppel/train/tensorboard.h"

namespace doppel {

namespace {

/// LibTorch's global generator, which layers such as dropout draw from.
at::Generator global_generator() { return at::detail::getDefaultCPUGenerator(); }

torch::Tensor generator_state(const at::Generator& generator) { return generator.get_state(); }

/// Writes files beside the checkpoints. A failure does not end the training: there is a warning, and they are written
/// again later.
void write_beside(const std::function<void()>& write) {
  try {
    write();
  } catch (const Error& e) {
    log::warn("{}; the training goes on", e.what());
  } catch (const std::filesystem::filesystem_error& e) {
    log::warn("{}; the training goes on", e.what());
  }
}

/// What decides the last bits of a result.
std::string present_machine() {
  return fmt::format("{} threads, instruction set {}", at::get_num_threads(), isa_name(cpu_isa()));
}

/// The checkpoints of earlier versions do not say it.
void warn_of_other_machine(const Checkpoint& checkpoint) {
  if (!checkpoint.has_text("machine") || checkpoint.text("machine") == present_machine()) return;
  log::warn(
      "the run was trained with {}, and goes on with {}: the result will differ in the last bits from that of an "
      "unbroken run",
      checkpoint.text("machine"), present_machine());
}

/// All keys except those of iterations and learning rates.
void describe_unscheduled(const Keys& keys, TrainerOptions& o) {
  describe_keys(keys, o.adam);
  keys("log_every", o.log_every, at_least<std::int64_t>(1), "steps per line of `metrics.jsonl`");
  keys("checkpoint_every", o.checkpoint_every, at_least<std::int64_t>(1), "steps between checkpoints");
  keys("keep_last", o.keep_last, at_least(1), "newest checkpoints kept");
  keys("keep_every", o.keep_every, at_least<std::int64_t>(0),
       "also keep the checkpoints of steps divisible by this; 0: none");
  keys("keep", o.keep_best, {"last", "best"},
       "`best`: also keep the checkpoint with the smallest loss on validation frames, which later stages, evaluation "
       "and export then use");
  keys("images_every", o.images_every, at_least<std::int64_t>(0), "steps between images in `pictures/`; 0: at the end");
  keys("max_minutes", o.max_minutes, at_least(0.0),
       "total training time, over all starts of the command, after which the run ends in order; 0: no limit");
}

}  // namespace

void describe_keys(const Keys& keys, TrainerOptions& o) {
  keys("iterations", o.iterations, at_least<std::int64_t>(1), "steps");
  describe_keys(keys, o.schedule);
  o.schedule.iterations = o.iterations;
  describe_unscheduled(keys, o);
}

void describe_phased(const Keys& keys, TrainerOptions& o, const Schedule& schedule, const std::string& source) {
  for (const char* key : {"iterations", "learning_rate", "schedule", "warmup", "final_ratio"}) keys.forbid(key, source);
  o.iterations = schedule.iterations;
  o.schedule = schedule;
  describe_unscheduled(keys, o);
}

void check_same_data(const Checkpoint& checkpoint, const Stage& stage, const std::filesystem::path& run) {
  if (checkpoint.text("stage") != stage.name())
    fail<UsageError>("{} holds checkpoints of stage {}, not {}", run.string(), checkpoint.text("stage"), stage.name());
  const std::string then = checkpoint.text("identity"), now = stage.identity();
  if (then != now)
    fail<UsageError>(
        "{} was trained on other data, or on earlier stages that were trained again since:\n  then: {}\n  now:  "
        "{}\nUse "
        "the same capture, another --out, or --overwrite.",
        run.string(), then, now);
  // Checkpoints of before 0.1.0 have none.
  if (checkpoint.has_text("content") && checkpoint.text("content") != stage.content())
    fail<UsageError>(
        "{} was trained on another recording of the same name ({}), or on the same one prepared with another mask "
        "size: "
        "its motion, cameras or masks are not those of now. Use the same capture, another --out, or --overwrite.",
        run.string(), now);
}

Trainer::Trainer(Stage& stage, const TrainerOptions& options, const RunFolder& run, Ranks* ranks)
    : stage_(stage),
      options_(options),
      run_(run),
      checkpoints_(run.checkpoints(), options.keep_last, options.keep_every, options.keep_best),
      adam_(stage.model(), options.adam),
      generator_(at::detail::createCPUGenerator(static_cast<std::uint64_t>(options.seed))),
      ranks_(ranks && ranks->several() ? ranks : nullptr),
      gradients_(stage.model(), ranks_) {
  global_generator().set_current_seed(static_cast<std::uint64_t>(options.seed));
}

Trainer::~Trainer() = default;

TrainSummary Trainer::run() {
  TrainSummary summary;
  start_ = std::chrono::steady_clock::now();
  if (options_.keep_best && !stage_.has_validation_frames())
    fail<UsageError>(
        "train.keep: best needs validation frames; name them in the section `validation` of the configuration, or as "
        "`split: validation` in capture.yaml");
  resume();
  join_ranks();
  summary.resumed_at = step_;
  if (writes()) {
    metrics_ = std::make_unique<MetricsFile>(run_.metrics(), step_);
    tensorboard_ = std::make_unique<TensorBoardWriter>(run_.path(), step_);
    if (options_.keep_start && saved_step_ < 0) save_checkpoint();
  }
  summary.step_seconds = train();
  summary.reason =
      step_ >= options_.iterations ? StopReason::finished : reason_to_stop().value_or(StopReason::interrupted);
  if (writes()) finish_files(summary.reason);
  summary.step = step_;
  summary.seconds = seconds();
  summary.loss = window_.steps() > 0 ? window_.take().loss : last_loss_;  // of steps that no line of metrics has yet
  return summary;
}

double Trainer::train() {
  std::optional<Progress> progress;
  if (writes()) progress.emplace(stage_.name(), options_.iterations, step_);
  double first_end = 0.0;
  std::int64_t steps = 0;
  for (; step_ < options_.iterations && !reason_to_stop(); ++steps) {
    const double loss = step();
    log_and_save();
    if (steps == 0) first_end = seconds();
    if (progress) progress->advance(1, fmt::format("loss {:.4g}", loss));
  }
  return steps > 1 ? (seconds() - first_end) / static_cast<double>(steps - 1) : 0.0;
}

/// What is due after a step.
void Trainer::log_and_save() {
  if (step_ % options_.log_every == 0 || step_ == options_.iterations) log_metrics();
  if (!writes()) return;
  if (step_ % options_.checkpoint_every == 0) save_checkpoint();
  if (options_.images_every > 0 && step_ % options_.images_every == 0) write_beside([&] { save_images(); });
}

void Trainer::finish_files(StopReason reason) {
  if (saved_step_ != step_) save_checkpoint();
  // From here on the checkpoint is safe, so that what cannot be written is an error.
  metrics_->finish();
  if (validation_) validation_->finish();
  tensorboard_->finish();
  if (reason != StopReason::interrupted) save_images();
  write_report(run_);
}

std::optional<StopReason> Trainer::reason_to_stop() const {
  if (ranks_) return agreed_stop_;
  if (out_of_time()) return StopReason::time_limit;
  return stop_requested() ? std::optional(StopReason::interrupted) : std::nullopt;
}

/// The ranks make sure that they train the same, and share the batches from now on.
void Trainer::join_ranks() {
  if (!ranks_) return;
  ranks_->check_same("the instruction set (set DOPPEL_ISA alike on all)", isa_name(cpu_isa()));
  ranks_->check_same("the data or the character", stage_.identity());
  const torch::NoGradGuard no_grad;
  for (const torch::Tensor& tensor : stage_.model().parameters()) ranks_->broadcast(tensor);
  for (const torch::Tensor& tensor : stage_.model().buffers()) ranks_->broadcast(tensor);
  stage_.share_batches(*ranks_);
  share_batch_statistics(stage_.model(), ranks_);
}

/// The newest checkpoint; rank 0 chooses it for all.
std::optional<std::pair<std::int64_t, Checkpoint>> Trainer::find_checkpoint() {
  if (!ranks_) return checkpoints_.load_latest();
  std::optional<std::pair<std::int64_t, Checkpoint>> found;
  if (writes()) found = checkpoints_.load_latest();
  const std::string step = ranks_->broadcast(found ? std::to_string(found->first) : std::string());
  if (step.empty() || found) return found;
  const std::int64_t number = std::stoll(step);
  return std::pair(number, Checkpoint::load(checkpoints_.path(number)));
}

void Trainer::resume() {
  stage_.model().train();
  auto found = find_checkpoint();
  if (!found) return;
  const Checkpoint& checkpoint = found->second;
  check_same_data(checkpoint, stage_, run_.path());
  load_module(stage_.model(), "model.", checkpoint);
  step_ = saved_step_ = checkpoint.integer("step");
  adam_.load(checkpoint, [this](const std::string& parameter) { return is_trained_later(parameter); });
  generator_.set_state(checkpoint.tensor("generator.run"));
  global_generator().set_state(checkpoint.tensor("generator.global"));
  stage_.restore_data(checkpoint.text("data"));
  window_.restore(checkpoint.text("metrics"));
  earlier_seconds_ = checkpoint.number("seconds");
  last_loss_ = checkpoint.number("loss");
  // A kill may have come between the checkpoint and its note.
  if (writes()) checkpoints_.note(step_, checkpoint);
  warn_of_other_machine(checkpoint);
  log::info("resuming {} at step {}", stage_.name(), step_);
}

double Trainer::step() {
  Profile profile;
  StepContext context{step_, generator_, &profile, ranks_, {}};
  adam_.zero_grad();
  const LossTerms terms = stage_.loss(context);
  std::vector<double> share;
  const auto values = evaluate(terms, context.share, share);
  double loss = 0.0;
  for (const auto& value : values) loss += value.weighted;

  {
    ProfileScope scope(profile, "backward");
    backward(terms, share);
  }
  if (ranks_) {
    ProfileScope scope(profile, "ranks");
    gradients_.finish();
  }
  double norm = 0.0;
  {
    ProfileScope scope(profile, "optimiser");
    norm = adam_.gradient_norm();
    check_gradients(norm, terms);
    adam_.step(options_.schedule.rate(step_), norm);
  }
  window_.add(values, norm, profile);
  ++step_;
  return loss;
}

void Trainer::backward(const LossTerms& terms, const std::vector<double>& share) {
  torch::Tensor total;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (terms[i].weight == 0.0) continue;
    const torch::Tensor weighted = terms[i].value * (terms[i].weight * share[i]);
    total = total.defined() ? total + weighted : weighted;
  }
  if (total.defined() && total.requires_grad()) total.backward();
}

std::vector<MetricsRecord::Term> Trainer::evaluate(const LossTerms& terms, const BatchShare& batch,
                                                   std::vector<double>& share) {
  std::vector<double> raw;
  for (const LossTerm& term : terms) raw.push_back(term.value.item<double>());
  share.assign(terms.size(), 1.0);
  if (ranks_) average_over_ranks(terms, batch, raw, share);
  std::vector<MetricsRecord::Term> values;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (!std::isfinite(raw[i])) fail_not_finite(fmt::format("the loss term `{}` is {}", terms[i].name, raw[i]));
    values.push_back({terms[i].name, raw[i], raw[i] * terms[i].weight});
  }
  return values;
}

/// The means of the terms over the whole batch, and this rank's share of each. The wish to stop travels along.
void Trainer::average_over_ranks(const LossTerms& terms, const BatchShare& batch, std::vector<double>& raw,
                                 std::vector<double>& share) {
  const std::size_t n = terms.size();
  std::vector<double> sums(2 * n + 2, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    share[i] = terms[i].items ? terms[i].items() : static_cast<double>(batch.count);
    sums[i] = raw[i] * share[i];
    sums[n + i] = share[i];
  }
  sums[2 * n] = stop_requested() ? 1.0 : 0.0;
  sums[2 * n + 1] = writes() && out_of_time() ? 1.0 : 0.0;  // by the clock of rank 0
  ranks_->sum(torch::from_blob(sums.data(), {static_cast<std::int64_t>(sums.size())}, torch::kFloat64));
  for (std::size_t i = 0; i < n; ++i) {
    const double all = sums[n + i];
    raw[i] = all > 0.0 ? sums[i] / all : sums[i];
    share[i] = all > 0.0 ? share[i] / all : 0.0;
  }
  if (sums[2 * n] > 0.0) agreed_stop_ = StopReason::interrupted;
  if (sums[2 * n + 1] > 0.0) agreed_stop_ = StopReason::time_limit;
}

void Trainer::check_gradients(double norm, const LossTerms& terms) {
  if (std::isfinite(norm)) return;
  const auto parameter = adam_.non_finite_gradient();
  // Finding the term at fault would need a new pass over the batch for each term. Their values are enough.
  std::string values;
  for (const LossTerm& term : terms)
    values += fmt::format("{}{} = {:.6g}", values.empty() ? "" : ", ", term.name, term.value.item<double>());
  fail_not_finite(parameter ? fmt::format("the gradient of `{}` is not finite ({})", *parameter, values)
                            : fmt::format("the gradient's norm overflows ({})", values));
}

void Trainer::fail_not_finite(const std::string& what) const {
  const std::string kept = saved_step_ >= 0 ? fmt::format("The checkpoint of step {} is kept.", saved_step_)
                                            : std::string("There is no checkpoint yet.");
  fail("stage {}, step {}: {}. Batch: {}. {} Lower train.learning_rate, set train.clip_norm, or look at these frames.",
       stage_.name(), step_ + 1, what, stage_.batch_description(), kept);
}

void Trainer::log_metrics() {
  MetricsRecord record = window_.take();
  record.step = step_;
  record.seconds = seconds();
  record.learning_rate = options_.schedule.rate(step_ - 1);
  record.memory_mb = private_megabytes();
  last_loss_ = record.loss;
  if (!writes()) return;
  metrics_->append(record);
  std::vector<std::pair<std::string, double>> scalars = {
      {"loss", record.loss}, {"learning_rate", record.learning_rate}, {"gradient_norm", record.gradient_norm}};
  for (const auto& term : record.terms) {
    scalars.emplace_back("raw/" + term.name, term.raw);
    scalars.emplace_back("weighted/" + term.name, term.weighted);
  }
  scalars.emplace_back("memory_mb", record.memory_mb);
  for (const auto& [part, time] : record.milliseconds) scalars.emplace_back("milliseconds/" + part, time);
  tensorboard_->add_scalars(step_, scalars);
}

void Trainer::save_checkpoint() {
  Checkpoint checkpoint;
  checkpoint.set_text("stage", stage_.name());
  checkpoint.set_text("identity", stage_.identity());
  checkpoint.set_text("content", stage_.content());
  checkpoint.set_text("cameras", fmt::format("{}", fmt::join(stage_.camera_names(), "\n")));
  checkpoint.set_text("frames_per_second", fmt::format("{:.17g}", stage_.frames_per_second()));
  checkpoint.set_text("step", std::to_string(step_));
  checkpoint.set_text("seconds", fmt::format("{:.17g}", seconds()));
  checkpoint.set_text("loss", fmt::format("{:.17g}", last_loss_));
  checkpoint.set_text("data", stage_.data_state());
  checkpoint.set_text("metrics", window_.state());
  checkpoint.set_text("machine", present_machine());
  checkpoint.set_text("config", read_file(run_.config()));
  checkpoint.set_tensor("generator.run", generator_state(generator_));
  checkpoint.set_tensor("generator.global", generator_state(global_generator()));
  save_module(stage_.model(), "model.", checkpoint);
  adam_.save(checkpoint, [this](const std::string& parameter) { return is_trained_later(parameter); });
  save_evaluation(checkpoint);
  checkpoints_.save(step_, checkpoint);
  saved_step_ = step_;
  write_beside([&] { write_report(run_); });
}

void Trainer::save_evaluation(Checkpoint& checkpoint) {
  torch::NoGradGuard no_grad;
  torch::nn::Module& model = stage_.model();
  Checkpoint present;  // the evaluation weights temporarily replace those of the model
  for (const auto& item : model.named_parameters()) present.set_tensor(item.key(), item.value().clone());
  for (const auto& item : model.named_buffers())
    if (item.value().defined()) present.set_tensor(item.key(), item.value().clone());

  auto parameters = model.named_parameters();
  for (const auto& [name, mean] : adam_.mean_weights()) parameters[name].copy_(mean);
  share_batch_statistics(model, nullptr);  // the other ranks take no part in this
  stage_.prepare_evaluation();
  for (const auto& item : model.named_buffers())
    if (item.value().defined()) checkpoint.set_tensor("evaluation." + item.key(), item.value().clone());
  model.eval();
  // Only at steps that do not depend on when a session ends, so that a resumed run equals an unbroken one.
  std::optional<double> loss;
  if (step_ % options_.checkpoint_every == 0 || step_ == options_.iterations) loss = stage_.validation_loss(step_);
  load_module(model, "", present);
  model.train();
  share_batch_statistics(model, ranks_);
  if (!loss) return;
  checkpoint.set_validation_loss(*loss);
  write_beside([&] { log_validation(*loss); });
}

void Trainer::log_validation(double loss) {
  MetricsRecord record;
  record.step = step_;
  record.seconds = seconds();
  record.loss = loss;
  // A session that was killed after this line and before the checkpoint wrote the line already.
  if (!validation_) validation_ = std::make_unique<MetricsFile>(run_.validation(), step_ - 1);
  validation_->append(record);
  tensorboard_->add_scalars(step_, {{"validation/loss", loss}});
}

void Trainer::save_images() {
  torch::NoGradGuard no_grad;
  torch::nn::Module& model = stage_.model();
  model.eval();
  const std::vector<ReportImage> images = stage_.images();
  model.train();  // before anything is written, which may fail
  for (const ReportImage& image : images) {
    std::vector<unsigned char> jpeg;
    cv::imencode(".jpg", image.image, jpeg, {cv::IMWRITE_JPEG_QUALITY, 88});
    write_atomically(run_.images() / (image.name + ".jpg"), std::string(jpeg.begin(), jpeg.end()));
    write_atomically(run_.images() / (image.name + ".txt"), fmt::format("step {}: {}\n", step_, image.caption));
    tensorboard_->add_image(step_, image.name, image.image);
  }
}

double Trainer::seconds() const {
  return earlier_seconds_ + std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

bool Trainer::out_of_time() const { return options_.max_minutes > 0.0 && seconds() >= 60.0 * options_.max_minutes; }

}  // namespace doppel
