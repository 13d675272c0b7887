#include "doppel/data/capture/evidence.h"

#include <gmock/gmock.h>

#include <map>
#include <nlohmann/json.hpp>

#include "data/capture/detector_fixture.h"
#include "data/capture/keypoint_fixture.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/data/capture/find_capture.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/data/dataset/loader.h"
#include "doppel/data/prepare/store_layout.h"
#include "doppel/detect/keypoints/read_keypoints.h"
#include "doppel/geometry/undistorter.h"
#include "doppel/synth/synth.h"
#include "support/message_of.h"
#include "support/shared_folder.h"

namespace doppel::evidence_test {
namespace {

namespace fs = std::filesystem;
using namespace test_capture;
using support::message_of;
using support::replaced;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::string yaml_of(const CaptureFixture& fixture) { return read_file(fixture.root() / "capture.yaml"); }

/// Where the landmarks really are in an image.
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

// ---- a clip of one camera ----

/// The first YAML block below a heading of docs/capture.md.
std::string example_below(const std::string& heading) {
  const std::string text = read_file(fs::path(DOPPEL_SOURCE_DIR) / "docs/capture.md");
  const std::size_t begin = text.find("```yaml\n", text.find("\n" + heading + "\n")) + 8;
  return text.substr(begin, text.find("```", begin) - begin);
}

// The documentation's example, word by word, in a folder that holds what it names.
TEST(EvidenceOfOneCamera, IsDescribedAsTheDocumentationSays) {
  const CaptureFixture fixture;
  const fs::path folder = fixture.path("street");
  const Camera& camera = fixture.cameras[2];
  const Motion motion = fixture.motion("testing");
  TemplateChecker checker(fixture.character);
  std::vector<cv::Mat> clip(20, cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar(60, 180, 30))), images, masks;
  draw(checker, motion, camera, images, masks);
  clip.insert(clip.end(), images.begin(), images.end());
  write_video(folder / "street.avi", "MJPG", clip);  // finer than what OpenCV writes as .mp4
  fs::rename(folder / "street.avi", folder / "street.mp4");
  Character anna = fixture.character;
  anna.name = "anna";
  write_character(folder / "anna", anna);
  write_landmarks(folder / "anna/landmarks.csv", anna, some_landmarks(anna));
  write_calibration(folder / "street.yml", {camera});
  fs::create_directories(folder / "keypoints");
  for (int f = 0; f < motion.num_frames(); ++f)
    support::write_bytes(folder / ("keypoints/street_" + padded(20 + f, 12) + "_keypoints.json"),
                         openpose_text({body25_person(anna, camera, motion.frames[f])}));
  support::write_bytes(folder / "capture.yaml", example_below("## A clip of one camera"));
  PrepareOptions options = fixture.prepare_options();
  const PrepareReport report = prepare_capture(read_capture(folder), options);
  ASSERT_EQ(report.cameras.size(), 1u);
  EXPECT_EQ(report.cameras[0].frames, motion.num_frames());
  EXPECT_EQ(report.cameras[0].empty_frames, 0);
  const Dataset dataset = Dataset::open(options.out);
  for (int f = 0; f < motion.num_frames(); ++f) {
    const SampleId sample{0, 20 + f};
    expect_cut_out(dataset.mask(sample, 0), masks[f]);
    expect_at(dataset.keypoints(sample, 0)[2], true_pixel(fixture, dataset.camera(0), "testing", f, 2), 0.02);
  }
}

// ---- a detector of one's own ----

/// A capture without keypoint files, whose person's colours are the points of the tests' network.
void add_detector(const CaptureFixture& fixture, const std::string& extra = "") {
  support::write_bytes(fixture.root() / "net.onnx", test_detector::onnx_net());
  support::write_bytes(fixture.root() / "map.yaml",
                       "points: [blue, green, red]\nlandmarks: {Nose: blue, LWrist: red}\nabsent: [RWrist, MidHip, "
                       "RAnkle, LAnkle]\n");
  write_landmarks(fixture.root() / "landmarks.csv", fixture.character, some_landmarks(fixture.character));
  fixture.write_yaml(replaced(fixture.yaml(), "sequences:",
                              "landmarks: landmarks.csv\nkeypoint_map: map.yaml\ndetector: {model: net.onnx, "
                              "input_height: 128" +
                                  extra + "}\nsequences:"));
}

bool lies_on(const cv::Mat& mask, const Keypoint& point) {
  const cv::Rect around(static_cast<int>(point.x) - 2, static_cast<int>(point.y) - 2, 5, 5);
  return point.confidence > 0.0f && cv::countNonZero(mask(around & cv::Rect({}, mask.size()))) > 0;
}

TEST(EvidenceDetector, FindsTheSameKeypointsInShards) {
  const CaptureFixture fixture;
  add_detector(fixture);
  PrepareOptions options = fixture.prepare_options();
  prepare_capture(fixture.capture(), options);
  const auto tables = [&] {
    std::map<std::string, std::string> files;
    for (const auto& entry : std::filesystem::directory_iterator(options.out / "detected"))
      files[entry.path().filename().string()] = read_file(entry.path());
    files["store"] = read_file(options.out / "store/data.mdb");
    files["capture.yaml"] = read_file(options.out / "capture.yaml");
    return files;
  };
  const auto whole = tables();
  EXPECT_EQ(whole.size(), 8u) << "a table for each camera and sequence, the store and the description";
  for (int i = 0; i < 2; ++i) {
    PrepareOptions part = fixture.prepare_options();
    part.out = fixture.path("part" + std::to_string(i));
    part.shard = Shard{i, 2};
    EXPECT_TRUE(prepare_capture(fixture.capture(), part).finished);
    options.shards.push_back(part.out);
  }
  std::filesystem::remove_all(options.out);
  prepare_capture(fixture.capture(), options);
  EXPECT_TRUE(tables() == whole);
}

TEST(EvidenceDetector, FindsKeypointsWhilePreparing) {
  const CaptureFixture fixture;
  add_detector(fixture);
  const PrepareReport report = fixture.prepare();
  ASSERT_TRUE(report.cameras[0].keypoints.has_value());
  EXPECT_EQ(report.cameras[0].keypoints->nobody, 0);
  const Dataset dataset = Dataset::open(fixture.out());
  ASSERT_EQ(dataset.landmarks().size(), 6u);
  for (const SampleId& sample : {SampleId{0, 2}, SampleId{0, 9}, SampleId{1, 4}})
    for (int camera = 0; camera < 3; ++camera) {
      const std::vector<Keypoint> points = dataset.keypoints(sample, camera);
      EXPECT_TRUE(lies_on(dataset.mask(sample, camera), points[0])) << "blue";
      EXPECT_TRUE(lies_on(dataset.mask(sample, camera), points[2])) << "red";
      EXPECT_EQ(points[1].confidence, 0.0f) << "absent";
    }
}

TEST(EvidenceDetector, WhatItFoundIsKeptAsATable) {
  const CaptureFixture fixture;
  add_detector(fixture);
  fixture.prepare();
  const fs::path table = fixture.out() / "detected/training_1.csv";
  ASSERT_TRUE(fs::exists(table));
  const PointLayout layout{"points", {"blue", "green", "red"}};
  EXPECT_EQ(read_all_people(table, layout, {"1"}).size(), 12u);
  // The prepared description names the tables: prepared elsewhere it gives the same, without the network.
  fs::remove(fixture.root() / "net.onnx");
  PrepareOptions options = fixture.prepare_options();
  options.out = fixture.path("again");
  prepare_capture(read_capture(fixture.out()), options);
  const Dataset first = Dataset::open(fixture.out()), second = Dataset::open(options.out);
  for (const SampleId& sample : first.samples(Split::train)) {
    const auto a = first.keypoints(sample, 2), b = second.keypoints(sample, 2);
    for (std::size_t m = 0; m < a.size(); ++m)
      EXPECT_TRUE(a[m].x == b[m].x && a[m].y == b[m].y && a[m].confidence == b[m].confidence) << m;
  }
}

TEST(EvidenceDetector, GoesOnAfterAStopAndStartsAnewWithOtherSettings) {
  const CaptureFixture fixture;
  add_detector(fixture);
  fixture.prepare();
  const fs::path table = fixture.out() / "detected/testing_0.csv";
  const std::string found = read_file(table);
  // A table that is there is not made again; the others are.
  fs::remove(fixture.out() / "detected/testing_2.csv");
  const auto time = fs::last_write_time(table);
  fixture.prepare();
  EXPECT_EQ(fs::last_write_time(table), time);
  EXPECT_TRUE(fs::exists(fixture.out() / "detected/testing_2.csv"));
  add_detector(fixture, ", threshold: 0.5");
  EXPECT_THAT(message_of<Error>([&] { fixture.prepare(); }), AllOf(HasSubstr("other settings"), HasSubstr("0.5")));
  PrepareOptions options = fixture.prepare_options();
  options.overwrite = true;
  prepare_capture(fixture.capture(), options);
  EXPECT_NE(read_file(table), found) << "points below the new threshold are gone";
}

TEST(EvidenceDetector, RefusesWhatCannotBe) {
  const CaptureFixture fixture;
  add_detector(fixture);
  const std::string yaml = yaml_of(fixture);
  const auto refusal = [&](const std::string& from, const std::string& to) {
    fixture.write_yaml(replaced(yaml, from, to));
    PrepareOptions options = fixture.prepare_options();
    options.overwrite = true;
    return message_of<Error>([&] { prepare_capture(fixture.capture(), options); });
  };
  EXPECT_THAT(refusal("net.onnx", "none.onnx"), HasSubstr("none.onnx"));
  EXPECT_THAT(refusal("map.yaml", "names"), HasSubstr("must be a map"));
  EXPECT_THAT(refusal("map.yaml", "body25"), AllOf(HasSubstr("at least 25"), HasSubstr("net.onnx")));
}

TEST(EvidenceRejects, JointsInSpaceThatCannotBe) {
  const CaptureFixture fixture;
  add_keypoints(fixture);
  const std::string yaml = yaml_of(fixture);
  support::write_bytes(fixture.root() / "joints.csv", "frame,index,name,x_mm,y_mm,z_mm\n0,0,Nose,0,-700,1\n");
  const auto named = [&](const std::string& file) {
    fixture.write_yaml(replaced(yaml, "    cuts: [5]\n", "    cuts: [5]\n    joints3d: " + file + "\n"));
    PrepareOptions options = fixture.prepare_options();
    options.limit_frames = 2;
    options.overwrite = true;
    return support::expect_rejects_or_reads(file, [&] { prepare_capture(fixture.capture(), options); });
  };
  EXPECT_EQ(named("joints.csv"), "");
  EXPECT_EQ(read_capture(fixture.out()).sequences[0].joints3d, "joints.csv");
  support::write_bytes(fixture.root() / "joints.csv", "frame,index,name,x_mm,y_mm,z_mm\n0,0,Neck,0,-700,1\n");
  EXPECT_THAT(named("joints.csv"), HasSubstr("joints.csv:2"));
  EXPECT_THAT(named("none.csv"), HasSubstr("none.csv"));
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
  std::vector<float> parts(75, -0.5f);
  for (std::size_t i = 2; i < parts.size(); i += 3) parts[i] = 0.9f;
  for (int f = 0; f < 12; ++f) support::write_bytes(keypoint_path(fixture, "training", 0, f), openpose_text({parts}));
  EXPECT_THAT(refusal(yaml), AllOf(HasSubstr("parts of the image's size"), HasSubstr("_0000.json")));
}

TEST(EvidenceReference, PartsOfTheImagesSizeBecomePixels) {
  const CaptureFixture fixture;
  add_keypoints(fixture);
  const PrepareReport report = fixture.prepare();
  const Dataset pixels = Dataset::open(fixture.out());
  const Motion motion = fixture.motion("training");
  for (int f = 0; f < motion.num_frames(); ++f) {
    const Camera& camera = fixture.cameras[1];
    std::vector<float> parts = body25_person(fixture.character, camera, motion.frames[f]);
    for (std::size_t i = 0; i < parts.size(); i += 3) {
      parts[i] /= static_cast<float>(camera.width);
      parts[i + 1] /= static_cast<float>(camera.height);
    }
    support::write_bytes(keypoint_path(fixture, "training", 1, f), openpose_text({parts}));
  }
  PrepareOptions options = fixture.prepare_options();
  options.out = fixture.path("parts");
  prepare_capture(fixture.capture(), options);
  const Dataset fractions = Dataset::open(options.out);
  for (const SampleId& sample : pixels.samples(Split::train)) {
    const auto a = pixels.keypoints(sample, 1), b = fractions.keypoints(sample, 1);
    for (std::size_t m = 0; m < a.size(); ++m) {
      EXPECT_NEAR(a[m].x, b[m].x, 1e-3);
      EXPECT_NEAR(a[m].y, b[m].y, 1e-3);
    }
  }
}

TEST(EvidenceReference, TheLayoutIsFoundByTheFiles) {
  const CaptureFixture fixture;
  add_keypoints(fixture);
  const auto map_of = [&](std::size_t points) {
    std::vector<float> person(3 * points, 30.0f);
    for (int f = 0; f < fixture.motion("training").num_frames(); ++f)
      support::write_bytes(keypoint_path(fixture, "training", 0, f), openpose_text({person}));
    return plan_evidence(fixture.capture(), fixture.character).map_name;
  };
  EXPECT_EQ(map_of(18), "coco18");
  EXPECT_EQ(map_of(26), "halpe26");
  EXPECT_EQ(map_of(25), "body25") << "all points in one position do not decide it";
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
  EXPECT_TRUE(decode_keypoints(encode_keypoints({}), 0, "none").empty());
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
}  // namespace doppel::evidence_test
