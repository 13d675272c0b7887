#include "doppel/synth/synth.h"

#include <ATen/Parallel.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <set>
#include <thread>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/character/landmarks.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/core/process.h"
#include "doppel/data/capture/capture.h"
#include "doppel/detect/keypoints/joint_detections.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/geometry/topology.h"
#include "doppel/synth/body_field.h"
#include "doppel/synth/capture_writer.h"
#include "doppel/synth/performance.h"
#include "doppel/synth/repertoire.h"
#include "doppel/synth/simulated_detector.h"
#include "doppel/synth/studio.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::synth {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;

const Actor& tiny_actor() {
  static const Actor actor = make_actor(SynthOptions::preset("tiny").actor);
  return actor;
}

SynthOptions shortest() {
  SynthOptions o = SynthOptions::preset("tiny");
  o.cameras = 2;
  o.size = 96;
  o.frames = 6;
  o.test_frames = 3;
  return o;
}

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

TEST(SynthActor, IsOneClosedSurfaceStandingOnTheFloor) {
  const TriangleMesh& mesh = tiny_actor().character.mesh;
  const MeshReport report = inspect_mesh(mesh);
  EXPECT_TRUE(report.closed());
  EXPECT_EQ(report.components, 1);
  EXPECT_EQ(report.euler_characteristic, 2);
  EXPECT_EQ(report.degenerate_faces, 0);
  EXPECT_EQ(report.isolated_vertices, 0);
  EXPECT_NEAR(mesh.num_vertices(), 1500, 15);
  double lowest = 9, highest = -9, volume = 0;
  for (const Vector3d& v : mesh.vertices) lowest = std::min(lowest, v.y()), highest = std::max(highest, v.y());
  for (const Triangle& f : mesh.faces)
    volume += mesh.vertices[f[0]].dot(mesh.vertices[f[1]].cross(mesh.vertices[f[2]])) / 6;
  EXPECT_NEAR(lowest, 0, 0.01);
  EXPECT_NEAR(highest, 1.75, 0.03);
  EXPECT_GT(volume, 0.06) << "faces must be counter-clockwise from outside";
  EXPECT_LT(volume, 0.25);
}

TEST(SynthActor, HasAnAtlasWithoutOverlaps) {
  const TriangleMesh& mesh = tiny_actor().character.mesh;
  ASSERT_EQ(mesh.face_uvs.size(), mesh.faces.size());
  for (const Vector2d& uv : mesh.uvs) {
    EXPECT_GE(uv.minCoeff(), 0);
    EXPECT_LE(uv.maxCoeff(), 1);
  }
  // Every sample of the square lies in at most one triangle, and all triangles keep their orientation.
  const int size = 1500;
  std::vector<std::uint8_t> hits(as_size(size) * size, 0);
  double area = 0;
  for (const Triangle& f : mesh.face_uvs) {
    const Vector2d a = mesh.uvs[f[0]] * size, b = mesh.uvs[f[1]] * size, c = mesh.uvs[f[2]] * size;
    const double twice = cross(b - a, c - a);
    ASSERT_GT(twice, 0) << "a triangle is turned over or empty";
    area += 0.5 * twice / size / size;
    const Vector2d low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
    for (int y = static_cast<int>(low.y()); y <= static_cast<int>(high.y()); ++y)
      for (int x = static_cast<int>(low.x()); x <= static_cast<int>(high.x()); ++x) {
        const Vector2d p(x + 0.5003, y + 0.4997);
        if (cross(b - a, p - a) > 1e-7 && cross(c - b, p - b) > 1e-7 && cross(a - c, p - c) > 1e-7)
          ++hits[as_size(y) * size + x];
      }
  }
  EXPECT_EQ(std::count_if(hits.begin(), hits.end(), [](int n) { return n > 1; }), 0);
  EXPECT_GT(area, 0.15) << "the texture is mostly empty";
}

TEST(SynthActor, HasSkinWeightsThatKeepToTheirSide) {
  const Character& c = tiny_actor().character;
  const SkinningWeights& skin = c.skin;
  ASSERT_EQ(skin.num_vertices(), c.num_vertices());
  for (int v = 0; v < skin.num_vertices(); ++v) {
    const int count = skin.vertex_bones.size(v);
    EXPECT_GE(count, 1);
    EXPECT_LE(count, 6);
    double sum = 0, previous = 2;
    for (int k = skin.vertex_bones.offsets[v]; k < skin.vertex_bones.offsets[v + 1]; ++k) {
      EXPECT_LE(skin.weights[k], previous);
      EXPECT_GT(skin.weights[k], 0);
      previous = skin.weights[k];
      sum += skin.weights[k];
      const std::string& bone = skin.bones[skin.vertex_bones.items[k]];
      if (c.mesh.vertices[v].y() < 0.45) {
        EXPECT_FALSE(c.mesh.vertices[v].x() > 0.04 && bone.rfind("Right", 0) == 0) << bone << " pulls at the left leg";
        EXPECT_FALSE(c.mesh.vertices[v].x() < -0.04 && bone.rfind("Left", 0) == 0) << bone << " pulls at the right leg";
      }
    }
    EXPECT_NEAR(sum, 1, 1e-9);
  }
}

TEST(SynthActor, HasThirtyThreeDofsAndTwentyOneLandmarksOnTheBody) {
  const Character& c = tiny_actor().character;
  EXPECT_EQ(c.num_dofs(), 33);
  ASSERT_EQ(c.skeleton.markers.size(), 21u);
  const Skeleton::Root root = c.skeleton.root();
  EXPECT_EQ(root.axes, (std::array<int, 3>{1, 2, 0}));
  for (const int d : root.translation)
    EXPECT_EQ(c.skeleton.dofs[d].joints[0].weight, 1000) << "so that the DoF is metres";
  for (const double metres : root.translation_weight) EXPECT_NEAR(metres, 1, 1e-12);
  const auto world_from_joint = c.skeleton.pose(c.rest_dofs);
  const BodyField field;
  for (const Marker& m : c.skeleton.markers)
    EXPECT_LT(field.distance(world_from_joint[m.joint] * m.position), 0.02) << m.name << " floats off the body";
  for (const BoneRule rule : {BoneRule::exact, BoneRule::prefix})
    for (const std::string& bone : c.skin.bones) EXPECT_NO_THROW(c.skeleton.joint_of_bone(bone, rule)) << bone;
}

TEST(SynthActor, HasLabelsOfEveryKind) {
  const Character& c = tiny_actor().character;
  const std::set<int> labels(c.labels.begin(), c.labels.end());
  EXPECT_EQ(labels, (std::set<int>{2, 5, 9, 12, 13, 14, 15, 18, 19}));
}

TEST(SynthActor, IsReadBackAsItWasWritten) {
  const support::TemporaryFolder folder;
  const Character& written = tiny_actor().character;
  CharacterOptions options;
  options.num_nodes = 150;
  const Character read = load_character(write_character(folder.path(), written), options);
  ASSERT_EQ(read.num_vertices(), written.num_vertices());
  EXPECT_EQ(read.mesh.faces, written.mesh.faces);
  EXPECT_EQ(read.labels, written.labels);
  EXPECT_EQ(read.graph.node_vertex, written.graph.node_vertex);
  EXPECT_EQ(read.skin.bones, written.skin.bones);
  EXPECT_EQ(read.skin.vertex_bones.items, written.skin.vertex_bones.items);
  EXPECT_EQ(read.fingerprint(), written.fingerprint());
  double off = 0;
  for (int v = 0; v < read.num_vertices(); ++v)
    off = std::max(off, (read.mesh.vertices[v] - written.mesh.vertices[v]).norm());
  EXPECT_LT(off, 1e-6);
  const auto a = read.skeleton.pose(read.rest_dofs), b = written.skeleton.pose(written.rest_dofs);
  for (std::size_t m = 0; m < read.skeleton.markers.size(); ++m) {
    const Marker &x = read.skeleton.markers[m], &y = written.skeleton.markers[m];
    EXPECT_LT((a[x.joint] * x.position - b[y.joint] * y.position).norm(), 1e-5) << x.name << ": read in another way";
  }
}

TEST(SynthMotion, StaysOnTheFloorWithinLimitsAndSmooth) {
  const Skeleton skeleton = make_skeleton();
  const Motion motion = make_motion(skeleton, 250, 25, 7);
  ASSERT_EQ(motion.num_frames(), 250);
  double lowest = 9, fastest = 0;
  for (int f = 0; f < motion.num_frames(); ++f) {
    const auto joints = skeleton.pose(motion.frames[f]);
    for (const char* toe : {"LeftFootEE", "RightFootEE"})
      lowest = std::min(lowest, joints[*skeleton.find_joint(toe)].translation().y());
    for (int d = 0; d < skeleton.num_dofs(); ++d) {
      if (const auto& limits = skeleton.dofs[d].limits) {
        EXPECT_GE(motion.frames[f][d], (*limits)[0]);
        EXPECT_LE(motion.frames[f][d], (*limits)[1]);
      }
      if (f > 0) fastest = std::max(fastest, std::abs(motion.frames[f][d] - motion.frames[f - 1][d]));
    }
  }
  EXPECT_GT(lowest, -0.03);
  EXPECT_LT(fastest, 0.7) << "a DoF jumps between frames";
}

TEST(SynthMotion, DiffersBySeedOnly) {
  const Skeleton skeleton = make_skeleton();
  EXPECT_EQ(make_motion(skeleton, 20, 25, 3).frames, make_motion(skeleton, 20, 25, 3).frames);
  EXPECT_NE(make_motion(skeleton, 20, 25, 3).frames, make_motion(skeleton, 20, 25, 4).frames);
}

TEST(Motion, TurnsAtTheGivenSpeedAndOtherwiseStaysTheSame) {
  const Skeleton skeleton = make_skeleton();
  const Motion still = make_motion(skeleton, 40, 25, 3), turning = make_motion(skeleton, 40, 25, 3, 2.5);
  const int heading = *skeleton.find_dof("Root_ry");
  for (int frame = 0; frame < 40; ++frame) {
    std::vector<double> expected = still.frames[frame];
    expected[heading] += 2.5 * frame / 25.0;
    for (int dof = 0; dof < skeleton.num_dofs(); ++dof)
      EXPECT_NEAR(turning.frames[frame][dof], expected[dof], 1e-9) << skeleton.dofs[dof].name << " in frame " << frame;
  }
}

TEST(SynthClothing, DepartsFromTheSkinnedTemplateWithinBounds) {
  const Actor& actor = tiny_actor();
  const Take take = perform(actor, TakePlan{20, 5, {}}, SynthOptions());
  ASSERT_EQ(take.ground_truth.size(), 20u);
  const std::vector<Points> skinned = skin_motion(actor.character, take.motion, {});
  double mean = 0, largest = 0;
  int cloth = 0;
  for (std::size_t f = 0; f < take.ground_truth.size(); ++f)
    for (std::size_t v = 0; v < take.ground_truth[f].size(); ++v) {
      const double off = (take.ground_truth[f][v] - skinned[f][v]).norm();
      largest = std::max(largest, off);
      if (actor.looseness[v] > 0.5) mean += off, ++cloth;
      if (actor.looseness[v] < 1e-6) {
        EXPECT_LT(off, 0.012) << "bare skin moves by itself";
      }
    }
  EXPECT_GT(mean / cloth, 0.015);
  EXPECT_LT(mean / cloth, 0.10);
  EXPECT_LT(largest, 0.2);
}

TEST(SynthClothing, DependsOnTheHistoryNotOnThePoseAlone) {
  const Actor& actor = tiny_actor();
  const Skeleton& skeleton = actor.character.skeleton;
  const int turn = *skeleton.find_dof("Root_ry");
  // Three ways into one pose: standing still, and turning into it from either side.
  std::array<Points, 3> last;
  for (int way = 0; way < 3; ++way) {
    Motion motion;
    for (int f = 0; f <= 25; ++f) {
      std::vector<double> dofs = actor.character.rest_dofs;
      dofs[turn] = (way - 1) * 0.12 * (f - 25);
      motion.frames.push_back(dofs);
      motion.ids.push_back(f);
    }
    last[way] = move_clothes(actor, skin_motion(actor.character, motion, actor.hang), 25).back();
  }
  double left = 0, right = 0;
  for (int v = 0; v < actor.character.num_vertices(); ++v) {
    left = std::max(left, (last[0][v] - last[1][v]).norm());
    right = std::max(right, (last[0][v] - last[2][v]).norm());
  }
  EXPECT_GT(left, 0.02);
  EXPECT_GT(right, 0.04);
}

TEST(SynthClothing, HangsStillOnAStillBody) {
  const Actor& actor = tiny_actor();
  Motion motion;
  for (int f = 0; f < 10; ++f) {
    motion.frames.push_back(actor.character.rest_dofs);
    motion.ids.push_back(f);
  }
  const auto worn = skin_motion(actor.character, motion, actor.hang);
  const auto ground_truth = move_clothes(actor, worn, 25);
  for (int v = 0; v < actor.character.num_vertices(); ++v) {
    EXPECT_LT((ground_truth[9][v] - worn[9][v]).norm(), 1e-12);
    EXPECT_LT((worn[9][v] - actor.character.mesh.vertices[v] - actor.hang[v]).norm(), 1e-9);
  }
}

/// How many of the 3 x 3 samples of each pixel some triangle covers, with no cleverness at all.
cv::Mat brute_coverage(const Points& vertices, const std::vector<Triangle>& faces, const Camera& camera) {
  const int width = 3 * camera.width, height = 3 * camera.height;
  std::vector<bool> covered(as_size(width) * height, false);
  for (const Triangle& f : faces) {
    std::array<Vector2d, 3> p;
    for (int c = 0; c < 3; ++c) p[c] = 3 * camera.project(vertices[f[c]]);
    if (cross(p[1] - p[0], p[2] - p[0]) < 0) std::swap(p[1], p[2]);
    const Vector2d low = p[0].cwiseMin(p[1]).cwiseMin(p[2]), high = p[0].cwiseMax(p[1]).cwiseMax(p[2]);
    for (int y = static_cast<int>(low.y()) - 1; y <= static_cast<int>(high.y()) + 1; ++y)
      for (int x = static_cast<int>(low.x()) - 1; x <= static_cast<int>(high.x()) + 1; ++x) {
        const Vector2d s(x + 0.5, y + 0.5);
        bool inside = true;
        for (int c = 0; c < 3; ++c) inside = inside && cross(p[(c + 1) % 3] - p[c], s - p[c]) >= 0;
        if (inside) covered[as_size(y) * width + x] = true;
      }
  }
  cv::Mat count(camera.height, camera.width, CV_32S, cv::Scalar(0));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) count.at<int>(y / 3, x / 3) += covered[as_size(y) * width + x];
  return count;
}

TEST(SynthStudio, MasksAreTheCoverageOfTheGroundTruth) {
  const Actor& actor = tiny_actor();
  const Take take = perform(actor, TakePlan{2, 11, {}}, SynthOptions());
  const auto cameras = make_cameras(3, 128, 1);
  Studio studio(actor, cameras);
  studio.set_surface(take.ground_truth[1]);
  for (int c = 0; c < 3; ++c) {
    const cv::Mat mask = studio.shoot(c, 0).mask;
    const cv::Mat count = brute_coverage(take.ground_truth[1], actor.character.mesh.faces, cameras[c]);
    int wrong = 0, unsure = 0, person = 0;
    for (int y = 0; y < mask.rows; ++y)
      for (int x = 0; x < mask.cols; ++x) {
        const int n = count.at<int>(y, x);
        const bool is = mask.at<uchar>(y, x) == 255;
        ASSERT_TRUE(is || mask.at<uchar>(y, x) == 0);
        person += is;
        // One sample may fall on either side of an edge that the rasterizer rounds to 1/256 pixel.
        if (n == 4 || n == 5)
          unsure += is != (n > 4);
        else
          wrong += is != (n > 4);
      }
    EXPECT_EQ(wrong, 0) << "camera " << c;
    EXPECT_LE(unsure, 6) << "camera " << c;
    EXPECT_GT(person, 400);
  }
}

TEST(SynthStudio, FisheyeMasksAreTheCoverageOfTheGroundTruth) {
  const Actor& actor = tiny_actor();
  const Take take = perform(actor, TakePlan{1, 11, {}}, SynthOptions());
  const auto cameras = make_cameras(2, 160, 1, Lens::fisheye);
  Studio studio(actor, cameras);
  studio.set_surface(take.ground_truth[0]);
  for (int c = 0; c < 2; ++c) {
    ASSERT_EQ(cameras[c].lens, Lens::fisheye);
    const cv::Mat mask = studio.shoot(c, 0).mask;
    const cv::Mat ground_truth = brute_coverage(take.ground_truth[0], actor.character.mesh.faces, cameras[c]) > 4;
    const int both = cv::countNonZero(mask & ground_truth), either = cv::countNonZero(mask | ground_truth);
    EXPECT_GT(both, 600) << "camera " << c;
    // A sample is looked up with an error of up to half a sample, a sixth of a pixel.
    EXPECT_GT(both, 0.98 * either) << "camera " << c;
  }
}

TEST(SynthStudio, KeepsTheActorOffTheBorder) {
  const Actor& actor = tiny_actor();
  const Take take = perform(actor, TakePlan{120, 2, {}}, SynthOptions());
  for (const Lens lens : {Lens::opencv, Lens::fisheye})
    for (const Camera& camera : make_cameras(8, 256, 3, lens)) {
      EXPECT_TRUE(camera.faults().empty());
      for (const Points& frame : take.ground_truth)
        for (const Vector3d& v : frame) {
          const Vector2d p = camera.project(v);
          ASSERT_GT(p.minCoeff(), 2);
          ASSERT_LT(p.maxCoeff(), 254);
        }
    }
}

TEST(SynthStudio, DrawsTheSameImageWithAnyNumberOfThreads) {
#ifdef __SANITIZE_THREAD__
  GTEST_SKIP() << "the sanitizer cannot see the barriers of libgomp (tests/sanitizers/thread.supp)";
#endif
  const Actor& actor = tiny_actor();
  const auto cameras = make_cameras(1, 96, 1);
  const int threads = at::get_num_threads();
  cv::Mat first;
  for (const int n : {1, 2, 3}) {
    at::set_num_threads(n);
    Studio studio(actor, cameras);
    studio.set_surface(actor.character.mesh.vertices);
    const cv::Mat image = studio.shoot(0, 5).image;
    if (n == 1) first = image.clone();
    EXPECT_EQ(cv::norm(first, image, cv::NORM_INF), 0);
  }
  at::set_num_threads(threads);
}

std::vector<cv::Mat> video_frames(const fs::path& path) {
  cv::VideoCapture video(path.string());
  std::vector<cv::Mat> frames;
  for (cv::Mat frame; video.read(frame);) frames.push_back(frame.clone());
  return frames;
}

std::string text_of(const fs::path& path) { return read_file(path); }

/// Compares all files of two captures of the same options.
void expect_same_capture(const fs::path& root, const fs::path& other) {
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    if (!entry.is_regular_file()) continue;
    const fs::path relative = fs::relative(entry.path(), root);
    ++files;
    if (relative.extension() == ".mkv" || relative.extension() == ".mp4") {
      const auto a = video_frames(entry.path()), b = video_frames(other / relative);
      ASSERT_EQ(a.size(), b.size()) << relative;
      // Masks are lossless and must be equal. The H.264 encoder turns equal images into slightly different ones from
      // one run to the next; that the images it is given are equal is tested above.
      const double allowed = relative.extension() == ".mkv" ? 0 : 4;
      for (std::size_t f = 0; f < a.size(); ++f)
        EXPECT_LE(cv::norm(a[f], b[f], cv::NORM_L1) / static_cast<double>(3 * a[f].total()), allowed) << relative;
    } else {
      EXPECT_EQ(text_of(entry.path()), text_of(other / relative)) << relative;
    }
  }
  EXPECT_GT(files, 30);
}

class SynthCapture : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new support::TemporaryFolder;
    report_ = write_synthetic_capture(folder_->path() / "a", shortest()).value();
  }
  static void TearDownTestSuite() { delete folder_; }
  static fs::path root() { return folder_->path() / "a"; }

  static support::TemporaryFolder* folder_;
  static SynthReport report_;
};
support::TemporaryFolder* SynthCapture::folder_ = nullptr;
SynthReport SynthCapture::report_;

TEST_F(SynthCapture, IsAnOrdinaryCaptureFolder) {
  const Capture capture = read_capture(root() / "capture.yaml");
  ASSERT_EQ(capture.sequences.size(), 2u);
  EXPECT_EQ(capture.sequences[0].split, Split::train);
  EXPECT_EQ(capture.sequences[0].cuts, (std::vector<long>{3}));
  EXPECT_EQ(capture.sequences[1].split, Split::test);
  const auto cameras = read_calibration(root() / "calibration/cameras.calibration");
  const auto same = read_calibration(root() / "calibration/cameras.yml");
  ASSERT_EQ(cameras.size(), 2u);
  ASSERT_EQ(same.size(), 2u);
  for (int c = 0; c < 2; ++c) EXPECT_LT((cameras[c].projection() - same[c].projection()).cwiseAbs().maxCoeff(), 1e-6);
  for (const auto& [name, frames] : std::map<std::string, int>{{"training", 6}, {"testing", 3}}) {
    for (const std::string camera : {"000", "001"}) {
      const auto masks = video_frames(root() / name / "foregroundSegmentation" / ("stream" + camera + ".mkv"));
      ASSERT_EQ(static_cast<int>(masks.size()), frames);
      EXPECT_EQ(masks[0].size(), cv::Size(96, 96));
      EXPECT_EQ(static_cast<int>(video_frames(root() / name / "videos" / ("stream" + camera + ".mp4")).size()), frames);
      for (int f = 0; f < frames; ++f) {
        const auto file = nlohmann::json::parse(
            text_of(root() / name / "keypoints" / camera / fmt::format("stream{}_{:012}_keypoints.json", camera, f)));
        EXPECT_EQ(file["people"][0]["pose_keypoints_2d"].size(), 75u);
      }
    }
    const Motion motion = read_motion(root() / name / "skeletoolToGTPose/poseAngles.motion", 33);
    EXPECT_EQ(motion.num_frames(), frames);
    const NpyArray ground_truth = read_npy(root() / "ground_truth" / name / "vertices.npy");
    EXPECT_EQ(ground_truth.type, "<f4");
    EXPECT_EQ(ground_truth.shape, (std::vector<std::int64_t>{frames, report_.vertices, 3}));
  }
  EXPECT_GT(report_.skinning_iou, 0.75);
  EXPECT_LT(report_.skinning_iou, 0.985);
}

TEST_F(SynthCapture, JointsInSpaceAreNearTheLandmarks) {
  const Character character = load_character(root() / "character/actor.character");
  const Motion motion = read_motion(root() / "testing/skeletoolToGTPose/poseAngles.motion", character.num_dofs());
  const Camera camera = read_calibration(root() / "calibration/cameras.calibration")[1];
  const auto found = read_joint_detections(root() / "testing/joints3d/001.csv", read_keypoint_map("body25").layout);
  ASSERT_EQ(found.size(), 3u);
  const std::vector<int> markers = body25_markers(character.skeleton);
  double sum = 0.0;
  int count = 0;
  for (const auto& [frame, joints] : found) {
    const auto points = landmark_positions(character.skeleton, character.skeleton.markers, motion.frames[frame]);
    const auto point = [&](std::size_t k) { return points[markers[k]]; };
    EXPECT_EQ(joints[8].position, Eigen::Vector3d(0, 0, 0)) << "the root";
    for (std::size_t k = 0; k < markers.size(); ++k) {
      EXPECT_EQ(joints[k].seen, markers[k] >= 0);
      if (markers[k] < 0) continue;
      sum += (joints[k].position - camera.R * (point(k) - point(8))).norm();
      ++count;
    }
  }
  EXPECT_GT(sum / count, 0.02);
  EXPECT_LT(sum / count, 0.07);
}

TEST_F(SynthCapture, MasksShowTheGroundTruth) {
  const NpyArray array = read_npy(root() / "ground_truth/testing/vertices.npy");
  const std::vector<double> values = array.as<double>();
  Points last;
  for (std::size_t v = 0; v < as_size(report_.vertices); ++v) {
    const double* p = &values[(2 * as_size(report_.vertices) + v) * 3];
    last.emplace_back(p[0], p[1], p[2]);
  }
  const Character character = load_character(root() / "character/actor.character");
  const auto cameras = read_calibration(root() / "calibration/cameras.calibration");
  for (int c = 0; c < 2; ++c) {
    cv::Mat mask;
    cv::extractChannel(video_frames(root() / fmt::format("testing/foregroundSegmentation/stream{:03}.mkv", c)).at(2),
                       mask, 0);
    const cv::Mat covered = brute_coverage(last, character.mesh.faces, cameras[c]) > 4;
    const double both = cv::countNonZero(mask & covered), any = cv::countNonZero(mask | covered);
    EXPECT_GT(both / any, 0.995);
  }
}

TEST_F(SynthCapture, IsTheSameForTheSameSeedWithOtherThreads) {
  SynthOptions options = shortest();
  options.threads = 3;
  const fs::path other = folder_->path() / "b" / "a";
  ASSERT_TRUE(write_synthetic_capture(other, options));
  expect_same_capture(root(), other);
}

TEST_F(SynthCapture, GoesOnWhereItWasStopped) {
  const fs::path other = folder_->path() / "d" / "a", making = folder_->path() / "d" / ".a.making";
  const fs::path first = making / "training/joints3d/000.csv";
  std::atomic<bool> done{false};
  std::thread stopper([&] {
    while (!done && !fs::exists(first)) std::this_thread::yield();
    request_stop();
  });
  const bool complete = write_synthetic_capture(other, shortest()).has_value();
  done = true;
  stopper.join();
  request_stop(false);
  ASSERT_FALSE(complete);
  EXPECT_FALSE(fs::exists(other));
  EXPECT_FALSE(fs::exists(making / "testing/joints3d/001.csv")) << "stopped too late to test anything";
  const auto written = fs::last_write_time(first);
  SynthOptions others = shortest();
  others.seed = 2;
  EXPECT_THROW(write_synthetic_capture(other, others), UsageError) << "an unfinished capture of other options";
  ASSERT_TRUE(write_synthetic_capture(other, shortest()));
  EXPECT_FALSE(fs::exists(making));
  EXPECT_EQ(fs::last_write_time(other / "training/joints3d/000.csv"), written) << "filmed again";
  expect_same_capture(root(), other);
}

TEST_F(SynthCapture, ForceRemovesAnUnfinishedCaptureOfOtherOptions) {
  const fs::path other = folder_->path() / "e" / "a", making = folder_->path() / "e" / ".a.making";
  fs::create_directories(making / "training/joints3d");
  std::ofstream(making / "work.txt") << "other work\n";
  std::ofstream(making / "training/joints3d/000.csv") << "of another capture\n";
  SynthOptions forced = shortest();
  EXPECT_THROW(write_synthetic_capture(other, forced), UsageError);
  forced.force = true;
  ASSERT_TRUE(write_synthetic_capture(other, forced));
  expect_same_capture(root(), other);
}

TEST_F(SynthCapture, HasTakesOfMotionFiles) {
  const Character& character = tiny_actor().character;
  Motion clip = make_motion(character.skeleton, 5, 25, 77);
  const int lift = *character.skeleton.find_dof("Root_ty"), along = *character.skeleton.find_dof("Root_tx");
  for (std::vector<double>& dofs : clip.frames) dofs[lift] += 3.0, dofs[along] += 20.0;
  write_motion(folder_->path() / "clip.motion", clip, true);
  SynthOptions options = shortest();
  options.frames = 0;
  options.clips = {folder_->path() / "clip.motion"};
  options.test_clips = options.clips;
  const SynthReport report = write_synthetic_capture(folder_->path() / "f", options).value();
  EXPECT_EQ(report.frames, 5);
  EXPECT_EQ(report.takes, 1);
  EXPECT_EQ(report.test_frames, 3 + 5);
  const Capture capture = read_capture(folder_->path() / "f/capture.yaml");
  EXPECT_TRUE(capture.sequences[0].cuts.empty());
  EXPECT_EQ(capture.sequences[1].cuts, (std::vector<long>{3}));
  const Motion motion = read_motion(folder_->path() / "f/training/skeletoolToGTPose/poseAngles.motion", 33);
  double lowest = 9;
  for (int f = 0; f < 5; ++f) {
    lowest = std::min(lowest, sole_height(character.skeleton, motion.frames[f]));
    EXPECT_LT(std::abs(motion.frames[f][along]), 0.6) << "outside of the studio";
    for (int dof = 0; dof < 33; ++dof)
      if (!character.skeleton.dofs[dof].name.starts_with("Root_t")) {
        EXPECT_NEAR(motion.frames[f][dof], clip.frames[f][dof], 1e-9) << character.skeleton.dofs[dof].name;
      }
  }
  EXPECT_NEAR(lowest, 0, 1e-6);
}

TEST(SynthPlan, CutsLongSequencesIntoTakes) {
  const std::vector<SequencePlan> plans = plan_sequences(SynthOptions::preset("studio"), tiny_actor().character);
  ASSERT_EQ(plans.size(), 2u);
  EXPECT_EQ(plans[0].takes.size(), 12u);
  EXPECT_EQ(plans[0].cuts().front(), 250);
  EXPECT_EQ(plans[0].cuts().back(), 2750);
  EXPECT_EQ(plans[1].frames(), 500);
  std::set<std::uint64_t> seeds;
  for (const SequencePlan& plan : plans)
    for (const TakePlan& take : plan.takes) seeds.insert(take.seed);
  EXPECT_EQ(seeds.size(), 14u) << "two takes are the same";
}

TEST(SynthRepertoire, StaysInTheStudioWithinLimitsAndSmooth) {
  const Skeleton skeleton = make_skeleton();
  const SynthOptions options = SynthOptions::preset("studio");
  const std::vector<Camera> cameras = make_cameras(12, 512, 1, Lens::opencv, options.room);
  std::set<int> headings;
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Motion motion = make_varied_motion(skeleton, 750, 25, seed, options.room);
    ASSERT_EQ(motion.num_frames(), 750);
    for (int f = 0; f < motion.num_frames(); ++f) {
      EXPECT_GT(sole_height(skeleton, motion.frames[f]), -1e-9);
      for (const auto& joint : skeleton.pose(motion.frames[f]))
        for (const Camera& camera : cameras) {
          const Vector2d pixel = camera.project(joint.translation());
          // Twelve pixels for what is around a joint: a hand, the hem of the skirt.
          ASSERT_GT(pixel.minCoeff(), 12) << "frame " << f << " of seed " << seed;
          ASSERT_LT(pixel.maxCoeff(), 500) << "frame " << f << " of seed " << seed;
        }
      const double heading = motion.frames[f][*skeleton.find_dof("Root_ry")];
      headings.insert(static_cast<int>(std::floor(std::remainder(heading, 2 * M_PI) / (M_PI / 4))));
      for (int d = 0; d < skeleton.num_dofs(); ++d) {
        if (const auto& limits = skeleton.dofs[d].limits) {
          EXPECT_GE(motion.frames[f][d], (*limits)[0]);
          EXPECT_LE(motion.frames[f][d], (*limits)[1]);
        }
        if (f == 0) continue;
        EXPECT_LT(std::abs(motion.frames[f][d] - motion.frames[f - 1][d]), 0.5) << skeleton.dofs[d].name;
      }
    }
  }
  EXPECT_EQ(headings.size(), 8u) << "the person faces all ways";
}

/// The distance that the foot which moves less moves along the floor from one frame to the next, metres.
double slide_of(const Skeleton& skeleton, const Motion& motion, int frame) {
  const auto before = skeleton.pose(motion.frames[frame - 1]), now = skeleton.pose(motion.frames[frame]);
  double shorter = 9;
  for (const std::string side : {"Left", "Right"}) {
    const int ankle = *skeleton.find_joint(side + "Foot_rz"), toe = *skeleton.find_joint(side + "FootEE");
    const Vector3d moved = 0.5 * (now[ankle].translation() - before[ankle].translation() + now[toe].translation() -
                                  before[toe].translation());
    shorter = std::min(shorter, std::hypot(moved.x(), moved.z()));
  }
  return shorter;
}

TEST(SynthRepertoire, AFootStandsWhileThePersonTravels) {
  const Skeleton skeleton = make_skeleton();
  const Motion motion = make_varied_motion(skeleton, 750, 25, 4, 0.5);
  std::vector<double> slides;
  double way = 0;
  const auto root = [&](int f, const char* dof) { return motion.frames[f][*skeleton.find_dof(dof)]; };
  for (int f = 1; f < motion.num_frames(); ++f) {
    slides.push_back(slide_of(skeleton, motion, f));
    way += std::hypot(root(f, "Root_tx") - root(f - 1, "Root_tx"), root(f, "Root_tz") - root(f - 1, "Root_tz"));
  }
  std::sort(slides.begin(), slides.end());
  EXPECT_GT(way, 5.0) << "metres in half a minute";
  // The rest are jumps, turns on both feet, and steps in which the weight passes from one foot to the other.
  EXPECT_LT(slides[slides.size() / 2], 0.003) << "metres a frame";
  EXPECT_LT(slides[slides.size() * 3 / 4], 0.008) << "metres a frame";
}

TEST_F(SynthCapture, TakesAnotherCourseForAnotherSeed) {
  SynthOptions o = shortest();
  o.seed = 2;
  const fs::path other = folder_->path() / "c";
  write_synthetic_capture(other, o);
  for (const char* file : {"training/skeletoolToGTPose/poseAngles.motion", "ground_truth/testing/vertices.npy",
                           "calibration/cameras.calibration"})
    EXPECT_NE(text_of(root() / file), text_of(other / file)) << file;
  EXPECT_EQ(text_of(root() / "character/actor.obj"), text_of(other / "character/actor.obj")) << "the actor has no seed";
}

TEST_F(SynthCapture, NeverReplacesWhatItDidNotMake) {
  EXPECT_THROW(write_synthetic_capture(root(), shortest()), UsageError) << "not without force";
  SynthOptions forced = shortest();
  forced.force = true;
  const fs::path foreign = folder_->path() / "foreign";
  fs::create_directories(foreign);
  std::ofstream(foreign / "thesis.txt") << "irreplaceable\n";
  EXPECT_THROW(write_synthetic_capture(foreign, forced), UsageError);
  EXPECT_EQ(text_of(foreign / "thesis.txt"), "irreplaceable\n");

  // Users put ground truth into captures that they filmed (docs/evaluation.md).
  const fs::path filmed = folder_->path() / "filmed";
  fs::create_directories(filmed / "ground_truth" / "dance");
  fs::copy(root() / "capture.yaml", filmed / "capture.yaml");
  std::ofstream(filmed / "README.txt") << "Filmed in May. Like a synthetic capture, made by `doppel synth`, but real\n";
  EXPECT_THROW(write_synthetic_capture(filmed, forced), UsageError);
  EXPECT_TRUE(fs::exists(filmed / "ground_truth" / "dance"));
}

TEST_F(SynthCapture, ForceNamesWhatOthersPutIntoIt) {
  SynthOptions forced = shortest();
  forced.force = true;
  const fs::path copy = folder_->path() / "own files";
  fs::copy(root(), copy, fs::copy_options::recursive);
  fs::create_directories(copy / "tracked");
  std::ofstream(copy / "training" / "notes.txt") << "irreplaceable\n";
  const std::string message = support::message_of<UsageError>([&] { write_synthetic_capture(copy, forced); });
  EXPECT_NE(message.find((copy / "tracked").string()), std::string::npos) << message;
  EXPECT_NE(message.find((copy / "training" / "notes.txt").string()), std::string::npos) << message;
  EXPECT_EQ(message.find("README.txt"), std::string::npos) << message;
  EXPECT_TRUE(fs::exists(copy / "training" / "notes.txt"));
}

TEST_F(SynthCapture, ALinkStaysAndItsFolderIsReplaced) {
  SynthOptions forced = shortest();
  forced.force = true;
  forced.seed = 2;
  const fs::path real = folder_->path() / "real", link = folder_->path() / "link";
  fs::copy(root(), real, fs::copy_options::recursive);
  fs::create_directory_symlink(real, link);
  ASSERT_TRUE(write_synthetic_capture(link, forced));
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_NE(text_of(real / "README.txt").find("Seed 2."), std::string::npos);
  fs::create_directory_symlink(folder_->path() / "nowhere", folder_->path() / "dangling");
  EXPECT_THROW(write_synthetic_capture(folder_->path() / "dangling", forced), UsageError);
}

TEST_F(SynthCapture, NeverTakesThePlaceOfTheCurrentFolder) {
  const fs::path before = fs::current_path(), inside = folder_->path() / "current" / "inside";
  fs::create_directories(inside);
  fs::current_path(inside);
  EXPECT_THROW(write_synthetic_capture(".", shortest()), UsageError);
  EXPECT_THROW(write_synthetic_capture(inside, shortest()), UsageError);
  EXPECT_TRUE(fs::exists(inside));
  EXPECT_FALSE(fs::exists(inside.parent_path() / ".inside.making"));
  fs::current_path(before);
}

TEST(SynthRejects, OptionsOutOfRange) {
  const support::TemporaryFolder folder;
  const auto refuses = [&](void (*spoil)(SynthOptions&)) {
    SynthOptions o = shortest();
    spoil(o);
    EXPECT_THROW(write_synthetic_capture(folder.path() / "x", o), UsageError);
    EXPECT_FALSE(fs::exists(folder.path() / "x"));
  };
  refuses([](SynthOptions& o) { o.cameras = 0; });
  refuses([](SynthOptions& o) { o.size = 97; });
  refuses([](SynthOptions& o) { o.size = 8; });
  refuses([](SynthOptions& o) { o.frames = 0; });
  refuses([](SynthOptions& o) { o.test_frames = -1; });
  refuses([](SynthOptions& o) {
    o.turn = 90;
    o.clips = o.test_clips = {"walk.bvh"};
    o.frames = o.test_frames = 0;
  });
  EXPECT_THROW(SynthOptions::preset("huge"), UsageError);
  EXPECT_THROW(synth_lens("mirror"), UsageError);
  EXPECT_THROW(make_cameras(1, 96, 1, Lens::polynomial), UsageError);
}

TEST(SynthRejects, LeavesNothingBehindWhenNothingIsComplete) {
  const support::TemporaryFolder folder;
  request_stop();
  EXPECT_FALSE(write_synthetic_capture(folder.path() / "x", shortest()));
  request_stop(false);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

}  // namespace
}  // namespace doppel::synth
