#include "doppel/view/view_subject.h"

#include <algorithm>

#include "doppel/actor/export/actor_file.h"
#include "doppel/actor/export/animation.h"
#include "doppel/actor/run_folder.h"
#include "doppel/actor/run_stages.h"
#include "doppel/actor/trained_actor.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/filmed_sequence.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/dataset/dataset.h"
#include "doppel/io/motion_import/read_motion_file.h"
#include "doppel/layers/surface.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

ViewStage skinning_stage(const Character& character) {
  return {"skinning", 0, [surface = CharacterSurface(character)](const torch::Tensor& window) mutable {
            return surface->skinned(window.select(1, window.size(1) - 1));
          }};
}

/// A stage with the vertices of `geometry`.
ViewStage on_geometry(const char* name, const ViewStage& geometry) {
  ViewStage stage{name, geometry.past_frames, geometry.vertices};
  stage.geometry = geometry.name;
  return stage;
}

/// A stage with the vertices of `geometry` and a dynamic texture.
ViewStage textured_stage(const ViewStage& geometry, LookFunction texture, int size) {
  ViewStage stage = on_geometry("textured", geometry);
  stage.texture = std::move(texture);
  stage.texture_size = size;
  return stage;
}

/// A stage with the vertices of `geometry`, drawn as Gaussians.
ViewStage gaussian_stage(const ViewStage& geometry, LookFunction gaussians, int count) {
  ViewStage stage = on_geometry("gaussians", geometry);
  stage.gaussians = std::move(gaussians);
  stage.num_gaussians = count;
  return stage;
}

ViewSubject of_character(const fs::path& path) {
  ViewSubject subject;
  subject.character = load_character(path);
  subject.stages = {skinning_stage(subject.character)};
  return subject;
}

/// A test sequence that can be played, else the first sequence that can; null without.
template <typename Sequences, typename Playable>
auto sequence_to_play(const Sequences& sequences, const Playable& playable) {
  const typename Sequences::value_type* chosen = nullptr;
  for (const auto& sequence : sequences)
    if (playable(sequence) && (!chosen || (chosen->split != Split::test && sequence.split == Split::test)))
      chosen = &sequence;
  return chosen;
}

/// The cameras of a sequence. Footage that is missing or does not fit hides no double.
std::shared_ptr<ViewCameras> cameras_of(const Capture& capture, const std::string& sequence) {
  for (const SequenceEntry& entry : capture.sequences) {
    if (entry.name != sequence) continue;
    try {
      auto cameras = std::make_shared<ViewCameras>(capture, entry);
      return cameras->size() > 0 ? cameras : nullptr;
    } catch (const std::exception& e) {
      log::warn("the cameras are not shown: {}", e.what());
    }
  }
  return nullptr;
}

void take_motion(ViewSubject& subject, const Dataset& dataset) {
  subject.frames_per_second = dataset.fps();
  if (const auto* chosen = sequence_to_play(dataset.sequences(), [](const auto& s) { return s.has_motion(); })) {
    subject.motion = chosen->motion;
    subject.cuts = chosen->cuts;
    subject.cameras = cameras_of(dataset.capture(), chosen->name);
  }
}

ViewSubject of_prepared(const fs::path& folder) {
  const Dataset dataset = Dataset::open(folder);
  ViewSubject subject = of_character(dataset.character_path());
  take_motion(subject, dataset);
  return subject;
}

ViewSubject of_run(const fs::path& run, const ViewOptions& options) {
  // A run of posenet or deepcap has no actor: its person is shown with the skin alone.
  const fs::path checkpoints = RunFolder(stage_folder(run, "egnet")).checkpoints();
  if (captures_poses(run) || !fs::exists(checkpoints) || fs::is_empty(checkpoints))
    return of_prepared(options.capture.empty() ? run_subject(run).capture : options.capture);
  const auto capture = options.capture.empty() ? std::nullopt : std::make_optional(options.capture);
  const auto trained = std::make_shared<TrainedActor>(TrainedActor::load(run, capture));
  ViewSubject subject;
  subject.character = trained->character;
  subject.stages = {
      skinning_stage(subject.character),
      {"egnet", trained->past_frames(), [trained](const torch::Tensor& w) { return trained->coarse(w); }}};
  if (trained->deltanet)
    subject.stages.push_back(
        {"deltanet", trained->past_frames(), [trained](const torch::Tensor& w) { return trained->fine(w); }});
  const ViewStage finest = subject.stages.back();
  if (trained->texnet && !options.geometry_only)
    subject.stages.push_back(textured_stage(
        finest,
        [trained](const auto& w, const auto& camera, const auto& surface) {
          return trained->texture(w, camera, surface);
        },
        static_cast<int>(trained->texnet->config().texture_size())));
  if (trained->gaussians && !options.geometry_only)
    subject.stages.push_back(gaussian_stage(
        finest,
        [trained](const auto& w, const auto& camera, const auto& surface) {
          return trained->gaussian_rows(w, camera, surface);
        },
        trained->gaussians->count()));
  subject.networks = {{"egnet", trained->egnet.get()}};
  if (trained->deltanet) subject.networks.emplace_back("deltanet", trained->deltanet.get());
  if (trained->texnet && !options.geometry_only) subject.networks.emplace_back("texnet", trained->texnet.get());
  if (trained->gaussians && !options.geometry_only)
    subject.networks.emplace_back("surface_gaussians", trained->gaussians.get());
  take_motion(subject, trained->subject.open_dataset());
  return subject;
}

ViewSubject of_actor_file(const fs::path& path, const fs::path& character) {
  if (character.empty())
    fail<UsageError>("viewing {}: an actor file holds no skeleton; name its character with --character FILE",
                     path.string());
  ViewSubject subject = of_character(character);
  const auto file = std::make_shared<ActorFile>(ActorFile::load(path));
  const ActorDescription& d = file->description();
  check_belongs_together(subject.character, *file);
  subject.frames_per_second = d.frames_per_second;
  subject.stages.push_back({"actor", d.past_frames, [file](const torch::Tensor& w) { return file->forward(w); }});
  const ViewStage geometry = subject.stages.back();
  if (d.texture_size > 0)
    subject.stages.push_back(textured_stage(
        geometry,
        [file](const auto& w, const auto& camera, const auto& surface) { return file->texture(w, camera, surface); },
        d.texture_size));
  if (d.num_gaussians > 0)
    subject.stages.push_back(gaussian_stage(
        geometry,
        [file](const auto& w, const auto& camera, const auto& surface) { return file->gaussians(w, camera, surface); },
        d.num_gaussians));
  return subject;
}

/// A sequence of which there are images; null without.
const SequenceEntry* filmed_sequence(const Capture& capture) {
  const CaptureCameras cameras = choose_cameras(capture);
  return sequence_to_play(capture.sequences, [&](const SequenceEntry& sequence) {
    if (sequence.videos.empty()) return false;
    for (std::size_t c = 0; c < cameras.cameras.size(); ++c)
      if (has_images(capture, sequence, cameras.cameras[c], cameras.file_index[c])) return true;
    return false;
  });
}

/// A capture before its character is made.
ViewSubject of_filmed_sequence(const Capture& capture) {
  const SequenceEntry* chosen = filmed_sequence(capture);
  if (!chosen)
    fail("viewing {}: there is neither a character nor a video of any camera; add one of them to {}", capture.name,
         capture.file.empty() ? "its capture.yaml" : capture.file.string());
  ViewSubject subject;
  subject.frames_per_second = capture.fps;
  subject.cameras = std::make_shared<ViewCameras>(capture, *chosen);
  subject.sequence = open_view_sequence(capture, *chosen, *subject.cameras);
  return subject;
}

/// The cameras of a capture whose motion is not known; null where it has no images, or its calibration cannot be read.
std::shared_ptr<ViewCameras> cameras_beside_rest_pose(const Capture& capture) {
  try {
    const SequenceEntry* filmed = filmed_sequence(capture);
    return filmed ? cameras_of(capture, filmed->name) : nullptr;
  } catch (const Error& e) {
    log::warn("the cameras are not shown: {}", e.what());
    return nullptr;
  }
}

ViewSubject of_capture(const Capture& capture, const ViewOptions& options) {
  // With a motion, a capture without a character gets the message of `character_path`.
  if (capture.character.empty() && options.motion.empty()) return of_filmed_sequence(capture);
  ViewSubject subject = of_character(capture.character_path());
  subject.frames_per_second = capture.fps;
  if (const auto* chosen = sequence_to_play(capture.sequences, [](const auto& s) { return !s.motion.empty(); })) {
    subject.motion = read_motion(capture.resolve(chosen->motion), subject.character.num_dofs());
    subject.cuts = chosen->cuts;
    subject.cameras = cameras_of(capture, chosen->name);
  } else {
    subject.cameras = cameras_beside_rest_pose(capture);
  }
  return subject;
}

bool is_prepared(const fs::path& folder) { return fs::exists(folder / "store"); }

ViewSubject open_target(const fs::path& target, const ViewOptions& options) {
  const std::string extension = target.extension().string();
  if (!options.character.empty() && extension != ".pt")
    fail<UsageError>("viewing {}: --character names the character of an exported actor (.pt); other targets have one",
                     target.string());
  const bool is_run = fs::exists(target / "config.yaml") && !is_prepared(target);
  if (!options.capture.empty() && !is_run)
    fail<UsageError>("viewing {}: --capture is for runs, whose prepared capture was moved", target.string());
  if (extension == ".character") return of_character(target);
  if (extension == ".pt") return of_actor_file(target, options.character);
  if (is_prepared(target)) return of_prepared(target);
  if (is_run) {
    ViewSubject subject = of_run(target, options);
    subject.run = target;
    return subject;
  }
  if (const auto recognised = recognise_capture(target)) return of_capture(recognised->capture, options);
  fail<UsageError>(
      "viewing {}: neither a run, an actor file (.pt), a .character file, a capture nor a prepared capture; `doppel "
      "capture init` describes a folder with videos and calibration",
      target.string());
}

}  // namespace

ViewSubject open_view_subject(const fs::path& target, const ViewOptions& options) {
  ViewSubject subject = open_target(target, options);
  if (!options.motion.empty()) {
    subject.motion = motion_for(subject, options.motion);
    subject.cuts.clear();
    subject.cameras = nullptr;
  }
  if (subject.motion.num_frames() == 0 && !subject.sequence) subject.motion = {{subject.character.rest_dofs}, {0}};
  return subject;
}

Motion motion_for(const ViewSubject& subject, const fs::path& file) {
  MotionFileOptions wanted;
  wanted.frames_per_second = subject.frames_per_second;
  MotionFromFile read = read_motion_file(file, subject.character, wanted);
  for (const std::string& warning : read.warnings) log::warn("{}: {}", file.string(), warning);
  return std::move(read.motion);
}

}  // namespace doppel
