#include "doppel/track/refine/refine_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "doppel/character/character_folder.h"
#include "doppel/core/clock.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/statistics.h"
#include "doppel/track/sequence_runner.h"
#include "doppel/track/shape/shape_and_poses.h"
#include "doppel/track/shape/texture_bake.h"
#include "doppel/track/track_results.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

constexpr double kStay = 2.5e3;  // of offsets, per squared metre and for each frame
// A pose has many matches: half of the resolution suffices, at a quarter of the time. Texels need all of it.
constexpr double kPoseFlowWidth = 512.0;
constexpr int kSmoothingDegree = 2;  // a weighted mean would flatten fast motions of limbs

Motion motion_of(const Footage& footage, const FootageSequence& sequence) {
  if (sequence.motion.empty())
    fail<UsageError>("the sequence {} has no motion to refine; run `doppel track` first", sequence.name);
  Motion motion = read_motion(sequence.motion, footage.character().num_dofs());
  if (motion.num_frames() <= sequence.last_frame)
    fail("{} has {} rows, but the sequence {} is used up to row {}", sequence.motion, motion.num_frames(),
         sequence.name, sequence.last_frame);
  return motion;
}

void require_images(const Footage& footage, const FootageFrame& seen, const std::string& sequence) {
  for (std::size_t c = 0; c < seen.images.size(); ++c)
    if (seen.images[c].empty())
      fail("sequence {}: the camera {} has no images; the refinement compares the texture with them", sequence,
           footage.cameras()[c].name);
}

/// A frame from which texture and template are learnt.
struct TrainingFrame {
  int sequence = 0;  ///< index in `Footage::sequences`
  long row = 0;      ///< of the motion
  std::vector<double> dofs;
};

/// About `count` frames, spread evenly over the sequences together, at least one of each.
std::vector<TrainingFrame> choose_frames(const Footage& footage, const std::vector<FootageSequence>& sequences,
                                         int count) {
  std::vector<TrainingFrame> frames;
  const double total = static_cast<double>(count_frames(sequences));
  for (const FootageSequence& sequence : sequences) {
    const Motion motion = motion_of(footage, sequence);
    const int own = std::max(1, static_cast<int>(std::lround(count * sequence.num_frames() / total)));
    for (const long frame : spread_frames(sequence, own))
      frames.push_back({sequence.index, frame, motion.frames[frame]});
  }
  return frames;
}

/// Step 1: texture and template. Advances by one for each training frame and round, and for each frame of the first
/// texture.
class CharacterRefiner {
 public:
  CharacterRefiner(const Footage& footage, const std::vector<FootageSequence>& sequences, const RefineOptions& options,
                   Progress& progress)
      : footage_(footage),
        options_(options),
        progress_(progress),
        character_(footage.character()),
        frames_(choose_frames(footage, sequences, options.frames)) {
    if (character_.mesh.uvs.empty())
      fail(
          "the character {} has no texture coordinates, which the refinement needs; `doppel character create` makes "
          "them",
          footage.capture().character);
  }

  Character refine() {
    first_texture();
    for (int round = 0; round < options_.rounds; ++round) refine_round(round);
    return std::move(character_);
  }

 private:
  template <typename Use>
  void each_frame(const Use& use) {
    std::unique_ptr<FootageReader> reader;
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      TrainingFrame& frame = frames_[i];
      const FootageSequence& sequence = footage_.sequences()[frame.sequence];
      check_not_stopped(sequence, frame.row);
      if (i == 0 || frame.sequence != frames_[i - 1].sequence) reader = footage_.read(frame.sequence);
      const FootageFrame seen = reader->read(frame.row, true);
      require_images(footage_, seen, sequence.name);
      use(frame, seen);
    }
  }

  void first_texture() {
    TextureBake bake(character_.mesh, options_.texture_size);
    const PoseModel model(character_, footage_.landmarks(), {});
    std::vector<TrainingFrame> found;
    each_frame([&](const TrainingFrame& frame, const FootageFrame& seen) {
      progress_.advance(1, "first texture");
      if (!judge_pose(model, footage_.cameras(), seen.evidence, frame.dofs, options_.config.fit).found()) return;
      const auto surface = posed_vertices(model, model.pose(frame.dofs, false));
      for (std::size_t c = 0; c < seen.images.size(); ++c)
        bake.add(surface, footage_.cameras()[c], static_cast<int>(c), seen.images[c], seen.masks[c]);
      found.push_back(frame);
    });
    if (found.empty()) fail("no pose of the training frames explains its keypoints; is this their motion?");
    frames_ = std::move(found);
    character_.mesh.texture = bake.texture();
  }

  void refine_round(int round) {
    FrameRefiner refiner(character_, footage_.landmarks(), footage_.cameras(), options_.config, options_.weights);
    TextureBake bake(character_.mesh, options_.texture_size);
    SurfaceOffset offset(character_.mesh);
    std::vector<double> distances, overlaps;
    each_frame([&](TrainingFrame& frame, const FootageFrame& seen) {
      overlaps.push_back(refiner.overlap(seen, frame.dofs));
      const FrameFlow flow = refiner.flow(seen, frame.dofs);
      for (std::size_t c = 0; c < seen.images.size(); ++c) {
        const AlignedFilm aligned = align_film(flow.views[c], seen.images[c]);
        bake.add(flow.vertices, footage_.cameras()[c], static_cast<int>(c), aligned.image, aligned.mask);
      }
      if (flow.distance) distances.push_back(*flow.distance);
      const TrackedFrame fitted = refiner.fit(seen, flow.matches, frame.dofs);
      if (fitted.found()) frame.dofs = fitted.dofs;
      refiner.add_to(offset, seen, flow.matches, frame.dofs);
      progress_.advance(1, fmt::format("round {}", round + 1));
    });
    if (distances.empty())
      fail("the images show nothing of the texture in any training frame; do poses and calibration fit the images?");
    log::info("refinement, round {}: texture {:.2f} pixels off, IoU {:.4f}", round + 1, mean_of(distances),
              mean_of(overlaps));
    character_.mesh.texture = bake.texture();
    const auto count = static_cast<double>(frames_.size());
    const auto offsets = offset.solve(options_.smoothness * count, kStay * count);
    for (std::size_t v = 0; v < offsets.size(); ++v) character_.mesh.vertices[v] += offsets[v];
  }

  const Footage& footage_;
  const RefineOptions& options_;
  Progress& progress_;
  Character character_;
  std::vector<TrainingFrame> frames_;
};

/// Step 2: moves each pose of a motion to its matches. A pose that then explains too few keypoints stays as it was.
class RefineFrames : public FrameTracker {
 public:
  RefineFrames(const Footage& footage, const Character& character, const RefineOptions& options)
      : weights_(for_poses(options.weights)),
        refiner_(character, footage.landmarks(), footage.cameras(), options.config, weights_) {}

  /// The poses to start from; the next frame that is tracked is row `first`.
  void start(const Motion& motion, long first) {
    motion_ = &motion;
    row_ = first;
  }
  FrameResult track(const FootageFrame& seen) override {
    const auto start = Clock::now();
    FrameResult result;
    result.pose = refiner_.judge(seen, motion_->frames[row_++]);
    for (int pass = 0; pass < weights_.passes; ++pass) {
      const FrameFlow flow = refiner_.flow(seen, result.pose.dofs);
      TrackedFrame next = refiner_.fit(seen, flow.matches, result.pose.dofs);
      if (result.pose.found() && !next.found()) break;
      next.iterations += result.pose.iterations;
      result.pose = std::move(next);
    }
    result.pose_seconds = seconds_since(start);
    return result;
  }
  void cut() override {}
  void pause() override {}
  ImageUse image_use() const override { return ImageUse::required; }
  const PoseModel& model() const override { return refiner_.model(); }

 private:
  static RefineWeights for_poses(RefineWeights weights) {
    weights.flow_width = std::min(weights.flow_width, kPoseFlowWidth);
    return weights;
  }

  RefineWeights weights_;
  FrameRefiner refiner_;
  const Motion* motion_ = nullptr;
  long row_ = 0;
};

/// Those from which texture and template are learnt, whichever sequences the task names.
std::vector<FootageSequence> training_sequences(const Footage& footage, const RefineOptions& options) {
  TrackTask all;
  all.limit_frames = options.limit_frames;
  std::vector<FootageSequence> training;
  for (const FootageSequence& sequence : chosen_sequences(footage, all))
    if (footage.capture().sequences[sequence.index].split == Split::train) training.push_back(sequence);
  if (training.empty())
    fail<UsageError>("{} has no sequence with `split: train`, from which texture and template are learnt",
                     footage.capture().file.string());
  return training;
}

}  // namespace

TrackReport refine_capture(const Footage& footage, const RefineOptions& options) {
  open_out_folder(footage, options.out, "refine");
  const std::vector<FootageSequence> chosen = chosen_sequences(footage, options);
  const std::vector<FootageSequence> training = training_sequences(footage, options);
  std::vector<Motion> motions;
  for (const FootageSequence& sequence : chosen) motions.push_back(motion_of(footage, sequence));
  warn_without_masks(chosen);
  Progress progress("refine", count_frames(chosen) + (1 + options.rounds) * static_cast<long>(options.frames));
  const Character refined = CharacterRefiner(footage, training, options, progress).refine();
  TrackReport report;
  report.method = "refine";
  report.character = write_character_folder(options.out / "character", refined.name,
                                            [&](const fs::path& folder) { write_character(folder, refined); });
  RefineFrames tracker(footage, refined, options);
  for (std::size_t i = 0; i < chosen.size() && !is_stopped(report); ++i) {
    const FootageSequence& sequence = chosen[i];
    tracker.start(motions[i], sequence.first_frame);
    SequenceRunner runner(footage, tracker, {options.sheet_frames, options.out / (sequence.name + ".jpg")});
    TrackedSequence tracked = runner.run(sequence, progress);
    make_motion(tracked, tracker.model().root(), options.smoothing, kSmoothingDegree);
    write_poses(refined, footage.capture().fps, options.out, tracked);
    report.sequences.push_back(report_of(footage, std::move(tracked)));
  }
  progress.finish();
  write_results(footage, options, report);
  return report;
}

}  // namespace doppel
