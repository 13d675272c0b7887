#include "animate_options.h"

#include <utility>

#include "doppel/core/error.h"
#include "number_checks.h"

namespace doppel::tools {

namespace {

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

/// Options of the camera and of images say nothing to other files.
void refuse_image_options_without_images(const AnimateOptions& options) {
  const bool images = options.wants("mp4") || options.wants("png");
  const std::pair<const char*, bool> of_camera[] = {{"--camera", options.camera != "orbit"},
                                                    {"--capture", !options.capture.empty()},
                                                    {"--calibration", !options.calibration.empty()},
                                                    {"--video-size", options.size > 0}};
  const std::pair<const char*, bool> of_images[] = {{"--background", !options.background.empty()},
                                                    {"--beside", !options.beside.empty()},
                                                    {"--light", !options.light.empty()}};
  for (const auto& [name, given] : of_camera)
    if (given && !images && !options.wants("texture"))
      fail<UsageError>("{} belongs to --format mp4, png and texture, and none of them is written", name);
  for (const auto& [name, given] : of_images)
    if (given && !images) fail<UsageError>("{} belongs to --format mp4 and png, and none of them is written", name);
}

void refuse_figure_options_without_file(const AnimateOptions& options) {
  if (!options.rights.authors.empty() && (options.bone_names() != BoneNames::vrm || !options.wants("glb")))
    fail<UsageError>("--author belongs to --names vrm and --format glb");
  if (options.compress && !options.wants("glb") && !options.wants("splat-rig") && !options.wants("engine-glb"))
    fail<UsageError>(
        "--compress belongs to --format glb, splat-rig and engine-glb; the other files have no compressed form");
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
      ->check(above_zero());
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
  app.add_option("--turns-per-second", options.turns_per_second, "Speed of the orbiting camera")
      ->check(CLI::Range(-10.0, 10.0))
      ->capture_default_str();
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

void check_animate_options(const AnimateOptions& options) {
  check_engine_options(options.engine, options.wants("engine-glb"), options.morphs.has_value());
  refuse_several_motions(options);
  refuse_space_without_file(options);
  refuse_image_options_without_images(options);
  refuse_figure_options_without_file(options);
}

void add_animate_options(CLI::App& app, AnimateOptions& options) {
  app.add_option("--format", options.formats,
                 "npy, obj, mp4, png, motion, bvh, glb, engine-glb, fbx, usda, pc2, mdd, texture, ply, splat-glb, "
                 "splat-rig, or several with commas")
      ->delimiter(',')
      ->check(CLI::IsMember({"npy", "obj", "mp4", "png", "motion", "bvh", "glb", "engine-glb", "fbx", "usda", "pc2",
                             "mdd", "texture", "ply", "splat-glb", "splat-rig"}))
      ->capture_default_str();
  app.add_option("--out", options.out, "The folder to write into")->required();
  const std::string usual_group = app.option_defaults()->get_group();
  add_actor_options(app, options);
  add_motion_options(app, options);
  add_camera_options(app, options);
  add_image_options(app, options);
  add_figure_options(app, options);
  add_engine_options(app, options.engine);
  add_space_options(app, options);
  app.option_defaults()->group(usual_group);
  app.footer(
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
}

}  // namespace doppel::tools
