#include "doppel/synth/capture_writer.h"

#include <array>
#include <nlohmann/json.hpp>

#include "doppel/character/motion.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/video_file.h"
#include "doppel/detect/keypoints/keypoint_map.h"

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

SequenceWriter::SequenceWriter(const fs::path& folder, const std::vector<Camera>& cameras, double fps)
    : folder_(folder), shots_(cameras.size(), 0), names_(read_keypoint_map("body25").layout.points) {
  const auto code = cv::VideoWriter::fourcc;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const cv::Size size(cameras[c].width, cameras[c].height);
    const std::string stream = "stream" + three_digits(static_cast<int>(c));
    images_.push_back(open_video(folder / "videos" / (stream + ".mp4"),
                                 {code('a', 'v', 'c', '1'), code('m', 'p', '4', 'v')}, fps, size, true));
    masks_.push_back(open_video(folder / "foregroundSegmentation" / (stream + ".mkv"), {code('F', 'F', 'V', '1')}, fps,
                                size, false));
    fs::create_directories(folder / "keypoints" / three_digits(static_cast<int>(c)));
    fs::create_directories(folder / "joints3d");
    joints_.emplace_back(folder / "joints3d" / (three_digits(static_cast<int>(c)) + ".csv"), std::ios::binary);
    joints_.back() << "frame,index,name,x_mm,y_mm,z_mm\n";
  }
}

void SequenceWriter::write_shot(int camera, const Studio::Shot& shot) {
  images_[camera].write(shot.image);
  masks_[camera].write(shot.mask);
  ++shots_[camera];
}

void SequenceWriter::write_keypoints(int camera, int frame, const std::vector<double>& body25) {
  const nlohmann::json person = {{"person_id", {-1}}, {"pose_keypoints_2d", body25}};
  const nlohmann::json file = {{"version", 1.3}, {"people", {person}}};
  const std::string name = fmt::format("stream{}_{:012}_keypoints.json", three_digits(camera), frame);
  const fs::path path = folder_ / "keypoints" / three_digits(camera) / name;
  // The files are not written atomically one by one: the whole folder is renamed at the end, and flushing thousands of
  // small files takes longer than computing them.
  std::ofstream stream(path, std::ios::binary);
  stream << file.dump() << '\n';
  if (!stream.flush()) fail("writing {}: the disk may be full", path.string());
}

void SequenceWriter::write_joints(int camera, int frame, const std::vector<Eigen::Vector3d>& points) {
  std::ofstream& table = joints_[camera];
  for (std::size_t i = 0; i < points.size(); ++i)
    if (points[i].allFinite())
      table << fmt::format("{},{},{},{:.2f},{:.2f},{:.2f}\n", frame, i, names_[i], 1e3 * points[i].x(),
                           1e3 * points[i].y(), 1e3 * points[i].z());
}

void SequenceWriter::write_motion_rows(const Motion& motion) {
  const fs::path path = folder_ / "skeletoolToGTPose" / "poseAngles.motion";
  fs::create_directories(path.parent_path());
  write_motion(path, motion, true);
}

void SequenceWriter::close() {
  for (std::size_t c = 0; c < images_.size(); ++c) {
    const std::string stream = "stream" + three_digits(static_cast<int>(c));
    finish_video(images_[c], folder_ / "videos" / (stream + ".mp4"), shots_[c]);
    finish_video(masks_[c], folder_ / "foregroundSegmentation" / (stream + ".mkv"), shots_[c]);
  }
  for (std::ofstream& table : joints_)
    if (!table.flush()) fail("writing the tables in {}: the disk may be full", (folder_ / "joints3d").string());
}

std::vector<int> body25_markers(const Skeleton& skeleton) {
  static const std::array<const char*, 25> kNames{"nose",
                                                  "neck",
                                                  "right_shoulder",
                                                  "right_elbow",
                                                  "right_wrist",
                                                  "left_shoulder",
                                                  "left_elbow",
                                                  "left_wrist",
                                                  "mid_hip",
                                                  "right_hip",
                                                  "right_knee",
                                                  "right_ankle",
                                                  "left_hip",
                                                  "left_knee",
                                                  "left_ankle",
                                                  "right_eye",
                                                  "left_eye",
                                                  "right_ear",
                                                  "left_ear",
                                                  "left_big_toe",
                                                  "",
                                                  "",
                                                  "right_big_toe",
                                                  "",
                                                  ""};
  std::vector<int> markers;
  for (const std::string name : kNames) {
    int found = -1;
    for (std::size_t m = 0; m < skeleton.markers.size(); ++m)
      if (skeleton.markers[m].name == name) found = static_cast<int>(m);
    markers.push_back(found);
  }
  return markers;
}

std::vector<std::string> calibration_files(const SynthOptions& options) {
  if (options.lens == Lens::fisheye) return {"cameras.yml"};
  return {"cameras.calibration", "cameras.yml"};
}

std::string capture_yaml(const SynthOptions& options, const std::string& name) {
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
  for (const bool training : {true, false}) {
    const std::string folder = training ? "training" : "testing";
    text += fmt::format(
        "  - name: {0}\n"
        "    split: {1}\n"
        "    videos: {0}/videos/stream{{camera:03}}.mp4\n"
        "    masks: {0}/foregroundSegmentation/stream{{camera:03}}.mkv\n"
        "    mask_threshold: 128\n"
        "    keypoints: {0}/keypoints/{{camera:03}}/stream{{camera:03}}_{{frame:012}}_keypoints.json\n"
        "    joints3d: {0}/joints3d/{{camera:03}}.csv\n"
        "    motion: {0}/skeletoolToGTPose/poseAngles.motion\n",
        folder, training ? "train" : "test");
    if (training) text += fmt::format("    cuts: [{}]\n", options.frames / 2);
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

std::string readme_text(const SynthOptions& options) {
  return fmt::format(
      "A synthetic capture, made by `doppel synth`: nobody was filmed, all files are computed.\n"
      "\n"
      "character/                      the actor: template, texture, skeleton (33 DoFs), skin, graph, labels; "
      "millimetres\n"
      "calibration/                    {} cameras, {}\n"
      "background/NNN.png              the empty studio in camera NNN\n"
      "training/, testing/             {} frames in two segments (the cut is before frame {}) and {} frames, {} per "
      "second\n"
      "  videos/streamNNN.mp4          images of camera NNN, {} x {} pixels\n"
      "  foregroundSegmentation/       masks, 0 or 255, lossless\n"
      "  keypoints/NNN/                landmarks as OpenPose BODY_25 files, noisier where hidden\n"
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
      options.cameras, lens_text(options.lens), options.frames, options.frames / 2, options.test_frames, options.fps,
      options.size, options.size, clothes_text(options.cloth.model), options.seed);
}

}  // namespace doppel::synth
