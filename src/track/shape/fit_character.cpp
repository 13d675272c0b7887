#include "doppel/track/shape/fit_character.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "doppel/character/landmark_positions.h"
#include "doppel/character/landmarks.h"
#include "doppel/core/as_size.h"
#include "doppel/core/log.h"
#include "doppel/track/shape/texture_bake.h"
#include "doppel/track/track_sheet.h"
#include "doppel/track/track_surface.h"
#include "doppel/track/track_task.h"

namespace doppel {
namespace {

/// Reads the images of posed frames again; keeping those of all frames could take gigabytes.
class PosedImages {
 public:
  PosedImages(const Footage& footage, const PosedFrames& poses) : footage_(footage), poses_(poses) {}
  /// Calls `use` with the index of each frame and what was filmed.
  template <typename Use>
  void each(const Use& use) const {
    std::unique_ptr<FootageReader> reader;
    for (std::size_t f = 0; f < poses_.samples.size(); ++f) {
      const SeenFrames::Sample& sample = poses_.samples[f];
      if (f == 0 || sample.sequence != poses_.samples[f - 1].sequence) reader = footage_.read(sample.sequence);
      use(f, reader->read(sample.frame, true));
    }
  }

 private:
  const Footage& footage_;
  const PosedFrames& poses_;
};

std::vector<FootageSequence> sequences_to_fit(const Footage& footage, const FitCharacterOptions& options) {
  TrackTask task;
  task.sequences = options.sequences;
  if (task.sequences.empty())
    for (const SequenceEntry& entry : footage.capture().sequences)
      if (entry.split == Split::train) task.sequences.push_back(entry.name);
  return chosen_sequences(footage, task);
}

void bake(const Footage& footage, const FitCharacterOptions& options, FittedCharacter& fitted, Progress& progress) {
  TextureBake texture(fitted.character.mesh, options.texture_size);
  const PoseModel poses(fitted.character, {}, {});
  bool any = false;
  PosedImages(footage, fitted.poses).each([&](std::size_t f, const FootageFrame& seen) {
    const auto surface = posed_vertices(poses, poses.pose(fitted.poses.frames[f].dofs, false));
    for (std::size_t c = 0; c < seen.images.size(); ++c) {
      if (seen.images[c].empty()) continue;
      texture.add(surface, footage.cameras()[c], static_cast<int>(c), seen.images[c], seen.masks[c]);
      any = true;
    }
    progress.advance(1, "texture");
  });
  if (!any) {
    log::warn("the sequences have no images, so the character has no texture");
    return;
  }
  fitted.texture_coverage = texture.coverage();
  fitted.character.mesh.texture = texture.texture();
}

cv::Mat sheet_of(const Footage& footage, const FitCharacterOptions& options, const FittedCharacter& fitted) {
  const PoseModel model(fitted.character, fitted.landmarks, {});
  TrackSheet sheet(footage.cameras(), model);
  const std::size_t count = fitted.poses.frames.size();
  const std::size_t step = std::max<std::size_t>(1, count / as_size(std::max(1, options.sheet_frames)));
  PosedImages(footage, fitted.poses).each([&](std::size_t f, const FootageFrame& seen) {
    if (f % step != 0) return;
    TrackedFrame found;
    found.dofs = fitted.poses.frames[f].dofs;
    found.state = FrameState::tracked;
    sheet.add(fitted.poses.samples[f].frame, seen, found);
  });
  return sheet.image();
}

/// Warns when the cameras disagree about the landmarks: the body can then follow none of them.
void warn_of_disagreement(const Footage& footage, const SeenFrames& frames) {
  constexpr double kUsual = 8.0;  // reference pixels
  const double residual =
      triangulation_residual(footage.cameras(), frames, static_cast<int>(footage.landmarks().size()));
  if (residual > kUsual)
    log::warn(
        "the cameras disagree about the landmarks by {:.1f} pixels (of an image 1024 wide); `doppel calibrate refine "
        "{}` "
        "may mend the calibration, and `doppel doctor` says more",
        residual, footage.capture().file.string());
}

/// The template bent to the outlines of all frames.
Character bent_template(const Footage& footage, const FitCharacterOptions& options, const FittedCharacter& fitted,
                        Progress& progress) {
  TemplateFit fit(fitted.character, fitted.landmarks, footage.cameras(), options.config.surface);
  for (const PosedEvidence& frame : fitted.poses.frames) {
    fit.add(frame.seen, frame.dofs);
    progress.advance(1, "surface");
  }
  return fit.character();
}

/// Bends the template and finds the poses again, while their overlap with the masks grows.
void bend(const Footage& footage, const SeenFrames& frames, const FitCharacterOptions& options, FittedCharacter& fitted,
          Progress& progress) {
  for (int round = 0; round < options.bends; ++round) {
    Character bent = bent_template(footage, options, fitted, progress);
    PosedFrames poses = find_poses(bent, fitted.landmarks, footage.cameras(), frames, options.config);
    log::info("surface bent to the outlines: IoU of the template {:.4f}, {:.4f} before", poses.overlap,
              fitted.poses.overlap);
    if (poses.overlap <= fitted.poses.overlap) {
      progress.drop(static_cast<std::int64_t>(fitted.poses.frames.size()) * (options.bends - 1 - round));
      return;
    }
    fitted.character = std::move(bent);
    fitted.poses = std::move(poses);
  }
}

}  // namespace

FittedCharacter fit_character(const ShapeFamily& family, const Footage& footage, const FitCharacterOptions& options) {
  const std::vector<FootageSequence> sequences = sequences_to_fit(footage, options);
  warn_without_masks(sequences);
  const bool masks = std::all_of(sequences.begin(), sequences.end(), [](const auto& s) { return s.has_masks; });
  const std::vector<std::string> names = landmark_names(footage.landmarks());
  const int bends = masks ? options.bends : 0;
  Progress progress("fit", static_cast<std::int64_t>(options.frames) * (2 + bends) + 2 * (options.shape.rounds + 1));
  const SeenFrames frames = see_frames(footage, sequences, options.frames, progress);
  warn_of_disagreement(footage, frames);

  ShapedCharacter shaped =
      find_shape(family, names, footage.cameras(), frames, options.config, options.shape, progress);
  ShapedCharacter placed = find_shape(LandmarkPositions(shaped.character, names), names, footage.cameras(), frames,
                                      options.config, options.shape, progress);
  FittedCharacter fitted;
  fitted.landmarks = markers_named(placed.character.skeleton, names);
  fitted.parameters = std::move(shaped.parameters);
  fitted.character = std::move(shaped.character);
  fitted.poses = std::move(placed.poses);
  fitted.measured_overlap = fitted.poses.overlap;
  if (masks) bend(footage, frames, options, fitted, progress);
  if (options.texture_size > 0) bake(footage, options, fitted, progress);
  fitted.sheet = sheet_of(footage, options, fitted);
  progress.finish();
  return fitted;
}

}  // namespace doppel
