#include "doppel/data/prepare/prepare.h"

#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <ctime>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>

#include "data/capture/capture_fixture.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/process.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/data/prepare/store.h"
#include "support/hostile_files.h"
#include "support/message_of.h"

namespace doppel::prepare_test {
namespace {

namespace fs = std::filesystem;
using test_capture::CaptureFixture;
using ::testing::HasSubstr;

std::map<std::string, std::string> all_records(const fs::path& out) {
  const Store store(out / "store", Store::Mode::read);
  std::map<std::string, std::string> records;
  for (const std::string& key : store.keys("")) records[key] = store.get(key).value();
  return records;
}

std::string prepare_error(const CaptureFixture& fixture) {
  return support::message_of<Error>([&] { fixture.prepare(); });
}

TEST(PrepareReference, StoresEveryFrameAndReportsEveryCamera) {
  const CaptureFixture fixture;
  const PrepareReport report = fixture.prepare();
  EXPECT_TRUE(report.finished);
  EXPECT_EQ(report.records, 3 * (12 + 5));
  EXPECT_EQ(report.new_records, report.records);
  ASSERT_EQ(report.cameras.size(), 6u);
  for (const CameraReport& camera : report.cameras) {
    EXPECT_EQ(camera.empty_frames, 0);
    EXPECT_GT(camera.coverage, 0.02);
    EXPECT_LT(camera.coverage, 0.3);
    EXPECT_EQ(camera.border_touch, 0.0);
    EXPECT_GT(camera.template_iou, 0.999);  // the masks are the template's own silhouette
  }
  EXPECT_THAT(report.table(), HasSubstr("training"));
  const auto json = nlohmann::json::parse(read_file(fixture.out() / "report.json"));
  EXPECT_EQ(json["cameras"].size(), 6u);
  EXPECT_GT(json["cameras"][0]["template_iou"].get<double>(), 0.99);

  const Dataset dataset = Dataset::open(fixture.out());
  EXPECT_EQ(dataset.cameras().size(), 3u);
  EXPECT_EQ(dataset.capture().root, fixture.root());
  EXPECT_EQ(dataset.samples(Split::train).size(), 12u);
  EXPECT_EQ(dataset.samples(Split::test, 2).size(), 3u);
  EXPECT_EQ(dataset.character_path(), fixture.root() / "character/tube.character");
}

TEST(PrepareReference, MasksAndCropsAreThoseOfTheFootage) {
  const CaptureFixture fixture;
  fixture.prepare();
  const Dataset dataset = Dataset::open(fixture.out());
  TemplateChecker checker(fixture.character);
  const Motion motion = fixture.motion("training");
  for (const long frame : {0L, 7L, 11L})
    for (int camera = 0; camera < 3; ++camera) {
      const SampleId sample{0, frame};
      const Eigen::Matrix3Xf vertices = checker.skin(motion.frames[frame]);
      const cv::Mat mask = dataset.mask(sample, camera);
      EXPECT_EQ(cv::countNonZero(mask != checker.silhouette(vertices, dataset.camera(camera))), 0);
      const CropBox box = dataset.crop_box(sample, camera);
      const cv::Mat small = dataset.crop_mask(sample, camera), image = dataset.crop_image(sample, camera);
      ASSERT_EQ(small.size(), cv::Size(64, 64));
      ASSERT_EQ(image.size(), cv::Size(48, 48));
      const cv::Mat drawn = checker.silhouette(vertices, crop_camera(dataset.camera(camera), box, 64));
      EXPECT_GT(static_cast<double>(cv::countNonZero(drawn & small)) / cv::countNonZero(drawn | small), 0.9);
      const cv::Vec3b middle = image.at<cv::Vec3b>(24, 24);
      EXPECT_GT(middle[2], 75);  // the person's red (160, softened by the video), not the studio's (30)
      const SilhouetteCrop crop = dataset.silhouette(sample, camera);
      ASSERT_TRUE(crop.valid);
      const cv::Mat distance = signed_distance(small);
      EXPECT_NEAR(crop.distance[20 * 64 + 31] / static_cast<float>(crop.steps_per_pixel), distance.at<float>(20, 31),
                  0.01);
    }
}

TEST(PrepareReference, ImageFoldersGiveTheSameMasksAsVideos) {
  test_capture::Options options{2, 4, 2, false};
  const CaptureFixture images(options);
  options.videos = true;
  const CaptureFixture videos(options);
  images.prepare();
  videos.prepare();
  const Dataset a = Dataset::open(images.out()), b = Dataset::open(videos.out());
  for (const SampleId& sample : a.samples(Split::train))
    for (int camera = 0; camera < 2; ++camera)
      EXPECT_EQ(cv::countNonZero(a.mask(sample, camera) != b.mask(sample, camera)), 0);
}

TEST(PrepareReference, ChromaKeyFindsThePersonWithoutMasks) {
  const CaptureFixture fixture(test_capture::Options{2, 4, 2, false});
  std::string yaml = fixture.yaml("");
  for (const std::string name : {"training", "testing"})
    yaml = support::replaced(yaml, "masks: " + name + "/masks/{name}/{frame:04}.png",
                             "chroma_key: {space: ycrcb, colour: [30, 180, 60], smooth: 1}");
  fixture.write_yaml(yaml);
  const PrepareReport report = fixture.prepare();
  for (const CameraReport& camera : report.cameras) EXPECT_GT(camera.template_iou, 0.99);
}

/// The fixture's capture with masks cut out by subtraction of an empty scene, given as an image, images or a video.
PrepareReport prepare_by_subtraction(const CaptureFixture& fixture, const std::string& empty) {
  std::string yaml = fixture.yaml("");
  for (const std::string name : {"training", "testing"})
    yaml = support::replaced(yaml, "masks: " + name + "/masks/{name}/{frame:04}.png",
                             "background_subtraction: {empty: \"" + empty + "\"}");
  fixture.write_yaml(yaml);
  PrepareOptions options = fixture.prepare_options();
  options.overwrite = true;
  return prepare_capture(fixture.capture(), options);
}

const test_capture::Options kImages{3, 4, 2, false};

TEST(PrepareReference, BackgroundSubtractionFindsThePersonWithoutMasks) {
  const CaptureFixture fixture(kImages);
  const cv::Mat empty(test_capture::kHeight, test_capture::kWidth, CV_8UC3, cv::Scalar(60, 180, 30));
  const std::vector<cv::Mat> frames(6, empty);
  for (const std::string name : {"0", "1", "2"}) {
    test_capture::write_images(fixture.root() / "empty" / name, frames);
    test_capture::write_video(fixture.root() / "empty" / (name + ".avi"), "MJPG", frames);
  }
  for (const std::string source : {"empty/{name}/0003.png", "empty/{name}/{frame:04}.png", "empty/{name}.avi"})
    for (const CameraReport& camera : prepare_by_subtraction(fixture, source).cameras) {
      EXPECT_GT(camera.template_iou, 0.95) << source;
      EXPECT_EQ(camera.empty_frames, 0);
    }
}

TEST(PrepareRejects, EmptyScenesThatCannotBe) {
  const CaptureFixture fixture(kImages);
  const auto refusal = [&](const std::string& empty) {
    return support::message_of<Error>([&] { prepare_by_subtraction(fixture, empty); });
  };
  EXPECT_THAT(refusal("none/{name}.avi"), HasSubstr("none/0.avi"));
  EXPECT_THAT(refusal("none/{name}.png"), HasSubstr("none/0.png"));
  test_capture::write_images(fixture.root() / "small", {cv::Mat::zeros(30, 40, CV_8UC3)});
  EXPECT_THAT(refusal("small/0000.png"), HasSubstr("40x30"));
  support::write_bytes(fixture.root() / "broken.avi", "RIFF....AVI ");
  EXPECT_THAT(refusal("broken.avi"), HasSubstr("broken.avi"));
  support::write_bytes(fixture.root() / "broken.png", "\x89PNG");
  EXPECT_THAT(refusal("broken.png"), HasSubstr("broken.png"));
}

// ---- without a motion ----

/// The fixture's description without any motion.
std::string without_motion(const CaptureFixture& fixture, const std::string& extra = "") {
  std::string yaml = fixture.yaml(extra);
  for (const std::string name : {"training", "testing"})
    yaml = support::replaced(yaml, "    motion: " + name + "/poses.motion\n", "");
  return yaml;
}

TEST(PrepareWithoutMotion, StoresMasksAndImagesOfAllFrames) {
  const CaptureFixture fixture;
  fixture.prepare();
  const Dataset posed = Dataset::open(fixture.out());
  fixture.write_yaml(without_motion(fixture));
  PrepareOptions options = fixture.prepare_options();
  options.out = fixture.path("unposed");
  const PrepareReport report = prepare_capture(fixture.capture(), options);
  EXPECT_EQ(report.records, 3 * (12 + 5));
  EXPECT_EQ(report.cameras[0].checked_frames, 0);
  EXPECT_TRUE(nlohmann::json::parse(report.json())["cameras"][0]["template_iou"].is_null());
  const Dataset dataset = Dataset::open(options.out);
  ASSERT_EQ(dataset.samples(Split::train).size(), 12u);
  EXPECT_FALSE(dataset.sequences()[0].has_motion());
  EXPECT_TRUE(posed.sequences()[0].has_motion());
  EXPECT_EQ(cv::countNonZero(dataset.mask({0, 7}, 2) != posed.mask({0, 7}, 2)), 0);
  EXPECT_THAT(support::message_of<Error>([&] {
                dataset.dof_window({0, 7}, 2);
              }),
              ::testing::AllOf(HasSubstr("training"), HasSubstr("doppel track")));
  const Batch batch = make_batch(dataset, {{0, 3}, {1, 2}}, {{2, 0}, {1, 2}}, {2});
  EXPECT_FALSE(batch.dofs.defined());
  EXPECT_TRUE(torch::equal(batch.distance, make_batch(posed, {{0, 3}, {1, 2}}, {{2, 0}, {1, 2}}, {2}).distance));
}

TEST(PrepareWithoutMotion, RowsAreTheFramesThatAllCamerasHave) {
  const CaptureFixture fixture;
  TemplateChecker checker(fixture.character);
  std::vector<cv::Mat> images, masks;
  test_capture::draw(checker, fixture.motion("training"), fixture.cameras[1], images, masks);
  images.resize(9);
  test_capture::write_video(fixture.root() / "training/videos/01.avi", "MJPG", images);
  fixture.write_yaml(without_motion(fixture, "    frame_offset: {\"2\": 1}\n"));
  fixture.prepare();
  EXPECT_EQ(Dataset::open(fixture.out()).samples(Split::train).size(), 9u);
  fixture.write_yaml(without_motion(fixture, "    last_frame: 9\n"));
  EXPECT_THAT(prepare_error(fixture), ::testing::AllOf(HasSubstr("its videos have"), HasSubstr("0 to 8")));
  fixture.write_yaml(without_motion(fixture, "    cuts: [11]\n"));
  EXPECT_THAT(prepare_error(fixture), HasSubstr("cut"));
}

// One camera, the person enters after some frames of the empty scene: what adapting to a new studio starts from.
TEST(PrepareWithoutMotion, OneCameraWithItsOwnEmptyFrames) {
  const CaptureFixture fixture;
  TemplateChecker checker(fixture.character);
  std::vector<cv::Mat> images, masks;
  test_capture::draw(checker, fixture.motion("training"), fixture.cameras[1], images, masks);
  std::vector<cv::Mat> clip(6, cv::Mat(test_capture::kHeight, test_capture::kWidth, CV_8UC3, cv::Scalar(60, 180, 30)));
  clip.insert(clip.end(), images.begin(), images.end());
  test_capture::write_video(fixture.root() / "clip.avi", "MJPG", clip);
  fixture.write_yaml(
      "doppel_capture: 1\ncharacter: character/tube.character\ncalibration: calibration/cameras.calibration\n"
      "cameras: [1]\nsequences:\n  - name: clip\n    split: test\n    videos: clip.avi\n"
      "    background_subtraction: {frames: [0, 5]}\n    first_frame: 6\n");
  const PrepareReport report = fixture.prepare();
  ASSERT_EQ(report.cameras.size(), 1u);
  EXPECT_EQ(report.cameras[0].frames, 12);
  EXPECT_EQ(report.cameras[0].empty_frames, 0);
  const Dataset dataset = Dataset::open(fixture.out());
  for (const long frame : {6L, 17L}) test_capture::expect_cut_out(dataset.mask({0, frame}, 0), masks[frame - 6]);
}

TEST(PrepareReference, FrameOffsetsShiftTheVideo) {
  const CaptureFixture fixture;
  fixture.write_yaml(fixture.yaml("    frame_offset: {\"1\": 3}\n    first_frame: 1\n    last_frame: 8\n"));
  EXPECT_THAT(prepare_error(fixture), ::testing::AnyOf("nothing was thrown", HasSubstr("template")));
  PrepareOptions options = fixture.prepare_options();
  options.force = true;
  prepare_capture(fixture.capture(), options);
  const Dataset dataset = Dataset::open(fixture.out());
  TemplateChecker checker(fixture.character);
  const Motion motion = fixture.motion("training");
  const auto expected = [&](long row, int camera) {
    return checker.silhouette(checker.skin(motion.frames[row]), dataset.camera(camera));
  };
  EXPECT_EQ(dataset.samples(Split::train).size(), 8u);
  EXPECT_EQ(cv::countNonZero(dataset.mask({0, 4}, 0) != expected(4, 0)), 0);
  EXPECT_EQ(cv::countNonZero(dataset.mask({0, 4}, 1) != expected(7, 1)), 0);
}

TEST(PrepareReference, MaskOffsetsAreTheNumbersOfTheFirstMasks) {
  const test_capture::Options options{2, 4, 2, false};
  const CaptureFixture usual(options), from_one(options);
  const std::filesystem::path masks = from_one.root() / "training/masks/0";
  for (int f = 3; f >= 0; --f)
    std::filesystem::rename(masks / fmt::format("{:04}.png", f), masks / fmt::format("{:04}.png", f + 1));
  from_one.write_yaml(from_one.yaml("    mask_offset: {\"0\": 1}\n"));
  usual.prepare();
  from_one.prepare();
  const Dataset a = Dataset::open(usual.out()), b = Dataset::open(from_one.out());
  for (const SampleId& sample : a.samples(Split::train))
    for (int camera = 0; camera < 2; ++camera)
      EXPECT_EQ(cv::countNonZero(a.mask(sample, camera) != b.mask(sample, camera)), 0);
}

TEST(PrepareReference, TwoThreadsGiveTheSameRecords) {
  const CaptureFixture fixture;
  PrepareOptions options = fixture.prepare_options();
  prepare_capture(fixture.capture(), options);
  const auto one = all_records(options.out);
  options.out = fixture.path("two");
  options.threads = 2;
  options.chunk_frames = 3;
  prepare_capture(fixture.capture(), options);
  EXPECT_EQ(all_records(options.out), one);
}

long count_records(const fs::path& out) {
  if (!Store::exists(out / "store") || fs::file_size(out / "store/data.mdb") == 0) return 0;
  return static_cast<long>(Store(out / "store", Store::Mode::read).keys("frames/").size());
}

/// Runs prepare in a child process, which the kernel kills after `seconds` of its own processor time; 0: never. Time of
/// day would depend on what else the machine does.
/// @return the processor time of a child that came to its end, in seconds; nothing for one that was killed
std::optional<double> prepare_in_child(const CaptureFixture& fixture, const PrepareOptions& options, double seconds) {
  const pid_t child = fork();
  if (child == 0) {
    // The parent's thread pools do not live on in the child.
    at::set_num_threads(1);
    cv::setNumThreads(1);
    sigevent event{};
    event.sigev_notify = SIGEV_SIGNAL;
    event.sigev_signo = SIGKILL;
    itimerspec limit{};
    limit.it_value.tv_sec = static_cast<time_t>(seconds);
    limit.it_value.tv_nsec = static_cast<long>(1e9 * (seconds - std::floor(seconds)));
    timer_t timer;
    int code = 0;
    try {
      if (timer_create(CLOCK_PROCESS_CPUTIME_ID, &event, &timer) != 0 || timer_settime(timer, 0, &limit, nullptr) != 0)
        _exit(3);
      prepare_capture(fixture.capture(), options);
    } catch (...) {
      code = 2;
    }
    _exit(code);
  }
  int status = 0;
  rusage usage{};
  wait4(child, &status, 0, &usage);
  if (WIFSIGNALED(status)) return std::nullopt;
  EXPECT_EQ(WEXITSTATUS(status), 0) << "prepare failed after an earlier one was killed";
  const auto in_seconds = [](const timeval& time) { return double(time.tv_sec) + 1e-6 * double(time.tv_usec); };
  return in_seconds(usage.ru_utime) + in_seconds(usage.ru_stime);
}

// What is there after many kills must be what an unbroken run makes, byte for byte.
TEST(PrepareRecovers, FromBeingKilledAtAnyMoment) {
  const CaptureFixture fixture(test_capture::Options{.train_frames = 60});
  PrepareOptions options = fixture.prepare_options();
  options.chunk_frames = 2;
  const std::optional<double> whole = prepare_in_child(fixture, options, 0.0);
  ASSERT_TRUE(whole);
  const auto unbroken = all_records(options.out);
  options.out = fixture.path("killed");
  std::set<long> found;
  const int kSteps = 40;
  for (int step = 1; step <= 3 * kSteps; ++step) {
    const bool killed = !prepare_in_child(fixture, options, *whole * step / kSteps);
    found.insert(count_records(options.out));
    if (!killed) break;
  }
  EXPECT_GT(found.size(), 2u) << "no run of " << *whole << " s was killed half-way";
  EXPECT_TRUE(prepare_capture(fixture.capture(), options).finished);
  EXPECT_EQ(all_records(options.out), unbroken);
}

TEST(PrepareRecovers, FromCtrlC) {
  const CaptureFixture fixture;
  request_stop();
  const PrepareReport stopped = fixture.prepare();
  request_stop(false);
  EXPECT_FALSE(stopped.finished);
  EXPECT_THROW(Dataset::open(fixture.out()), Error);
  EXPECT_TRUE(fixture.prepare().finished);
  EXPECT_EQ(fixture.prepare().new_records, 0);
  EXPECT_NO_THROW(Dataset::open(fixture.out()));
}

TEST(PrepareRejects, OtherSettingsUnlessOverwriting) {
  const CaptureFixture fixture;
  fixture.prepare();
  PrepareOptions options = fixture.prepare_options();
  options.mask_size = 80;
  EXPECT_THAT(support::message_of<Error>([&] { prepare_capture(fixture.capture(), options); }),
              ::testing::AllOf(HasSubstr("'mask size 64' then, 'mask size 80' now"), HasSubstr("--overwrite")));
  options.overwrite = true;
  prepare_capture(fixture.capture(), options);
  EXPECT_EQ(Dataset::open(fixture.out()).mask_size(), 80);
}

TEST(PrepareRejects, MaskImagesThatWereDrawnAgain) {
  const CaptureFixture fixture(test_capture::Options{2, 4, 2, false});
  fixture.prepare();
  const auto masks = fixture.root() / "training/masks";
  for (const auto& entry : std::filesystem::recursive_directory_iterator(masks)) {
    if (!entry.is_regular_file()) continue;
    cv::Mat mask = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
    cv::erode(mask, mask, cv::Mat(), {-1, -1}, 5);
    cv::imwrite(entry.path().string(), mask);
  }
  EXPECT_THAT(support::message_of<Error>([&] { fixture.prepare(); }),
              ::testing::AllOf(HasSubstr("bytes"), HasSubstr("--overwrite")));
}

TEST(PrepareRejects, FrameCountsThatDiffer) {
  const CaptureFixture fixture;
  const Motion longer = test_capture::swaying_motion(fixture.character, 14, 0.0);
  write_motion(fixture.root() / "training/poses.motion", longer, true);
  EXPECT_THAT(prepare_error(fixture), HasSubstr("12 frames"));
  fixture.write_yaml(fixture.yaml("    last_frame: 11\n"));
  EXPECT_EQ(prepare_error(fixture), "nothing was thrown");
}

TEST(PrepareRejects, MoreFramesThanPosesUnlessTheRangeIsStated) {
  const CaptureFixture fixture;
  write_motion(fixture.root() / "training/poses.motion", test_capture::swaying_motion(fixture.character, 9, 0.0), true);
  const std::string message = prepare_error(fixture);
  EXPECT_THAT(message, HasSubstr("12 frames"));
  EXPECT_THAT(message, HasSubstr("last_frame: 8"));
  EXPECT_THAT(message, HasSubstr("camera 0"));
}

TEST(PrepareRejects, MasksThatAreTooShort) {
  const CaptureFixture fixture;
  std::vector<cv::Mat> masks(4, cv::Mat::zeros(test_capture::kHeight, test_capture::kWidth, CV_8U));
  test_capture::write_video(fixture.root() / "training/masks/01.mkv", "FFV1", masks);
  const std::string message = prepare_error(fixture);
  EXPECT_THAT(message, HasSubstr("camera 1"));
  EXPECT_THAT(message, HasSubstr("4 frames"));
  EXPECT_THAT(message, HasSubstr("mask"));
}

TEST(PrepareRejects, ATruncatedVideo) {
  const CaptureFixture fixture;
  const fs::path video = fixture.root() / "training/videos/02.avi";
  for (const double share : {0.3, 0.0}) {
    fs::resize_file(video, static_cast<std::uintmax_t>(share * static_cast<double>(fs::file_size(video))));
    EXPECT_THAT(prepare_error(fixture), HasSubstr("02.avi"));
  }
}

TEST(PrepareRejects, ImagesOfAnotherShape) {
  const CaptureFixture fixture;
  std::vector<Camera> cameras = fixture.cameras;
  cameras[1].width = 200;
  write_calibration(fixture.root() / "calibration/cameras.calibration", cameras);
  const std::string message = prepare_error(fixture);
  EXPECT_THAT(message, HasSubstr("camera 1"));
  EXPECT_THAT(message, HasSubstr("aspect ratio"));
}

TEST(PrepareReference, CalibrationOfAnotherResolutionIsScaled) {
  const CaptureFixture fixture;
  std::vector<Camera> cameras;
  for (const Camera& camera : fixture.cameras) cameras.push_back(camera.scaled_to(2 * camera.width, 2 * camera.height));
  write_calibration(fixture.root() / "calibration/cameras.calibration", cameras);
  for (const CameraReport& camera : fixture.prepare().cameras) EXPECT_GT(camera.template_iou, 0.99);
}

/// What prepare says when every camera was changed by `change`.
template <typename F>
std::string error_with_cameras(const F& change) {
  const CaptureFixture fixture(test_capture::Options{1, 3, 2, true});
  std::vector<Camera> cameras = fixture.cameras;
  for (Camera& camera : cameras) change(camera);
  write_calibration(fixture.root() / "calibration/cameras.calibration", cameras);
  return prepare_error(fixture);
}

TEST(PrepareRejects, CamerasThatCannotBeRight) {
  EXPECT_THAT(error_with_cameras([](Camera& c) { c.t *= 1000.0; }), HasSubstr("m from the person"));
  EXPECT_THAT(error_with_cameras([](Camera& c) {
                c.R = Eigen::Vector3d(-1, 1, -1).asDiagonal() * c.R;
                c.t = Eigen::Vector3d(-1, 1, -1).asDiagonal() * c.t;
              }),
              HasSubstr("looks away"));
  EXPECT_THAT(error_with_cameras([](Camera& c) { c.t.x() += 4.0; }), HasSubstr("never sees"));
  EXPECT_THAT(error_with_cameras([](Camera& c) { c.t.x() += 0.6; }), HasSubstr("does not cover the person"));
}

TEST(PrepareRejects, MirroredImagesByName) {
  const CaptureFixture fixture(test_capture::Options{1, 3, 2, true});
  // A camera that has the person left of the middle; its masks then lie right of it.
  std::vector<Camera> cameras = fixture.cameras;
  cameras[0].K(0, 2) -= 30.0;
  write_calibration(fixture.root() / "calibration/cameras.calibration", cameras);
  TemplateChecker checker(fixture.character);
  for (const std::string name : {"training", "testing"}) {
    std::vector<cv::Mat> images, masks;
    test_capture::draw(checker, fixture.motion(name), cameras[0], images, masks);
    for (cv::Mat& mask : masks) cv::flip(mask, mask, 1);
    test_capture::write_video(fixture.root() / name / "masks/00.mkv", "FFV1", masks);
  }
  EXPECT_THAT(prepare_error(fixture), HasSubstr("mirrored"));
}

TEST(PrepareRejects, ACharacterInOtherUnits) {
  const CaptureFixture fixture;
  Character giant = fixture.character;
  for (Eigen::Vector3d& vertex : giant.mesh.vertices) vertex *= 1000.0;
  write_character(fixture.root() / "character", giant);
  EXPECT_THAT(prepare_error(fixture), HasSubstr("which no person does"));
}

TEST(PrepareRejects, MasksWithoutAnyone) {
  const CaptureFixture fixture;
  fixture.write_yaml(fixture.yaml("    mask_threshold: 255\n"));
  // Masks are 0 or 255: the highest threshold still takes them.
  EXPECT_EQ(prepare_error(fixture), "nothing was thrown");
  std::vector<cv::Mat> masks(12, cv::Mat::zeros(test_capture::kHeight, test_capture::kWidth, CV_8U));
  test_capture::write_video(fixture.root() / "training/masks/01.mkv", "FFV1", masks);
  fs::remove_all(fixture.out());
  EXPECT_THAT(prepare_error(fixture), HasSubstr("all masks are empty"));
}

TEST(PrepareRejects, MissingPartsByName) {
  const CaptureFixture fixture;
  fs::remove(fixture.root() / "training/videos/01.avi");
  EXPECT_THAT(prepare_error(fixture), HasSubstr("01.avi"));
  fixture.write_yaml("cameras: [0, nine]\n" + fixture.yaml());
  EXPECT_THAT(prepare_error(fixture), HasSubstr("'nine'"));
}

TEST(PrepareReference, EmptyMasksDropTheCameraForThatFrame) {
  const CaptureFixture fixture;
  TemplateChecker checker(fixture.character);
  std::vector<cv::Mat> images, masks;
  test_capture::draw(checker, fixture.motion("training"), fixture.cameras[1], images, masks);
  masks[4].setTo(0);
  test_capture::write_video(fixture.root() / "training/masks/01.mkv", "FFV1", masks);
  EXPECT_EQ(fixture.prepare().cameras[1].empty_frames, 1);
  const Dataset dataset = Dataset::open(fixture.out());
  EXPECT_FALSE(dataset.silhouette({0, 4}, 1).valid);
  EXPECT_TRUE(dataset.silhouette({0, 5}, 1).valid);
  EXPECT_TRUE(dataset.crop_box({0, 4}, 1).empty());
  EXPECT_TRUE(dataset.crop_image({0, 4}, 1).empty());
  EXPECT_EQ(cv::countNonZero(dataset.mask({0, 4}, 1)), 0);
}

}  // namespace
}  // namespace doppel::prepare_test
