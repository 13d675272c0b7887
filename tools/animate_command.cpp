#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>

#include "animate_engine.h"
#include "animate_rates.h"
#include "command.h"
#include "doppel/actor/draw.h"
#include "doppel/actor/export/animation.h"
#include "doppel/actor/export/correctives/engine_clip.h"
#include "doppel/actor/export/figure_writer.h"
#include "doppel/actor/export/film.h"
#include "doppel/actor/export/splat_rig.h"
#include "doppel/actor/export/splat_writer.h"
#include "doppel/actor/export/texture_writer.h"
#include "doppel/actor/run_folder.h"
#include "doppel/actor/run_stages.h"
#include "doppel/actor/trained_actor.h"
#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/character/bvh.h"
#include "doppel/character/character.h"
#include "doppel/character/loop_motion.h"
#include "doppel/character/resample_motion.h"
#include "doppel/character/root_motion.h"
#include "doppel/core/angles.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/log.h"
#include "doppel/data/capture/video.h"
#include "doppel/data/dataset/dataset.h"
#include "doppel/geometry/image_file.h"
#include "doppel/io/motion_import/read_motion_file.h"
#include "doppel/render/splats/splat_rows.h"
#include "doppel/render/splats/splats.h"

namespace doppel::tools {
namespace {

namespace fs = std::filesystem;

struct AnimateOptions {
  std::string character, model, run, out;
  std::vector<std::string> motions;
  std::string renderer = "mesh";
  std::vector<std::string> formats{"npy"};
  std::string bone_rule = "exact";
  // Motion of another body.
  std::string source_skeleton, map, animation, person, up;
  double unit = 0.0, source_fps = 0.0, fps = 0.0;
  // The camera.
  std::string camera = "orbit", calibration, capture, background, beside, light;
  int size = 0, samples = 3;
  double turns_per_second = 0.1;
  // The figure for other programs.
  std::string names = "skeletool";
  FigureRights rights;
  std::optional<int> morphs;
  EngineOptions engine;
  double tolerance_mm = 0.1;
  bool compress = false;
  bool loop = false;
  std::string root = "travel";
  // Files that state neither unit nor axis.
  std::optional<double> out_unit;
  std::string out_up;

  bool wants(const char* format) const { return std::find(formats.begin(), formats.end(), format) != formats.end(); }
};

// ---- the motion ----

MotionFileOptions motion_options(const AnimateOptions& options, const std::string& motion, const Rates& rates) {
  MotionFileOptions result;
  result.map = options.map;
  result.source_skeleton = options.source_skeleton;
  result.source.animation = options.animation;
  result.source.person = options.person;
  if (!options.up.empty()) result.source.up = options.up[0];
  if (options.unit > 0) result.source.metres_per_unit = options.unit;
  result.source.frames_per_second = rates.source;
  // The rows of the character's own motion are read as they are. A loop needs frames at the times of the result.
  const bool rows_stay =
      options.source_skeleton.empty() && !is_foreign_motion(motion) && rates.source > 0 && !options.loop;
  result.frames_per_second = rows_stay ? rates.source : reading_rate(rates);
  return result;
}

/// @param file name of the map
void write_guessed_map(const AnimateOptions& options, const std::string& file, const JointMap& map) {
  const fs::path path = fs::path(options.out) / file;
  write_atomically(path, joint_map_text(map));
  log::info("{} joints were paired, see {}; if pairs are wrong, correct the file and pass it with --map",
            map.pairs.size(), path.string());
}

nlohmann::json retargeting_json(const RetargetResult& result) {
  nlohmann::json tracks;
  for (const RetargetResult::Track& track : result.tracks)
    tracks.push_back({{"target", track.target},
                      {"source", track.source},
                      {"mean_distance_m", track.mean_distance},
                      {"largest_distance_m", track.largest_distance}});
  return {{"scale", result.scale}, {"joints", tracks}};
}

/// Logs how well the character follows, by the end that stays farthest away.
void log_retargeting(const RetargetResult& result, int frames) {
  const RetargetResult::Track* worst = nullptr;
  for (const RetargetResult::Track& track : result.tracks)
    if (track.end && (!worst || track.largest_distance > worst->largest_distance)) worst = &track;
  if (worst)
    log::info(
        "retargeted {} frames at scale {:.3f}; of feet, hands and head, {} is farthest from the scaled source: {:.1f} "
        "cm",
        frames, result.scale, worst->target, 100 * worst->largest_distance);
}

/// The motion of the character: read from its file, or retargeted from another body.
/// @param name of the clip, for the map of one of several motions
MotionFromFile driven_motion(const AnimateOptions& options, const std::string& motion, const std::string& name,
                             const Character& character, const Rates& rates) {
  MotionFromFile read = read_motion_file(motion, character, motion_options(options, motion, rates));
  for (const std::string& note : read.notes) log::info("{}: {}", motion, note);
  for (const std::string& warning : read.warnings) log::warn("{}: {}", motion, warning);
  if (read.guessed_map)
    write_guessed_map(
        options,
        options.motions.size() + options.engine.unseen.size() > 1 ? "joint_map_" + name + ".yaml" : "joint_map.yaml",
        *read.guessed_map);
  if (read.retargeting) log_retargeting(*read.retargeting, read.motion.num_frames());
  return read;
}

/// The frames of the result.
struct ResultFrames {
  double per_second = 25.0;
  double row_step = 1.0;  ///< from one frame to the next, in rows of the motion's file
};

/// The names of clips: those of their files, and numbers where they repeat.
std::vector<std::string> clip_names(const std::vector<std::string>& files) {
  std::vector<std::string> names;
  for (const std::string& file : files) {
    const std::string stem = fs::path(file).stem().string();
    std::string name = stem;
    for (int number = 2; std::find(names.begin(), names.end(), name) != names.end(); ++number)
      name = fmt::format("{}_{}", stem, number);
    names.push_back(name);
  }
  return names;
}

/// A motion of the character, as it is posed and written.
struct Clip {
  std::string name, file;
  bool unseen = false;     ///< --unseen: it is not fitted
  Motion motion, written;  ///< at the rate of reading, and of the result
  FrameSteps steps;
  ResultFrames frames;
  std::optional<RetargetResult> retargeting;
  std::optional<GroundStep> step;  ///< of one repetition of a loop that travels
};

/// The root of a skeleton whose way can be taken out. @throws UsageError for --root in-place and another skeleton
std::optional<Skeleton::Root> travelling_root(const AnimateOptions& options, const Character& character) {
  const std::optional<Skeleton::Root> root = root_that_travels(character.skeleton);
  if (!root && options.root == "in-place")
    fail<UsageError>("--root in-place: the root of '{}' is not three translations followed by three rotations",
                     character.name);
  return root;
}

/// Makes the motion of a clip cyclic. Someone who comes back ends where he began. Someone who travels goes on from
/// where he is; with --root in-place his heading closes, because his way is taken out later and his turn is not.
void make_loop(const AnimateOptions& options, const Character& character, double fps, Clip& clip) {
  const Skeleton& skeleton = character.skeleton;
  const int blend = blended_frames(clip.motion.num_frames(), fps, static_cast<int>(std::lround(clip.steps.frame)));
  const std::optional<Skeleton::Root> root = travelling_root(options, character);
  GroundStep step;
  if (root) step = loop_step(clip.motion, *root, blend);
  if (options.root == "in-place") step.turn = 0.0;
  if (options.root == "in-place" || is_travel(step)) {
    clip.motion = travelling_loop(clip.motion, skeleton, *root, blend, step);
    if (options.root == "travel") clip.step = step;
  } else {
    clip.motion = loop_motion(clip.motion, skeleton, blend);
  }
  if (clip.step)
    log::info("{}: a repetition starts {:.2f} m along x and {:.2f} m along z further, turned by {:.1f} degrees",
              clip.file, step.way().x(), step.way().y(), step.turn / kRadiansPerDegree);
}

Clip read_clip(const AnimateOptions& options, const std::string& file, const std::string& name,
               const Character& character, std::optional<double> training_rate) {
  const Rates rates = rates_of(file, {options.source_fps, options.fps, training_rate});
  MotionFromFile read = driven_motion(options, file, name, character, rates);
  const double fps = rates.result > 0 ? rates.result : read.frames_per_second;
  Clip clip;
  clip.name = name;
  clip.file = file;
  clip.steps = frame_steps(rates, read.frames_per_second, fps);
  clip.retargeting = std::move(read.retargeting);
  clip.frames = {fps, is_foreign_motion(file) ? 1.0 : row_step(rates, fps)};
  clip.motion = std::move(read.motion);
  if (options.loop) make_loop(options, character, read.frames_per_second, clip);
  clip.written = resample(clip.motion, character.skeleton, clip.steps.frame);
  if (options.root == "in-place") clip.written = in_place(*travelling_root(options, character), clip.written);
  return clip;
}

std::vector<Clip> read_clips(const AnimateOptions& options, const Character& character,
                             std::optional<double> training_rate) {
  std::vector<std::string> files = options.motions;
  files.insert(files.end(), options.engine.unseen.begin(), options.engine.unseen.end());
  const std::vector<std::string> names = clip_names(files);
  std::vector<Clip> clips;
  for (std::size_t i = 0; i < names.size(); ++i) {
    clips.push_back(read_clip(options, files[i], names[i], character, training_rate));
    clips.back().unseen = i >= options.motions.size();
  }
  return clips;
}

/// The animations of a file with several; none for one motion.
std::vector<ClipPart> parts_of(const std::vector<Clip>& clips) {
  std::vector<ClipPart> parts;
  int first = 0;
  for (const Clip& clip : clips) {
    if (clips.size() > 1) parts.push_back({clip.name, first, clip.written.num_frames(), clip.frames.per_second});
    first += clip.written.num_frames();
  }
  return parts;
}

/// @throws UsageError for several motions and a format that holds one
void refuse_several_motions(const AnimateOptions& options) {
  const std::size_t motions = options.motions.size() + options.engine.unseen.size();
  if (motions < 2) return;
  for (const std::string& format : options.formats)
    if (format != "glb" && format != "splat-rig" && format != "engine-glb")
      fail<UsageError>(
          "--format {}: its files hold one motion, and there are {}; several motions go into one file with --format "
          "glb, engine-glb and splat-rig, for others run the command once for each",
          format, motions);
}

/// @throws UsageError for a unit or an axis, and no file that leaves them open
void refuse_space_without_file(const AnimateOptions& options) {
  if (!options.out_unit && options.out_up.empty()) return;
  for (const char* format : {"obj", "bvh", "pc2", "mdd"})
    if (options.wants(format)) return;
  fail<UsageError>(
      "{} belongs to --format obj, bvh, pc2 and mdd; the other files state their unit and their axis, or have those of "
      "their format",
      options.out_unit ? "--out-unit" : "--out-up");
}

FileSpace file_space(const AnimateOptions& options) { return {options.out_unit.value_or(1.0), options.out_up == "z"}; }

// ---- the images ----

/// The cameras to choose from by name, and the capture's images of the empty studio.
struct Studio {
  std::vector<Camera> cameras;
  std::optional<Dataset> dataset;
};

/// The path of the camera. `--camera FILE` selects the only camera of the file.
std::unique_ptr<CameraPath> camera_path(const AnimateOptions& options, const Character& character,
                                        const ResultFrames& frames, const Studio& studio) {
  if (options.camera == "orbit") {
    OrbitOptions orbit;
    if (options.size > 0) orbit.size = options.size;
    orbit.frames_per_second = frames.per_second;
    orbit.turns_per_second = options.turns_per_second;
    return make_orbit(character, orbit);
  }
  if (!studio.cameras.empty())
    return make_calibrated_path(studio.cameras, options.camera, options.size, frames.row_step);
  if (!fs::exists(options.camera))
    fail<UsageError>(
        "--camera {}: neither `orbit` nor a calibration file that exists; for a camera by its name, say whose: "
        "--capture "
        "PREPARED or --calibration FILE",
        options.camera);
  const std::vector<Camera> cameras = read_calibration(options.camera);
  const std::string name = cameras.front().name.substr(0, cameras.front().name.find('@'));
  for (const Camera& camera : cameras)
    if (camera.name.substr(0, camera.name.find('@')) != name)
      fail<UsageError>("{} holds several cameras; choose one: --calibration {} --camera NAME", options.camera,
                       options.camera);
  return make_calibrated_path(cameras, name, options.size, frames.row_step);
}

Studio read_studio(const AnimateOptions& options) {
  Studio studio;
  if (!options.capture.empty()) {
    studio.dataset = Dataset::open(options.capture);
    studio.cameras.assign(studio.dataset->cameras().begin(), studio.dataset->cameras().end());
  }
  if (!options.calibration.empty()) studio.cameras = read_calibration(options.calibration);
  return studio;
}

Backdrop backdrop(const AnimateOptions& options, const Studio& studio) {
  Backdrop result;
  if (options.background.empty()) return result;
  if (options.background == "capture") {
    if (!studio.dataset || options.camera == "orbit")
      fail<UsageError>("--background capture needs a camera of a capture: --capture PREPARED --camera NAME");
    result.image = studio.dataset->background(studio.dataset->camera_index(options.camera));
    result.name = "the empty studio of camera " + options.camera;
    if (result.image.empty())
      fail<UsageError>("the capture has no images of the empty studio (`background` in its capture.yaml)");
    return result;
  }
  if (!fs::is_regular_file(options.background)) {
    result.colour = parse_colour(options.background);
    return result;
  }
  result.image = read_colour_image(options.background);
  result.name = options.background;
  return result;
}

FilmOptions film_options(const AnimateOptions& options, const ResultFrames& frames, const Studio& studio) {
  FilmOptions film;
  film.frames_per_second = frames.per_second;
  film.video = options.wants("mp4");
  film.images = options.wants("png");
  film.supersampling = options.samples;
  const std::string usual = options.camera == "orbit" ? "soft" : "flat";
  film.light = (options.light.empty() ? usual : options.light) == "soft" ? Light::soft : Light::flat;
  film.backdrop = backdrop(options, studio);
  if (!options.beside.empty()) {
    const std::shared_ptr<FrameReader> footage = open_frames(options.beside, PixelFormat::colour);
    film.beside = [footage, step = frames.row_step](int frame) { return footage->read(std::lround(frame * step)); };
  }
  return film;
}

/// @throws UsageError for a run that captures poses from images; the message names the right command
void refuse_pose_run(const char* option, const std::string& path) {
  if (captures_poses(path))
    fail<UsageError>("{} {}: this run takes images of a person, not a motion; use it with `doppel track deepcap`",
                     option, path);
}

/// An actor file. @throws UsageError for a run
ActorFile load_model(const std::string& path) {
  refuse_pose_run("--model", path);
  if (fs::exists(RunFolder(path).config()))
    fail<UsageError>("--model {}: this is a run; `doppel export --run {}` writes the actor file that --model needs",
                     path, path);
  return ActorFile::load(path);
}

/// Checks that a file has the Gaussians that are to be drawn. @throws UsageError without
void check_renderer(const AnimateOptions& options, const std::optional<ActorFile>& file) {
  if (options.renderer != "gaussians") return;
  if (!file)
    fail<UsageError>("--renderer gaussians: a character alone has none; give --run RUN, or --model FILE of such a run");
  if (file->description().num_gaussians == 0)
    fail<UsageError>(
        "--renderer gaussians: {} holds none; export a run whose stage gaussians is trained, without --geometry-only",
        options.model);
}

/// The subject of the animation: an exported actor, an actor from its run, or else the skinned template.
struct Performer {
  Character character;
  std::optional<ActorFile> file;
  std::unique_ptr<TrainedActor> trained;

  /// The dynamic texture; empty without one.
  LookFunction texture() const {
    if (file && file->description().texture_size > 0)
      return [actor = &*file](const auto& window, const auto& projection, const auto& vertices) {
        return actor->texture(window, projection, vertices);
      };
    if (trained && trained->texnet)
      return [actor = trained.get()](const auto& window, const auto& projection, const auto& vertices) {
        return actor->texture(window, projection, vertices);
      };
    return nullptr;
  }

  /// Its Gaussians; empty without them.
  SplatFunction splats() const {
    if (file && file->description().num_gaussians > 0)
      return [actor = &*file](const auto& window, const auto& projection, const auto& vertices) {
        return splats_of_rows(actor->gaussians(window, projection, vertices));
      };
    if (trained && trained->gaussians)
      return [actor = trained.get()](const auto& window, const auto& projection, const auto& vertices) {
        return actor->splats(window, projection, vertices);
      };
    return nullptr;
  }

  /// What draws the actor in place of its mesh; empty for the renderer `mesh`.
  FieldFunction field(const std::string& renderer) const {
    TrainedActor* const actor = trained.get();
    if (renderer == "radiance")
      return [actor](const auto& window, const auto& projection, const auto&, std::int64_t height, std::int64_t width) {
        return actor->radiance(window, projection, height, width);
      };
    if (renderer == "gaussians")
      return [splats = splats()](const auto& window, const auto& projection, const auto& vertices, std::int64_t height,
                                 std::int64_t width) {
        const torch::Tensor camera = projection.unsqueeze(0);
        const SplatImage drawn = draw_splats(splats(window, camera, vertices), camera.unsqueeze(1), height, width);
        return FieldImage{drawn.colour[0][0], drawn.alpha[0][0], {}};
      };
    return nullptr;
  }

  /// The rate of the training, or nothing: skinning alone has no rate.
  std::optional<double> frames_per_second() const {
    if (file) return file->description().frames_per_second;
    if (trained) return trained->frames_per_second;
    return std::nullopt;
  }
};

Performer make_performer(const AnimateOptions& options) {
  Performer performer;
  if (!options.run.empty()) {
    refuse_pose_run("--run", options.run);
    performer.trained = std::make_unique<TrainedActor>(TrainedActor::load(options.run));
    if (options.renderer == "radiance" && !performer.trained->hybrid)
      fail(
          "{} has no checkpoint of the stage radiance; train it first: doppel train configs/small/hybrid.yaml --set "
          "ddc={}",
          options.run, options.run);
    if (options.renderer == "gaussians" && !performer.trained->gaussians)
      fail(
          "{} has no checkpoint of the stage gaussians; train it first: doppel train configs/small/gaussians.yaml "
          "--set capture=PREPARED --set ddc={} --out NEW",
          options.run, options.run);
    performer.character = performer.trained->character;
    return performer;
  }
  if (options.renderer == "radiance")
    fail<UsageError>("--renderer radiance requires --run RUN: only a run has a radiance field");
  if (options.character.empty())
    fail<UsageError>("the actor is missing: give --character FILE, perhaps with --model, or --run RUN");
  CharacterOptions character_options;
  character_options.bone_rule = options.bone_rule == "prefix" ? BoneRule::prefix : BoneRule::exact;
  performer.character = load_character(options.character, character_options);
  if (!options.model.empty()) performer.file = load_model(options.model);
  check_renderer(options, performer.file);
  return performer;
}

void perform(const AnimateOptions& options, const Performer& performer, std::span<const MotionPart> parts,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers, Profile& profile) {
  TrainedActor* actor = performer.trained.get();
  if (!actor)
    return animate(performer.character, parts, performer.file ? &*performer.file : nullptr, writers, &profile);
  const bool radiance = options.renderer == "radiance";
  animate(
      performer.character, parts, actor->past_frames(),
      [actor, radiance](const torch::Tensor& windows) {
        return radiance ? actor->refined(windows) : actor->fine(windows);
      },
      writers, &profile);
}

/// The rate that was reached, and the time of each part of a frame.
nlohmann::ordered_json speed_json(const Profile& profile, int frames, double seconds) {
  nlohmann::ordered_json parts;
  for (const auto& [name, sum] : profile.parts()) parts[name] = 1000 * sum / frames;
  return {{"frames_per_second", frames / seconds}, {"milliseconds_a_frame", parts}};
}

std::string speed_text(const nlohmann::ordered_json& speed) {
  std::string text = fmt::format("{:.1f} frames a second", speed["frames_per_second"].get<double>());
  std::string between = "; milliseconds a frame: ";
  for (const auto& [name, value] : speed["milliseconds_a_frame"].items()) {
    text += fmt::format("{}{} {:.1f}", between, name, value.get<double>());
    between = ", ";
  }
  return text;
}

BoneNames bone_names(const AnimateOptions& options) { return bone_names_of(options.names); }

FigureOptions figure_options(const AnimateOptions& options, double fps, const std::vector<ClipPart>& parts) {
  FigureOptions figure;
  figure.glb = options.wants("glb");
  figure.usda = options.wants("usda");
  figure.fbx = options.wants("fbx");
  figure.pc2 = options.wants("pc2");
  figure.mdd = options.wants("mdd");
  figure.frames_per_second = fps;
  figure.parts = parts;
  figure.names = bone_names(options);
  if (!options.rights.authors.empty() && (figure.names != BoneNames::vrm || !figure.glb))
    fail<UsageError>("--author belongs to --names vrm and --format glb");
  figure.rights = options.rights;
  figure.morphs = options.morphs;
  figure.tolerance = 0.001 * options.tolerance_mm;
  if (options.compress && !figure.glb && !options.wants("splat-rig") && !options.wants("engine-glb"))
    fail<UsageError>(
        "--compress belongs to --format glb, splat-rig and engine-glb; the other files have no compressed form");
  figure.compress = options.compress;
  figure.space = file_space(options);
  return figure;
}

std::unique_ptr<SequenceWriter> rig_writer(const AnimateOptions& options, const Performer& performer, double fps,
                                           const std::vector<ClipPart>& parts, SplatRigReport& report) {
  if (!performer.trained || !performer.trained->gaussians)
    fail<UsageError>(
        "--format splat-rig needs the Gaussians that all poses share, which a character and a file of --model do not "
        "have; give --run RUN of `doppel train configs/small/gaussians.yaml --set capture=PREPARED --set ddc=CHAIN "
        "--out RUN`");
  return make_splat_rig_writer(options.out, *performer.trained,
                               {fps, bone_names(options), 0.001 * options.tolerance_mm, parts, options.compress},
                               report);
}

/// The actor, and the motions that its correctives are fitted to. @throws UsageError for a character alone
EngineTeacher engine_teacher(const AnimateOptions& options, const Performer& performer,
                             const std::vector<Clip>& clips) {
  if (options.renderer == "radiance")
    fail<UsageError>(
        "--format engine-glb holds the surface of EGNet and DeltaNet, and --renderer radiance another one; write "
        "engine.glb in a call of its own, without --renderer");
  EngineTeacher teacher;
  if (performer.trained) {
    teacher.geometry = [actor = performer.trained.get()](const torch::Tensor& windows) { return actor->fine(windows); };
    teacher.past_frames = performer.trained->past_frames();
    teacher.motions = training_takes(*performer.trained);
  } else if (performer.file) {
    teacher.geometry = [file = &*performer.file](const torch::Tensor& windows) { return file->forward(windows); };
    teacher.past_frames = performer.file->description().past_frames;
  } else {
    fail<UsageError>(
        "--format engine-glb: a character alone is skinned, and has no trained corrections that shapes could hold; "
        "give --run RUN, or --model FILE of `doppel export`");
  }
  teacher.frames_per_second = *performer.frames_per_second();
  for (const Clip& clip : clips) {
    if (clip.unseen) continue;
    WindowSource source{clip.motion, clip.steps.window};
    source.motion.frames.resize(static_cast<std::size_t>(fitted_frames(clip.motion.num_frames())));
    teacher.motions.push_back(std::move(source));
  }
  return teacher;
}

std::unique_ptr<SequenceWriter> engine_writer(const AnimateOptions& options, const Performer& performer,
                                              const std::vector<Clip>& clips, EngineClipReport& report) {
  EngineClipOptions engine;
  engine.frames_per_second = clips[0].frames.per_second;
  engine.names = bone_names(options);
  engine.tolerance = 0.001 * options.tolerance_mm;
  engine.windows = options.engine.fit_windows;
  engine.helpers = options.engine.helpers;
  engine.compress = options.compress;
  if (options.morphs) engine.shapes = *options.morphs;
  int first = 0;
  for (const Clip& clip : clips) {
    engine.parts.push_back({clips.size() > 1 ? clip.name : performer.character.name, first, clip.written.num_frames(),
                            clip.frames.per_second});
    engine.unseen.push_back(clip.unseen);
    first += clip.written.num_frames();
  }
  return make_engine_clip_writer(options.out, performer.character, engine_teacher(options, performer, clips), engine,
                                 report);
}

/// What the files with bones lost.
struct FileReports {
  FigureReport figure, fbx;
  SplatRigReport rig;
  EngineClipReport engine;
};

std::vector<std::unique_ptr<SequenceWriter>> make_writers(const AnimateOptions& options, const Performer& performer,
                                                          const std::vector<Clip>& clips, FileReports& reports,
                                                          Profile& profile) {
  const Character& character = performer.character;
  const ResultFrames& frames = clips[0].frames;  // of formats that take one motion
  const std::vector<ClipPart> parts = parts_of(clips);
  std::vector<std::unique_ptr<SequenceWriter>> writers;
  const FigureOptions files = figure_options(options, frames.per_second, parts);
  if (files.glb || files.usda || files.fbx || files.pc2 || files.mdd)
    writers.push_back(make_figure_writer(options.out, character, files, reports.figure, reports.fbx));
  if (options.wants("npy")) writers.push_back(make_npy_writer(options.out, character.num_vertices()));
  if (options.wants("obj")) writers.push_back(make_obj_writer(options.out, character, file_space(options)));
  if (options.wants("texture")) {
    const LookFunction texture = performer.texture();
    if (!texture)
      fail<UsageError>(
          "--format texture needs an actor with a dynamic texture: --run RUN with a trained TexNet, or --model FILE of "
          "such a run, exported without --geometry-only");
    writers.push_back(
        make_texture_writer(options.out, texture, camera_path(options, character, frames, read_studio(options))));
  }
  if (options.wants("ply") || options.wants("splat-glb")) {
    const SplatFunction splats = performer.splats();
    if (!splats)
      fail<UsageError>(
          "--format ply and splat-glb need an actor with Gaussians: --run RUN of `doppel train "
          "configs/small/gaussians.yaml --set capture=PREPARED --set ddc=CHAIN --out RUN`, or --model FILE of such a "
          "run");
    writers.push_back(make_splat_writer(options.out, splats,
                                        camera_path(options, character, frames, read_studio(options)),
                                        {options.wants("ply"), options.wants("splat-glb")}));
  }
  if (options.wants("splat-rig"))
    writers.push_back(rig_writer(options, performer, frames.per_second, parts, reports.rig));
  if (options.wants("engine-glb")) writers.push_back(engine_writer(options, performer, clips, reports.engine));
  if (options.wants("mp4") || options.wants("png")) {
    const Studio studio = read_studio(options);
    FilmOptions film = film_options(options, frames, studio);
    film.texture = performer.texture();
    film.profile = &profile;
    film.field = performer.field(options.renderer);
    film.field_name = options.renderer;
    writers.push_back(make_film_writer(options.out, character, camera_path(options, character, frames, studio), film));
  }
  return writers;
}

/// Gives the joints of a clip the names of --names. An End Site is called as its parent.
void rename_joints(const Character& character, BoneNames names, BvhClip& clip) {
  const std::map<std::string, std::string> renamed = renamed_bones(character, names);
  const std::string end = "_end";
  for (BvhJoint& joint : clip.joints) {
    const bool site = joint.channels.empty() && joint.name.size() > end.size() &&
                      joint.name.compare(joint.name.size() - end.size(), end.size(), end) == 0;
    const std::string bone = site ? joint.name.substr(0, joint.name.size() - end.size()) : joint.name;
    if (const auto found = renamed.find(bone); found != renamed.end()) joint.name = found->second + (site ? end : "");
  }
}

void write_motions(const AnimateOptions& options, const Character& character, const Motion& motion, double fps) {
  const fs::path folder(options.out);
  if (options.wants("motion")) write_motion(folder / "driven.motion", motion);
  if (!options.wants("bvh")) return;
  BvhClip clip = bvh_from_motion(character.skeleton, motion, fps, character.rest_dofs);
  rename_joints(character, bone_names(options), clip);
  if (options.out_up == "z") clip = with_z_up(std::move(clip));
  write_bvh(folder / "driven.bvh", clip, options.out_unit.value_or(kBvhMetresPerUnit));
}

nlohmann::json rig_json(const SplatRigReport& rig) {
  nlohmann::json json = figure_json(rig.figure);
  json.erase("morphs");
  json.erase("morphs_at_once");
  json["gaussians"] = rig.gaussians;
  return json;
}

std::string targets_text(const FigureReport& figure) {
  if (figure.morphs == 1) return "1 morph target";
  return fmt::format("{} morph targets, of which at most {} {} at once", figure.morphs, figure.morphs_at_once,
                     figure.morphs_at_once == 1 ? "moves" : "move");
}

/// @param chosen --morphs, or nothing
void warn_of_targets(const FigureReport& figure, std::optional<int> chosen) {
  if (!figure.morphs_exhausted) return;
  log::warn(
      "the file has {}, and more than 256 are not written: vertices are off by {:.2f} mm on average and {:.1f} mm at "
      "most; {}a shorter clip has a nearer surface",
      targets_text(figure), figure.mean_error_mm, figure.worst_error_mm,
      chosen && *chosen < 256 ? "a larger --morphs, or none, or " : "");
}

/// Ends the line of a file with bones.
std::string compression_text(const FigureReport& figure) {
  if (!figure.compression) return "\n";
  return fmt::format("; the compression moves them by {:.2f} mm at most\n", figure.compression->worst);
}

/// A line for each file with bones.
std::string files_text(const AnimateOptions& options, const FileReports& reports) {
  std::string text;
  const FigureReport& rig = reports.rig.figure;
  const auto figure_text = [&](const char* format, const FigureReport& figure) {
    if (options.wants(format))
      text += fmt::format("animation.{}: {} bones, {}; vertices off by {:.2f} mm on average, {:.1f} mm at most{}",
                          format, figure.nodes, targets_text(figure), figure.mean_error_mm, figure.worst_error_mm,
                          compression_text(figure));
  };
  figure_text("glb", reports.figure);
  figure_text("fbx", reports.fbx);
  if (options.wants("splat-rig"))
    text +=
        fmt::format("splats_rig.glb: {} bones, {} Gaussians; centres off by {:.2f} mm on average, {:.1f} mm at most{}",
                    rig.nodes, reports.rig.gaussians, rig.mean_error_mm, rig.worst_error_mm, compression_text(rig));
  if (options.wants("engine-glb")) text += engine_text(reports.engine);
  return text;
}

nlohmann::json clips_json(const std::vector<Clip>& clips) {
  nlohmann::json list;
  for (const Clip& clip : clips) {
    nlohmann::json entry{{"name", clip.name},
                         {"motion", clip.file},
                         {"frames", clip.written.num_frames()},
                         {"frames_per_second", clip.frames.per_second}};
    if (clip.retargeting) entry["retargeting"] = retargeting_json(*clip.retargeting);
    if (clip.step)
      entry["loop"] = {{"way_m", {clip.step->way().x(), clip.step->way().y()}},
                       {"turn_degrees", clip.step->turn / kRadiansPerDegree}};
    list.push_back(entry);
  }
  return list;
}

/// The animations of a file with several.
std::string clips_text(const std::vector<Clip>& clips) {
  if (clips.size() < 2) return "";
  std::string text = "animations:";
  for (const Clip& clip : clips)
    text += fmt::format("{} {} ({} frames)", &clip == &clips[0] ? "" : ",", clip.name, clip.written.num_frames());
  return text + "\n";
}

int run(const AnimateOptions& options, const CommonOptions& common) {
  check_engine_options(options.engine, options.wants("engine-glb"), options.morphs.has_value());
  refuse_several_motions(options);
  refuse_space_without_file(options);
  const Performer performer = make_performer(options);
  const Character& character = performer.character;
  if (options.wants("bvh")) renamed_bones(character, bone_names(options));  // refuses names before the frames
  const std::vector<Clip> clips = read_clips(options, character, performer.frames_per_second());
  const FolderLock lock(options.out);
  FileReports reports;
  Profile profile;
  const auto writers = make_writers(options, performer, clips, reports, profile);
  write_motions(options, character, clips[0].written, clips[0].frames.per_second);
  std::vector<MotionPart> parts;
  int frames = 0;
  for (const Clip& clip : clips) {
    parts.push_back({clip.motion, clip.steps, options.root == "in-place"});
    frames += clip.written.num_frames();
  }
  const auto start = std::chrono::steady_clock::now();
  perform(options, performer, parts, writers, profile);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  const nlohmann::ordered_json speed = speed_json(profile, frames, elapsed.count());
  nlohmann::json report{{"speed", speed}, {"clips", clips_json(clips)}};
  if (clips.size() == 1 && clips[0].retargeting) report["retargeting"] = retargeting_json(*clips[0].retargeting);
  report.update({{"frames", frames},
                 {"frames_per_second", clips[0].frames.per_second},
                 {"vertices", character.num_vertices()},
                 {"formats", options.formats},
                 {"out", options.out}});
  warn_of_targets(reports.figure, options.morphs);
  if (options.wants("glb")) report["glb"] = figure_json(reports.figure);
  if (options.wants("fbx")) report["fbx"] = figure_json(reports.fbx);
  if (options.wants("splat-rig")) report["splat_rig"] = rig_json(reports.rig);
  if (options.wants("engine-glb")) report["engine_glb"] = engine_json(reports.engine);
  if (common.json) {
    std::cout << report << "\n";
    return 0;
  }
  std::cout << frames << " frames of " << character.num_vertices() << " vertices written to " << options.out << "; "
            << speed_text(speed) << "\n"
            << clips_text(clips) << files_text(options, reports);
  return 0;
}

void add_actor_options(CLI::App& app, AnimateOptions& options) {
  app.option_defaults()->group("Actor");
  CLI::Option* character = app.add_option("--character", options.character, "The .character file");
  CLI::Option* model =
      app.add_option("--model", options.model, "Actor file from `doppel export` (default: skinning alone)");
  app.add_option("--bone-rule", options.bone_rule,
                 "How a bone of the skinning weights finds its joint by name: exact or prefix")
      ->check(CLI::IsMember({"exact", "prefix"}))
      ->capture_default_str();
  app.add_option("--run", options.run,
                 "A run instead of --character and --model: its newest mesh and dynamic texture, its Gaussians, or its "
                 "radiance field")
      ->excludes(character, model);
  app.add_option("--renderer", options.renderer,
                 "Images of the mesh, of the Gaussians on it (--run or --model), or of the radiance field around it "
                 "(--run)")
      ->check(CLI::IsMember({"mesh", "gaussians", "radiance"}))
      ->capture_default_str();
}

void add_motion_options(CLI::App& app, AnimateOptions& options) {
  app.option_defaults()->group("Motion");
  app.add_option(
         "--motion", options.motions,
         "The motion: a .motion file, or one of any body: .bvh; .glb, .gltf, .vrm, .fbx, .dae (an animation); "
         ".npz (AMASS, SMPL-X); .c3d, .trc (points in space). May be repeated with --format glb, engine-glb and "
         "splat-rig: each becomes an animation of the file, by the name of its own file")
      ->allow_extra_args(false)
      ->required();
  app.add_option("--animation", options.animation, "Which animation of a .glb, .fbx, ... with several, by its name");
  app.add_option("--person", options.person,
                 "Which person of a .c3d or .trc with the points of several, by the name before that of the point");
  app.add_option("--source-skeleton", options.source_skeleton, "The .skeleton file of a .motion for another skeleton");
  app.add_option("--map", options.map, "Pairs of joints of the two bodies, YAML (default: guessed)");
  app.add_option(
         "--up", options.up,
         "Vertical axis of a file of another body (default: as the file or its format says; BVH: also as its rest "
         "pose or the map says)")
      ->check(CLI::IsMember({"x", "y", "z"}));
  app.add_option("--unit", options.unit,
                 "Metres per unit of length of the file (default: as it says, or guessed by its size)")
      ->check(CLI::PositiveNumber);
  app.add_option(
         "--source-fps", options.source_fps,
         "Frames per second of a file that states none (.motion: default as listed by `doppel character import`, "
         "else of the training, else --fps)")
      ->check(CLI::Range(0.1, 1000.0));
  app.add_option("--fps", options.fps,
                 "Frames per second of the result (default: of the training, else of the motion's file, else 25); the "
                 "motion is resampled, and the actor sees poses at the rate of its training")
      ->check(CLI::Range(0.1, 1000.0));
  app.add_flag("--loop", options.loop,
               "Make the motion cyclic: its last half second (at most a quarter of it) is blended into the "
               "first; a person who travels goes on from where he is in the next repetition");
  app.add_option("--root", options.root,
                 "travel: the character goes where the motion goes; in-place: its root stays above one point of the "
                 "ground, for programs that move it themselves")
      ->check(CLI::IsMember({"travel", "in-place"}))
      ->capture_default_str();
}

void add_camera_options(CLI::App& app, AnimateOptions& options) {
  app.option_defaults()->group("Camera (--format mp4, png, texture)");
  app.add_option("--camera", options.camera,
                 "orbit, the NAME of a camera of --capture or --calibration, or a calibration file with one camera")
      ->capture_default_str();
  CLI::Option* capture =
      app.add_option("--capture", options.capture, "Prepared capture, for its cameras and images of the empty studio");
  app.add_option("--calibration", options.calibration, "Calibration file, Skeletool or OpenCV")->excludes(capture);
  app.add_option("--video-size", options.size, "Pixels of the longer side (default: 512 for orbit, else as calibrated)")
      ->check(CLI::Range(16, 4096));
  app.add_option("--turns-per-second", options.turns_per_second, "Speed of the orbiting camera")->capture_default_str();
}

void add_image_options(CLI::App& app, AnimateOptions& options) {
  app.option_defaults()->group("Images (--format mp4, png)");
  app.add_option("--background", options.background, "An image, a colour (#rrggbb or a word), or `capture`");
  app.add_option("--beside", options.beside,
                 "Footage of the same frames, a video or images NAME_{frame}.png, to the left of the drawn ones");
  app.add_option("--light", options.light, "soft, or flat: the texture as it is (default: soft for orbit, else flat)")
      ->check(CLI::IsMember({"soft", "flat"}));
  app.add_option("--samples", options.samples, "Samples of a pixel along each side: more is smoother and slower")
      ->check(CLI::Range(1, 8))
      ->capture_default_str();
}

void add_figure_options(CLI::App& app, AnimateOptions& options) {
  app.option_defaults()->group("Figure (--format glb, engine-glb, fbx, usda, splat-rig, bvh)");
  app.add_option(
         "--names", options.names,
         "Names of the bones: the character's own (skeletool), Mixamo's, VRM's, Unity's (HumanBodyBones) or those of "
         "Unreal's mannequin")
      ->check(CLI::IsMember(bone_names_words()))
      ->capture_default_str();
  CLI::Option* author =
      app.add_option("--author", options.rights.authors,
                     "With --names vrm: the .glb is an avatar of VRM 1.0 by this author; may be repeated")
          ->allow_extra_args(false);
  app.add_option("--licence", options.rights.licence, "The address of a licence of one's own")->needs(author);
  app.add_option(
         "--morphs", options.morphs,
         "Largest number of morph targets that move in a frame; they hold the motion of the clothes (default: 8, "
         "and more where the 256 targets of a file do not suffice). With engine-glb: the number of corrective shapes, "
         "2 to 256 (default: 32)")
      ->check(CLI::Range(0, 256));
  app.add_flag(
      "--compress", options.compress,
      "Compress .glb files (EXT_meshopt_compression), moving no vertex by more than about 0.1 mm; programs must "
      "know the extension");
  app.add_option("--tolerance", options.tolerance_mm, "Error that leaving out keyframes may cause, mm")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
}

void add_space_options(CLI::App& app, AnimateOptions& options) {
  app.option_defaults()->group("Files that state neither unit nor axis (--format obj, bvh, pc2, mdd)");
  app.add_option("--out-unit", options.out_unit,
                 "Metres per unit of length of these files: 0.01 for centimetres (default: 1, and 0.01 for bvh)")
      ->check(CLI::Range(1e-4, 1e4));
  app.add_option("--out-up", options.out_up, "Their vertical axis (default: y)")->check(CLI::IsMember({"y", "z"}));
}

}  // namespace

Command add_animate(CLI::App& program) {
  auto options = std::make_shared<AnimateOptions>();
  CLI::App* app = program.add_subcommand("animate", "Drive a character with a motion: vertices, meshes, images, video");
  app->add_option("--format", options->formats,
                  "npy, obj, mp4, png, motion, bvh, glb, engine-glb, fbx, usda, pc2, mdd, texture, ply, splat-glb, "
                  "splat-rig, or several with commas")
      ->delimiter(',')
      ->check(CLI::IsMember({"npy", "obj", "mp4", "png", "motion", "bvh", "glb", "engine-glb", "fbx", "usda", "pc2",
                             "mdd", "texture", "ply", "splat-glb", "splat-rig"}))
      ->capture_default_str();
  app->add_option("--out", options->out, "The folder to write into")->required();
  const std::string usual_group = app->option_defaults()->get_group();
  add_actor_options(*app, *options);
  add_motion_options(*app, *options);
  add_camera_options(*app, *options);
  add_image_options(*app, *options);
  add_figure_options(*app, *options);
  add_engine_options(*app, options->engine);
  add_space_options(*app, *options);
  app->option_defaults()->group(usual_group);
  app->footer(
      "Examples:\n"
      "  doppel animate --character actor/actor.character --motion walk.motion --model run/actor.pt --format npy,mp4 "
      "--out walk\n"
      "  doppel animate --character actor/actor.character --motion dance.bvh --map joints.yaml --model run/actor.pt "
      "--format mp4 --capture prepared --camera 3 --background capture --out dance\n"
      "  doppel animate --character actor/actor.character --motion walk.glb --animation Walk --format mp4 --out walk\n"
      "  doppel animate --character actor/actor.character --motion CMU/01/01_01_poses.npz --format motion --out amass\n"
      "  doppel animate --character actor/actor.character --motion walk.motion --model run/actor.pt --format glb "
      "--loop "
      "--out game\n"
      "  doppel animate --character actor/actor.character --motion walk.bvh --motion run.bvh --format glb --out game\n"
      "  doppel animate --run runs/ddc --motion walk.bvh --motion run.bvh --unseen dance.bvh --format engine-glb --out "
      "engine\n"
      "  doppel animate --run runs/ddc --motion walk.bvh --format engine-glb --helpers 32 --compress --out engine\n"
      "  doppel animate --run runs/hybrid --renderer radiance --motion walk.motion --format mp4 --out views");
  return {app, [options](const CommonOptions& common) { return run(*options, common); }};
}

}  // namespace doppel::tools
