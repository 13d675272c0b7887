#include "doppel/calibration/estimation/calibrate_board.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>

#include "calibrate_rig.h"
#include "calibrate_subcommands.h"
#include "detect_sources.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/progress.h"
#include "doppel/data/capture/video.h"
#include "doppel/detect/keypoints/frame_names.h"
#include "doppel/geometry/image_file.h"
#include "doppel/geometry/image_orientation.h"
#include "number_checks.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr long kFramesOfVideo = 120;  // that are searched for the board, if --every does not say otherwise

struct BoardArguments {
  std::vector<std::string> sources, names;
  std::string board, out, format;
  long every = 0;
  std::optional<long> floor;
  bool fisheye = false;
};

/// The images of one camera: a video, or files by instant.
struct BoardSource {
  std::string camera, video;
  std::map<long, fs::path> images;
  long frames = 0;  ///< of the video
};

BoardSource board_source(const fs::path& path) {
  if (!fs::exists(path)) fail<UsageError>("{} does not exist", path.string());
  BoardSource source;
  source.camera = fs::absolute(path / "x").parent_path().stem().string();
  if (!fs::is_directory(path)) {
    source.video = path.string();
    source.frames = open_frames(source.video, PixelFormat::grey)->num_frames(-1);
    return source;
  }
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(path))
    if (entry.is_regular_file() && is_image(entry.path())) names.push_back(entry.path().filename().string());
  if (names.empty()) fail<UsageError>("{} holds no images; give folders of images, or videos", path.string());
  const NumberedNames numbered = number_names(names);
  for (std::size_t i = 0; i < names.size(); ++i) source.images[numbered.frames[i]] = path / names[i];
  return source;
}

/// Finds the board in the images of a camera. @param every of a video's frames
/// @param floor a frame that is looked at in any case
BoardSightings sightings_in(const BoardSource& source, const Board& board, long every, std::optional<long> floor) {
  BoardSightings found;
  found.camera = source.camera;
  const auto look = [&](long instant, const cv::Mat& image, const std::string& name) {
    if (found.width == 0) {
      found.width = image.cols;
      found.height = image.rows;
    }
    if (image.cols != found.width || image.rows != found.height)
      fail("{}: the image has {}x{} pixels, earlier ones of this camera have {}x{}; a camera's images need one size",
           name, image.cols, image.rows, found.width, found.height);
    if (const auto view = find_board(image, board)) found.views[instant] = *view;
  };
  if (!source.video.empty()) {
    const auto reader = open_frames(source.video, PixelFormat::grey);
    Progress progress("boards in " + source.camera, (source.frames + every - 1) / every);
    for (long frame = 0; frame < source.frames; ++frame) {
      if (frame % every != 0 && frame != floor) continue;
      look(frame, reader->read(frame), source.video);
      progress.advance(frame % every == 0 ? 1 : 0);
    }
    return found;
  }
  Progress progress("boards in " + source.camera, static_cast<std::int64_t>(source.images.size()));
  std::optional<int> orientation;
  for (const auto& [instant, path] : source.images) {
    const int turned = exif_orientation(read_file(path));
    if (orientation.value_or(turned) != turned)
      fail(
          "{}: its EXIF orientation is {}, that of earlier images of this camera {}; turned images are those of "
          "another "
          "camera. Leave it out, or remove the orientation from all images of this camera and from its footage "
          "(exiftool -Orientation=)",
          path.string(), turned, *orientation);
    orientation = turned;
    cv::Mat grey;
    cv::cvtColor(read_colour_image(path), grey, cv::COLOR_BGR2GRAY);
    look(instant, grey, path.string());
    progress.advance();
  }
  return found;
}

std::vector<BoardSource> board_sources(const BoardArguments& arguments) {
  std::vector<BoardSource> sources;
  for (const std::string& path : arguments.sources) sources.push_back(board_source(path));
  if (!arguments.names.empty() && arguments.names.size() != sources.size())
    fail<UsageError>("--names gives {} names for {} cameras", arguments.names.size(), sources.size());
  for (std::size_t c = 0; c < arguments.names.size(); ++c) sources[c].camera = arguments.names[c];
  for (std::size_t a = 0; a < sources.size(); ++a)
    for (std::size_t b = 0; b < a; ++b)
      if (sources[a].camera == sources[b].camera)
        fail<UsageError>("two cameras would be called {}; name them with --names", sources[a].camera);
  return sources;
}

long frames_between(const std::vector<BoardSource>& sources, long every) {
  if (every > 0) return every;
  long shortest = std::numeric_limits<long>::max();
  for (const BoardSource& source : sources)
    if (!source.video.empty()) shortest = std::min(shortest, source.frames);
  return shortest == std::numeric_limits<long>::max() ? 1 : std::max(1L, shortest / kFramesOfVideo);
}

Json json_of(const BoardCalibration& found, const BoardArguments& arguments) {
  Json report{{"board", arguments.board},
              {"out", arguments.out},
              {"rms_px", found.rms},
              {"cameras", Json::array()},
              {"notes", found.notes}};
  for (const BoardCamera& camera : found.cameras) {
    const Eigen::Matrix3d& K = camera.intrinsics.camera.K;
    report["cameras"].push_back({{"name", camera.intrinsics.camera.name},
                                 {"boards", camera.boards},
                                 {"views", camera.intrinsics.views},
                                 {"shared", camera.shared},
                                 {"fx", K(0, 0)},
                                 {"fy", K(1, 1)},
                                 {"cx", K(0, 2)},
                                 {"cy", K(1, 2)},
                                 {"focal_sigma_px", camera.intrinsics.focal_sigma},
                                 {"rms_px", camera.intrinsics.rms},
                                 {"posed", camera.posed},
                                 {"rig_rms_px", camera.rms}});
  }
  return report;
}

void print_table(const BoardCalibration& found) {
  std::printf("%-16s %7s %7s %7s %20s %10s %10s\n", "camera", "boards", "used", "shared", "focal length (px)",
              "rms (px)", "pose (px)");
  for (const BoardCamera& camera : found.cameras) {
    std::printf("%-16s %7zu %7zu %7zu %11.1f +- %5.1f %10.3f ", camera.intrinsics.camera.name.c_str(), camera.boards,
                camera.intrinsics.views, camera.shared, camera.intrinsics.camera.K(0, 0), camera.intrinsics.focal_sigma,
                camera.intrinsics.rms);
    if (camera.posed)
      std::printf("%10.3f\n", camera.rms);
    else
      std::printf("%10s\n", "-");
  }
}

int run_board(const BoardArguments& arguments, const CommonOptions& common) {
  const Board board = parse_board(arguments.board);
  check_calibration_target(arguments.out, arguments.format, true);
  const std::vector<BoardSource> sources = board_sources(arguments);
  const long every = frames_between(sources, arguments.every);
  std::vector<BoardSightings> seen;
  for (const BoardSource& source : sources) seen.push_back(sightings_in(source, board, every, arguments.floor));
  BoardCalibrationOptions options;
  if (arguments.fisheye) options.lens = Lens::fisheye;
  options.floor = arguments.floor;
  BoardCalibration found = calibrate_boards(seen, board, options);
  const bool any_posed =
      std::any_of(found.cameras.begin(), found.cameras.end(), [](const BoardCamera& camera) { return camera.posed; });
  std::vector<Camera> cameras;
  for (const BoardCamera& camera : found.cameras)
    if (camera.posed || !any_posed) cameras.push_back(camera.intrinsics.camera);
  if (!any_posed)
    log::warn("no camera has a pose: {} holds intrinsics alone", arguments.out);
  else if (cameras.size() < found.cameras.size())
    found.notes.emplace_back(
        "cameras without a pose are not in the file; run the command for them alone, with another --out, to get "
        "their intrinsics and the poses among them");
  if (any_posed)
    write_result(arguments.out, cameras, arguments.format);
  else
    write_result(arguments.out, cameras, arguments.format, write_intrinsics);
  if (common.json) {
    std::printf("%s\n", json_of(found, arguments).dump(2).c_str());
    return 0;
  }
  print_table(found);
  for (const std::string& note : found.notes) std::printf("note: %s\n", note.c_str());
  std::printf("written: %s\n", arguments.out.c_str());
  return 0;
}

}  // namespace

Command add_calibrate_board(CLI::App& calibrate) {
  CLI::App* app = calibrate.add_subcommand("board", "Calibrate cameras by images of a chessboard or a ChArUco board");
  app->fallthrough();
  auto arguments = std::make_shared<BoardArguments>();
  app->add_option("sources", arguments->sources,
                  "A video or a folder of images per camera; frames or images of one number show the same instant")
      ->required();
  app->add_option("--board", arguments->board,
                  "chessboard:6x3:60mm (inner corners, square) or charuco:8x5:40mm:30mm:DICT_4X4_50 (squares, square, "
                  "marker, dictionary)")
      ->required();
  app->add_option("--out", arguments->out, "Calibration to write: .toml (Pose2Sim) or .yml")->required();
  app->add_option("--to", arguments->format, "Format to write (default: by the extension of the file)");
  app->add_option("--names", arguments->names, "Names of the cameras (default: the names of the files or folders)")
      ->delimiter(',');
  app->add_option("--every", arguments->every, "Look at every N-th frame of a video (default: about 120 frames)")
      ->check(above_zero());
  app->add_option("--floor", arguments->floor, "Frame at which the board lies on the floor: its plane becomes y = 0");
  app->add_flag("--fisheye", arguments->fisheye, "Fisheye lenses");
  app->footer(
      "Example: doppel calibrate board calib/cam*.mp4 --board charuco:8x5:40mm:30mm:DICT_4X4_50 --out cameras.yml");
  return {app, [arguments](const CommonOptions& common) { return run_board(*arguments, common); }};
}

}  // namespace doppel::tools
