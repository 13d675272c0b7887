#include "animate_film.h"

#include <cmath>
#include <filesystem>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/video.h"
#include "doppel/geometry/image_file.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

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

}  // namespace

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

std::unique_ptr<SequenceWriter> film_writer(const AnimateOptions& options, const Performer& performer,
                                            const ResultFrames& frames, Profile& profile) {
  const Studio studio = read_studio(options);
  FilmOptions film = film_options(options, frames, studio);
  film.texture = performer.texture();
  film.profile = &profile;
  film.field = performer.field(options.renderer);
  film.field_name = options.renderer;
  return make_film_writer(options.out, performer.character, camera_path(options, performer.character, frames, studio),
                          film);
}

}  // namespace doppel::tools
