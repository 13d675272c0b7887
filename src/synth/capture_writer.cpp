#include "doppel/synth/capture_writer.h"

#include <fmt/ranges.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>

#include "doppel/character/motion.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/video_file.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/keypoint_table.h"

namespace doppel::synth {

namespace {

namespace fs = std::filesystem;

cv::VideoWriter open_video(const fs::path& path, const std::vector<int>& codecs, double fps, cv::Size size,
                           bool colour) {
  fs::create_directories(path.parent_path());
  // OpenCV does not say whether an encoder is missing or the file could not be written. A second try keeps a write that
  // failed once from changing the codec of one video.
  for (const int codec : codecs) {
    for (int i = 0; i < 2; ++i) {
      cv::VideoWriter writer(path.string(), cv::CAP_FFMPEG, codec, fps, size, colour);
      if (writer.isOpened()) return writer;
    }
  }
  fail(
      "writing {}: OpenCV has no encoder for it; install a build of OpenCV with FFmpeg (Debian: libopencv-videoio-dev)",
      path.string());
}

}  // namespace

std::string three_digits(int number) { return fmt::format("{:03}", number); }

CameraFiles::CameraFiles(const fs::path& folder, int camera, bool tables)
    : stream("stream" + three_digits(camera)), table(tables) {
  const std::string number = three_digits(camera);
  video = folder / "videos" / (stream + ".mp4");
  masks = folder / "foregroundSegmentation" / (stream + ".mkv");
  keypoints = folder / "keypoints" / (tables ? number + ".csv" : number);
  joints = folder / "joints3d" / (number + ".csv");
}

CameraWriter::CameraWriter(CameraFiles files, const Camera& camera, double fps)
    : files_(std::move(files)),
      layout_(read_keypoint_map("body25").layout),
      joints_("frame,index,name,x_mm,y_mm,z_mm\n") {
  const auto code = cv::VideoWriter::fourcc;
  const cv::Size size(camera.width, camera.height);
  images_ = open_video(files_.video, {code('a', 'v', 'c', '1'), code('m', 'p', '4', 'v')}, fps, size, true);
  masks_ = open_video(files_.masks, {code('F', 'F', 'V', '1')}, fps, size, false);
  if (!files_.table) fs::create_directories(files_.keypoints);
}

void CameraWriter::write_shot(const Studio::Shot& shot) {
  images_.write(shot.image);
  masks_.write(shot.mask);
  ++shots_;
}

void CameraWriter::write_keypoints(int frame, const std::vector<double>& body25) {
  if (files_.table) {
    Person person;
    for (std::size_t k = 0; k + 2 < body25.size(); k += 3)
      person.push_back(
          {static_cast<float>(body25[k]), static_cast<float>(body25[k + 1]), static_cast<float>(body25[k + 2])});
    keypoints_[frame] = {std::move(person)};
    return;
  }
  const nlohmann::json person = {{"person_id", {-1}}, {"pose_keypoints_2d", body25}};
  const nlohmann::json file = {{"version", 1.3}, {"people", {person}}};
  const fs::path path = files_.keypoints / fmt::format("{}_{:012}_keypoints.json", files_.stream, frame);
  // The files are not written atomically one by one: a camera is complete when its table of joints is there, and
  // flushing thousands of small files takes longer than computing them.
  std::ofstream stream(path, std::ios::binary);
  stream << file.dump() << '\n';
  if (!stream.flush()) fail("writing {}: the disk may be full", path.string());
}

void CameraWriter::write_joints(int frame, const std::vector<Eigen::Vector3d>& points) {
  for (std::size_t i = 0; i < points.size(); ++i)
    if (points[i].allFinite())
      joints_ += fmt::format("{},{},{},{:.2f},{:.2f},{:.2f}\n", frame, i, layout_.points[i], 1e3 * points[i].x(),
                             1e3 * points[i].y(), 1e3 * points[i].z());
}

void CameraWriter::close() {
  finish_video(images_, files_.video, shots_);
  finish_video(masks_, files_.masks, shots_);
  if (files_.table) write_keypoint_table(files_.keypoints, layout_, keypoints_);
  write_atomically(files_.joints, joints_);
}

fs::path motion_rows_file(const fs::path& folder) { return folder / "skeletoolToGTPose" / "poseAngles.motion"; }

void write_motion_rows(const fs::path& folder, const Motion& motion) {
  fs::create_directories(motion_rows_file(folder).parent_path());
  write_motion(motion_rows_file(folder), motion, true);
}

std::vector<std::string> calibration_files(const SynthOptions& options) {
  if (options.lens == Lens::fisheye) return {"cameras.yml"};
  return {"cameras.calibration", "cameras.yml"};
}

std::string capture_yaml(const SynthOptions& options, const std::vector<SequencePlan>& sequences,
                         const std::string& name) {
  std::string text = fmt::format(
      "doppel_capture: 1\n"
      "name: {}\n"
      "character: character/actor.character\n"
      "calibration: calibration/{}\n"
      "fps: {}\n"
      "background: background/{{camera:03}}.png\n"
      "keypoint_map: body25\n"
      "sequences:\n",
      nlohmann::json(name).dump(), calibration_files(options).front(), options.fps);
  const char* keypoints =
      options.keypoint_tables ? "{camera:03}.csv" : "{camera:03}/stream{camera:03}_{frame:012}_keypoints.json";
  for (const SequencePlan& sequence : sequences) {
    text += fmt::format(
        "  - name: {0}\n"
        "    split: {1}\n"
        "    videos: {0}/videos/stream{{camera:03}}.mp4\n"
        "    masks: {0}/foregroundSegmentation/stream{{camera:03}}.mkv\n"
        "    mask_threshold: 128\n"
        "    keypoints: {0}/keypoints/{2}\n"
        "    joints3d: {0}/joints3d/{{camera:03}}.csv\n"
        "    motion: {0}/skeletoolToGTPose/poseAngles.motion\n",
        sequence.name, sequence.training ? "train" : "test", keypoints);
    if (const std::vector<int> cuts = sequence.cuts(); !cuts.empty())
      text += fmt::format("    cuts: [{}]\n", fmt::join(cuts, ", "));
  }
  return text;
}

namespace {

/// The sentence of `README.txt` about the clothes.
const char* clothes_text(ClothModel model) {
  if (model == ClothModel::xpbd)
    return "The clothes (xpbd) hardly stretch, have weight,\n"
           "inertia and drag, and touch the body with friction";
  return "The clothes follow the body with inertia, drag and\n"
         "springs, and hang wider than on the template";
}

const char* lens_text(Lens lens) {
  return lens == Lens::fisheye ? "fisheye, for OpenCV (metres)"
                               : "as Skeletool text (millimetres) and for OpenCV (metres)";
}

}  // namespace

std::string readme_text(const SynthOptions& options, const std::vector<SequencePlan>& sequences) {
  const auto takes = [](const SequencePlan& sequence) {
    if (sequence.takes.size() == 1) return fmt::format("{} frames", sequence.frames());
    if (sequence.takes.size() > 2)
      return fmt::format("{} frames in {} takes", sequence.frames(), sequence.takes.size());
    return fmt::format("{} frames in two takes (the cut is before frame {})", sequence.frames(), sequence.cuts()[0]);
  };
  return fmt::format(
      "{}: nobody was filmed, all files are computed.\n"
      "\n"
      "character/                      the actor: template, texture, skeleton (33 DoFs), skin, graph, labels; "
      "millimetres\n"
      "calibration/                    {} cameras, {}\n"
      "background/NNN.png              the empty studio in camera NNN\n"
      "training/, testing/             {} and {}, {} per second\n"
      "  videos/streamNNN.mp4          images of camera NNN, {} x {} pixels\n"
      "  foregroundSegmentation/       masks, 0 or 255, lossless\n"
      "{}"
      "  joints3d/NNN.csv              the same in 3D, as a network would estimate them from camera NNN\n"
      "  skeletoolToGTPose/            the poses\n"
      "ground_truth/<sequence>/        vertices.npy: the true surface, float32 [frames, vertices, 3], world metres\n"
      "capture.yaml                    the description that `doppel prepare` reads\n"
      "\n"
      "World: right-handed, y up, floor at y = 0. Cameras: x right, y down, z forward; the centre of the first pixel "
      "is\n"
      "(0.5, 0.5). Frame f of a video is row f of the motion and of the vertices. {}: the surface depends on the "
      "movement, not on the pose alone.\n"
      "Seed {}.\n",
      kReadmeBeginning, options.cameras, lens_text(options.lens), takes(sequences[0]), takes(sequences[1]), options.fps,
      options.size, options.size,
      options.keypoint_tables
          ? "  keypoints/NNN.csv             landmarks as points of BODY_25, noisier where hidden\n"
          : "  keypoints/NNN/                landmarks as OpenPose BODY_25 files, noisier where hidden\n",
      clothes_text(options.cloth.model), options.seed);
}

}  // namespace doppel::synth
