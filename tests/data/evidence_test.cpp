#include "doppel/data/evidence.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "data/keypoint_fixture.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/data/capture_layouts.h"
#include "doppel/data/loader.h"
#include "doppel/data/mask.h"
#include "doppel/data/store_layout.h"
#include "doppel/data/synth/synth.h"
#include "support/message_of.h"
#include "support/shared_folder.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;
using namespace test_capture;
using support::message_of;
using support::replaced;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::string yaml_of(const CaptureFixture& fixture) { return read_file(fixture.root() / "capture.yaml"); }

/// Where the landmarks really are in a picture.
Eigen::Vector2d true_pixel(const CaptureFixture& fixture, const Camera& camera, const std::string& sequence, long frame,
                           int landmark) {
  return camera.project(landmark_positions(fixture.character.skeleton, some_landmarks(fixture.character),
                                           fixture.motion(sequence).frames.at(frame))
                            .at(landmark));
}

void expect_at(const Keypoint& point, const Eigen::Vector2d& pixel, double tolerance = 0.01) {
  EXPECT_GT(point.confidence, 0.0f);
  EXPECT_NEAR(point.x, pixel.x(), tolerance);
  EXPECT_NEAR(point.y, pixel.y(), tolerance);
}

TEST(EvidenceReference, KeypointsArePreparedOntoLandmarks) {
  const CaptureFixture fixture;
  add_keypoints(fixture);
  const PrepareReport report = fixture.prepare();
  const Dataset dataset = Dataset::open(fixture.out());
  const std::vector<Marker> written = some_landmarks(fixture.character);
  ASSERT_EQ(dataset.landmarks().size(), written.size());
  for (std::size_t m = 0; m < written.size(); ++m) {
    EXPECT_EQ(dataset.landmarks()[m].name, written[m].name);
    EXPECT_EQ(dataset.landmarks()[m].joint, written[m].joint);
    EXPECT_LT((dataset.landmarks()[m].position - written[m].position).norm(), 1e-9);
  }
  for (int camera = 0; camera < 3; ++camera) {
    const std::vector<Keypoint> points = dataset.keypoints({1, 4}, camera);
    for (int m = 0; m < 6; ++m) expect_at(points[m], true_pixel(fixture, dataset.camera(camera), "testing", 4, m));
    EXPECT_FLOAT_EQ(points[3].confidence, 0.87f);
  }
  for (const CameraReport& camera : report.cameras) {
    ASSERT_TRUE(camera.keypoints.has_value());
    EXPECT_EQ(camera.keypoints->missing_files, 0);
    EXPECT_DOUBLE_EQ(camera.keypoints->seen, 1.0);
  }
  EXPECT_THAT(report.table(), HasSubstr("landmarks"));
  const auto json = nlohmann::json::parse(read_file(fixture.out() / "report.json"));
  EXPECT_EQ(json["cameras"][0]["keypoints"]["nobody"], 0);
}

TEST(EvidenceReference, BatchesCarryKeypointsAndWholeCameras) {
  const CaptureFixture fixture;
  add_keypoints(fixture);
  fixture.prepare();
  const Dataset dataset = Dataset::open(fixture.out());
  BatchOptions options;
  options.keypoints = true;
  const Batch batch = make_batch(dataset, {{0, 3}, {1, 2}}, {{2, 0}, {1, 2}}, options);
  EXPECT_EQ(batch.keypoints.sizes(), (std::vector<std::int64_t>{2, 2, 6, 3}));
  EXPECT_FLOAT_EQ(batch.keypoint_scale[1][1].item<float>(), 1024.0f / kWidth);
  EXPECT_FALSE(batch.person.defined());
  const Motion motion = fixture.motion("testing");
  const auto positions =
      landmark_positions(fixture.character.skeleton, some_landmarks(fixture.character), motion.frames[2]);
  for (int c = 0; c < 2; ++c) {
    const Camera& camera = dataset.camera(c == 0 ? 1 : 2);
    for (int m = 0; m < 6; ++m) {
      const auto point = torch::tensor({positions[m].x(), positions[m].y(), positions[m].z()}, torch::kFloat32);
      const auto projected = batch.camera_projection[1][c].matmul(torch::cat({point, torch::ones({1})}));
      const auto pixel = projected.slice(0, 0, 2) / projected[2];
      EXPECT_LT((pixel - batch.keypoints[1][c][m].slice(0, 0, 2)).abs().max().item<float>(), 0.02f);
      // The same through rotation and position.
      const auto seen = batch.camera_rotation[1][c].matmul(point - batch.camera_position[1][c]);
      EXPECT_NEAR(seen[2].item<float>(), projected[2].item<float>(), 1e-4);
      EXPECT_NEAR(seen[0].item<float>(), camera.camera_from_world(positions[m]).x(), 1e-4);
    }
  }
}

TEST(EvidenceReference, TheLensIsTakenOutOfThePoints) {
  Camera camera = ring_camera(0, 3);
  camera.distortion = {-0.25, 0.08, 0.002, -0.003, 0.01, 0, 0, 0};
  const Undistorter undistorter(camera);
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.5, 1.8, 0.2), Eigen::Vector3d(-0.3, 0.9, 0.1)}) {
    const Eigen::Vector2d filmed = camera.project(point), wanted = undistorter.pinhole().project(point);
    EXPECT_GT((filmed - wanted).norm(), 0.05) << "the test's lens does nothing";
    EXPECT_LT((undistorter.apply(filmed) - wanted).norm(), 1e-5);
  }
  for (const double far : {-1e6, 1e6}) EXPECT_TRUE(undistorter.apply(Eigen::Vector2d(far, far)).allFinite());
}

TEST(EvidenceReference, SeveralPeopleNobodyAndMissingFiles) {
  const CaptureFixture fixture;
  add_keypoints(fixture);
  const Motion motion = fixture.motion("training");
  // A surer person in the corner, away from the mask.
  std::vector<float> other(75, 3.0f);
  for (int i = 2; i < 75; i += 3) other[i] = 1.0f;
  support::write_bytes(keypoint_path(fixture, "training", 0, 4),
                       openpose_text({other, body25_person(fixture.character, fixture.cameras[0], motion.frames[4])}));
  support::write_bytes(keypoint_path(fixture, "training", 0, 5), openpose_text({}));
  fs::remove(keypoint_path(fixture, "training", 0, 6));
  const PrepareReport report = fixture.prepare();
  ASSERT_TRUE(report.cameras[0].keypoints.has_value());
  EXPECT_EQ(report.cameras[0].keypoints->several, 1);
  EXPECT_EQ(report.cameras[0].keypoints->nobody, 2);
  EXPECT_EQ(report.cameras[0].keypoints->missing_files, 1);
  EXPECT_EQ(report.cameras[1].keypoints->missing_files, 0);
  const Dataset dataset = Dataset::open(fixture.out());
  expect_at(dataset.keypoints({0, 4}, 0)[2], true_pixel(fixture, dataset.camera(0), "training", 4, 2));
  for (const long frame : {5L, 6L})
    for (const Keypoint& point : dataset.keypoints({0, frame}, 0)) EXPECT_EQ(point.confidence, 0.0f);
}

TEST(EvidenceReference, FrameOffsetsAndTheFilter) {
  const CaptureFixture fixture;
  add_keypoints(fixture, "keypoint_filter: {window: 2, sigma: 0, outlier: 1}\n");
  // Camera 1 began two frames early, says the capture; its row f is file f + 2.
  fixture.write_yaml(replaced(yaml_of(fixture), "    cuts: [5]\n",
                              "    cuts: [5]\n    frame_offset: {\"1\": 2}\n    last_frame: 9\n"));
  support::write_bytes(keypoint_path(fixture, "training", 1, 9), openpose_text({}));
  PrepareOptions options = fixture.prepare_options();
  options.force = true;  // the masks of camera 1 are now those of other frames
  prepare_capture(fixture.capture(), options);
  const Dataset dataset = Dataset::open(fixture.out());
  expect_at(dataset.keypoints({0, 3}, 1)[0], true_pixel(fixture, dataset.camera(1), "training", 5, 0));
  // File 9 holds nobody; row 7 is bridged between its neighbours, with half of their confidence.
  const Keypoint bridged = dataset.keypoints({0, 7}, 1)[0], before = dataset.keypoints({0, 6}, 1)[0];
  EXPECT_FLOAT_EQ(bridged.confidence, 0.5f * before.confidence);
}

TEST(EvidenceReference, ATableNamesLandmarks) {
  const CaptureFixture fixture;
  add_keypoints(fixture);
  std::string table = "frame,camera,name,x,y,confidence\n";
  const Motion motion = fixture.motion("testing");
  for (int c = 0; c < 3; ++c)
    for (int f = 0; f < motion.num_frames(); ++f)
      table += fmt::format("{},{},LWrist,{},{},0.75\n", f, c, 10 + f, 20 + c);
  support::write_bytes(fixture.root() / "k.csv", table);
  std::string yaml = yaml_of(fixture);
  yaml = replaced(yaml, "testing/keypoints/{camera:02}_{frame:04}.json", "k.csv");
  yaml = replaced(yaml, "    keypoints: training/keypoints/{camera:02}_{frame:04}.json\n", "");
  fixture.write_yaml(yaml);
  fixture.prepare();
  const Dataset dataset = Dataset::open(fixture.out());
  const std::vector<Keypoint> points = dataset.keypoints({1, 3}, 2);
  EXPECT_EQ(points[2].x, 13.0f);
  EXPECT_EQ(points[2].y, 22.0f);
  EXPECT_EQ(points[0].confidence, 0.0f);
  EXPECT_EQ(dataset.keypoints({0, 3}, 2)[2].confidence, 0.0f) << "this sequence has no keypoints";
}

TEST(EvidenceRejects, WhatCannotBe) {
  const CaptureFixture fixture;
  add_keypoints(fixture);
  const std::string yaml = yaml_of(fixture);
  const auto refusal = [&](const std::string& text) {
    fixture.write_yaml(text);
    PrepareOptions options = fixture.prepare_options();
    options.overwrite = true;
    return message_of<Error>([&] { prepare_capture(fixture.capture(), options); });
  };
  EXPECT_THAT(refusal(replaced(yaml, "sequences:", "keypoint_map: coco17\nsequences:")),
              AllOf(HasSubstr("25 points"), HasSubstr("coco17"), HasSubstr("_0000.json")));
  EXPECT_THAT(refusal(replaced(yaml, "sequences:", "keypoint_map: none.yaml\nsequences:")), HasSubstr("none.yaml"));
  EXPECT_THAT(refusal(replaced(yaml, "training/keypoints/{camera:02}", "training/keypoints/{camera:03}")),
              AllOf(HasSubstr("none of the keypoint files"), HasSubstr("training")));
  support::write_bytes(fixture.root() / "names.csv", "index,name,joint,x_mm,y_mm,z_mm\n0,Tail," +
                                                         fixture.character.skeleton.joints[5].name + ",0,0,0\n");
  EXPECT_THAT(refusal(replaced(yaml, "landmarks.csv", "names.csv")), AllOf(HasSubstr("Tail"), HasSubstr("LWrist")));
  EXPECT_THAT(refusal(replaced(replaced(yaml, "landmarks: landmarks.csv\n", ""),
                               "sequences:", "keypoint_map: body25\nsequences:")),
              HasSubstr("knows none of the skeleton's"));
  std::vector<float> parts(75, 0.5f);
  for (int f = 0; f < 12; ++f) support::write_bytes(keypoint_path(fixture, "training", 0, f), openpose_text({parts}));
  EXPECT_THAT(refusal(yaml), AllOf(HasSubstr("parts of the picture's size"), HasSubstr("camera 0")));
}

TEST(EvidenceRejects, CapturesPreparedWithoutKeypoints) {
  const CaptureFixture fixture;
  fixture.prepare();
  const Dataset dataset = Dataset::open(fixture.out());
  EXPECT_TRUE(dataset.landmarks().empty());
  const auto says_how = AllOf(HasSubstr("without keypoints"), HasSubstr("--overwrite"));
  EXPECT_THAT(message_of<UsageError>([&] { dataset.keypoints({0, 0}, 0); }), says_how);
  LoaderOptions options;
  options.keypoints = true;
  EXPECT_THAT(message_of<UsageError>([&] { Loader(dataset, options); }), says_how);
  // Asking for them later is another preparation.
  add_keypoints(fixture);
  EXPECT_THAT(message_of<Error>([&] { fixture.prepare(); }), AllOf(HasSubstr("other settings"), HasSubstr("landmark")));
}

TEST(EvidenceRejects, DamagedRecords) {
  const std::vector<Keypoint> points{{1, 2, 0.5f}, {3, 4, 0.25f}};
  const std::string bytes = encode_keypoints(points);
  const std::vector<Keypoint> read = decode_keypoints(bytes, 2, "x");
  EXPECT_EQ(read[1].x, 3.0f);
  EXPECT_EQ(read[1].confidence, 0.25f);
  EXPECT_THROW(decode_keypoints(bytes, 3, "x"), Error);
  EXPECT_THROW(decode_keypoints("", 2, "x"), Error);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::string bad = bytes;
    bad[i] = static_cast<char>(bad[i] ^ 4);
    EXPECT_THROW(decode_keypoints(bad, 2, "x"), Error) << i;
  }
  const std::string wild = encode_keypoints({{1, NAN, 0.5f}, {3, 4, 0.25f}});
  EXPECT_THAT(message_of<Error>([&] { decode_keypoints(wild, 2, "x"); }), HasSubstr("not finite"));
}

TEST(EvidenceReference, DoubtsAreSaidInWords) {
  KeypointFacts facts;
  facts.frames = 10;
  facts.seen = 0.9;
  EXPECT_TRUE(keypoint_doubts(facts).empty());
  facts.missing_files = facts.nobody = 3;
  EXPECT_THAT(keypoint_doubts(facts).at(0), HasSubstr("3 of 10 keypoint files are missing"));
  facts.unsure = 7;
  EXPECT_THAT(keypoint_doubts(facts).at(1), HasSubstr("confidence below 0.4"));
  facts = {};
  facts.frames = facts.nobody = 4;
  EXPECT_THAT(keypoint_doubts(facts).at(0), HasSubstr("nobody was found"));
}

TEST(EvidenceReference, TheSyntheticCaptureComesWithLandmarks) {
  const support::TemporaryFolder folder;
  synth::SynthOptions options = synth::SynthOptions::preset("tiny");
  options.frames = 4;
  options.test_frames = 2;
  options.cameras = 2;
  synth::write_synthetic_capture(folder / "synth", options);
  const Capture capture = read_capture(folder / "synth");
  EXPECT_EQ(capture.keypoint_map, "body25");
  PrepareOptions prepare;
  prepare.out = folder / "prepared";
  prepare_capture(capture, prepare);
  const Dataset dataset = Dataset::open(prepare.out);
  EXPECT_EQ(dataset.landmarks().size(), 21u);
  const Character character = load_character(dataset.character_path());
  double sum = 0.0;
  int count = 0;
  for (int camera = 0; camera < 2; ++camera) {
    const auto points = dataset.keypoints({0, 1}, camera);
    const auto positions =
        landmark_positions(character.skeleton, dataset.landmarks(), dataset.sequences()[0].motion.frames[1]);
    for (std::size_t m = 0; m < points.size(); ++m) {
      if (points[m].confidence == 0.0f) continue;
      sum += (Eigen::Vector2d(points[m].x, points[m].y) - dataset.camera(camera).project(positions[m])).norm();
      ++count;
    }
  }
  EXPECT_GT(count, 36);
  EXPECT_LT(sum / count, 3.0);
}

class RealEvidence : public support::SharedFolderTest {};

TEST_F(RealEvidence, ProjectedLandmarksLieOnTheKeypoints) {
  const support::TemporaryFolder folder;
  Capture capture = find_capture(capture_folder());
  EXPECT_EQ(capture.landmarks, "landmarks.csv");
  capture.cameras = {"1", "6"};
  PrepareOptions options;
  options.out = folder / "prepared";
  options.limit_frames = 10;
  const PrepareReport report = prepare_capture(capture, options);
  for (const CameraReport& camera : report.cameras) {
    ASSERT_TRUE(camera.keypoints.has_value());
    EXPECT_EQ(camera.keypoints->missing_files, 0);
    EXPECT_GT(camera.keypoints->seen, 0.5);
  }
  const Dataset dataset = Dataset::open(options.out);
  ASSERT_EQ(dataset.landmarks().size(), 25u);
  const Character character = load_character(dataset.character_path());
  std::vector<double> distances;
  for (const Split split : {Split::train, Split::test})
    for (const SampleId& sample : dataset.samples(split, 3)) {
      const auto& rows = dataset.sequences()[sample.sequence].motion.frames;
      const auto positions = landmark_positions(character.skeleton, dataset.landmarks(), rows[sample.frame]);
      for (int camera = 0; camera < 2; ++camera) {
        const auto points = dataset.keypoints(sample, camera);
        for (std::size_t m = 0; m < points.size(); ++m)
          if (points[m].confidence >= kSeenConfidence)
            distances.push_back(
                (Eigen::Vector2d(points[m].x, points[m].y) - dataset.camera(camera).project(positions[m])).norm());
      }
    }
  ASSERT_GT(distances.size(), 200u);
  std::nth_element(distances.begin(), distances.begin() + distances.size() / 2, distances.end());
  RecordProperty("median_distance_px", std::to_string(distances[distances.size() / 2]));
  EXPECT_LT(distances[distances.size() / 2], 3.0);
}

}  // namespace
}  // namespace doppel
