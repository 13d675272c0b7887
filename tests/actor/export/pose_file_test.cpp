#include "doppel/actor/export/pose_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <opencv2/imgcodecs.hpp>

#include "actor/export/untrained_pose.h"
#include "doppel/actor/export/actor_file.h"
#include "doppel/actor/export/script_file.h"
#include "doppel/character/motion.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/data/dataset/person_crop.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::pose_file_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::HasSubstr;
using torch::Tensor;

constexpr int kInput = support::kPoseInput;

/// The camera of each sample. Pixels are those of the whole image without lens distortion, as for the keypoints; the
/// centre of the first pixel is (0.5, 0.5).
struct CameraTensors {
  torch::Tensor intrinsics;   ///< [B,3,3]
  torch::Tensor rotation;     ///< [B,3,3] camera from world
  torch::Tensor translation;  ///< [B,3] camera from world, metres
};

/// The output of a pose file for each sample.
struct CapturedPerson {
  torch::Tensor dofs;       ///< [B,D] in the units of a motion file
  torch::Tensor landmarks;  ///< [B,M,3] world metres
  torch::Tensor vertices;   ///< [B,N,3] world metres
  torch::Tensor valid;      ///< bool [B]: the keypoints determine the position; undefined without keypoints
};

/// A pose file, called as hosts call it.
class PoseFile {
 public:
  explicit PoseFile(const std::filesystem::path& path) : file_(load_script_file(path, ScriptKind::pose)) {}
  const nlohmann::json& metadata() const { return file_.metadata; }
  CapturedPerson forward(const Tensor& image, const Tensor& rotation) {
    const torch::NoGradGuard no_grad;
    const auto found = file_.fastest().forward({image, rotation}).toTuple();
    const auto& e = found->elements();
    return {e[0].toTensor(), e[1].toTensor(), e[2].toTensor(), Tensor()};
  }
  CapturedPerson placed(const Tensor& image, const CameraTensors& camera, const Tensor& keypoints) {
    const torch::NoGradGuard no_grad;
    const auto placed = file_.fastest().get_method("placed");
    const auto found = placed({image, camera.intrinsics, camera.rotation, camera.translation, keypoints}).toTuple();
    const auto& e = found->elements();
    return {e[0].toTensor(), e[1].toTensor(), e[2].toTensor(), e[3].toTensor()};
  }

 private:
  ScriptFile file_;
};

/// What a camera three metres away, which is turned a little, sees of points about the origin.
struct Seen {
  CameraTensors camera;
  Tensor keypoints;

  Seen(std::int64_t batch, std::int64_t num_landmarks) {
    const at::Generator draw = at::detail::createCPUGenerator(8);
    camera.intrinsics = torch::tensor({140.f, 0.f, 70.f, 0.f, 140.f, 70.f, 0.f, 0.f, 1.f}).view({1, 3, 3});
    camera.intrinsics = camera.intrinsics.repeat({batch, 1, 1});
    camera.rotation = root_in_camera(torch::tensor({0.f, 3.1f, 0.f}) + 0.2 * torch::randn({batch, 3}, draw));
    camera.translation = torch::tensor({0.1f, 0.2f, 3.f}) + 0.1 * torch::randn({batch, 3}, draw);
    keypoints = torch::cat({70 + 40 * torch::randn({batch, num_landmarks, 2}, draw),
                            0.5 + 0.5 * torch::rand({batch, num_landmarks, 1}, draw)},
                           -1);
  }
};

/// The library's own way from an image to a person.
CapturedPerson captured_by(TrainedPose& trained, const Tensor& rgb, const Seen& seen) {
  const torch::NoGradGuard no_grad;
  const auto colours = [](const float(&c)[3]) { return torch::tensor({c[0], c[1], c[2]}).view({3, 1, 1}); };
  const Tensor image = (rgb - colours(kInputMean)) / colours(kInputDeviation);
  const Tensor translation = seen.camera.translation.unsqueeze(-1);
  const Tensor projection = torch::matmul(seen.camera.intrinsics, torch::cat({seen.camera.rotation, translation}, -1));
  const Tensor centre = -torch::matmul(seen.camera.rotation.transpose(1, 2), translation).squeeze(-1);
  const CapturedPose captured = trained.capture(
      {image, seen.camera.rotation,
       keypoint_rays(seen.keypoints.unsqueeze(1), projection.unsqueeze(1), centre.unsqueeze(1)), Tensor()});
  const Tensor dofs = trained.dofs(captured);
  if (!trained.defnet) return {dofs, captured.landmarks, trained.surface->skinned(dofs), captured.valid};
  const auto [A, T] = trained.deformation(image);
  return {dofs, captured.landmarks, trained.surface->deformed(dofs, A, T), captured.valid};
}

double difference(const Tensor& a, const Tensor& b) {
  return a.sizes().equals(b.sizes()) ? (a - b).abs().max().item<double>() : 1e9;
}

Tensor random_images(std::int64_t batch, int side = kInput) {
  return torch::rand({batch, 3, side, side}, at::detail::createCPUGenerator(3));
}

TEST(PoseFileAgrees, WithTheLibraryOnUnseenImagesAndBatches) {
  for (const bool with_defnet : {true, false}) {
    const TemporaryFolder folder;
    TrainedPose trained = support::untrained_pose(with_defnet);
    write_pose_file(folder / "pose.pt", trained);
    PoseFile file(folder / "pose.pt");
    EXPECT_EQ(file.metadata().at("deformed"), with_defnet);
    EXPECT_EQ(file.metadata().at("fingerprint"), trained.character.fingerprint());
    const auto landmarks = static_cast<std::int64_t>(trained.landmarks.size());
    EXPECT_EQ(file.metadata().at("landmark_names").size(), trained.landmarks.size());
    EXPECT_EQ(file.metadata().at("input_size"), kInput);
    EXPECT_EQ(file.metadata().at("num_vertices"), trained.character.num_vertices());
    EXPECT_EQ(file.metadata().at("dof_names").size(), static_cast<std::size_t>(trained.character.num_dofs()));
    for (const int batch : {1, 2, 5}) {
      const Tensor image = random_images(batch);
      const Seen seen(batch, landmarks);
      const CapturedPerson found = file.placed(image, seen.camera, seen.keypoints),
                           expected = captured_by(trained, image, seen);
      EXPECT_TRUE(expected.valid.all().item<bool>());
      EXPECT_TRUE(torch::equal(found.valid, expected.valid));
      EXPECT_LT(difference(found.dofs, expected.dofs), 1e-4) << batch;  // up to some metres of translation
      EXPECT_LT(difference(found.landmarks, expected.landmarks), 1e-5) << batch;
      EXPECT_LT(difference(found.vertices, expected.vertices), 1e-5) << batch;
      // Without keypoints: the same person, moved to the origin.
      const CapturedPerson at_origin = file.forward(image, seen.camera.rotation);
      const Tensor moved = expected.landmarks - expected.landmarks.narrow(1, 0, 1);
      EXPECT_LT(difference(at_origin.landmarks - at_origin.landmarks.narrow(1, 0, 1), moved), 1e-5);
      EXPECT_LT(trained.pose->position(at_origin.dofs).abs().max().item<double>(), 1e-5);
    }
  }
}

TEST(PoseFileAgrees, DefNetBendsAndPoseNetAloneSkins) {
  const TemporaryFolder folder;
  TrainedPose trained = support::untrained_pose(true);
  write_pose_file(folder / "bent.pt", trained);
  trained.defnet = nullptr;
  write_pose_file(folder / "skinned.pt", trained);
  const Seen seen(1, static_cast<std::int64_t>(trained.landmarks.size()));
  const Tensor image = random_images(1);
  const CapturedPerson bent = PoseFile(folder / "bent.pt").forward(image, seen.camera.rotation),
                       skinned = PoseFile(folder / "skinned.pt").forward(image, seen.camera.rotation);
  EXPECT_TRUE(torch::equal(bent.dofs, skinned.dofs));
  EXPECT_GT(difference(bent.vertices, skinned.vertices), 1e-3);
  EXPECT_LT(std::filesystem::file_size(folder / "skinned.pt"), 0.7 * std::filesystem::file_size(folder / "bent.pt"));
}

TEST(PoseFileAgrees, NobodySeenIsMarkedAndFinite) {
  const TemporaryFolder folder;
  TrainedPose trained = support::untrained_pose(true);
  write_pose_file(folder / "pose.pt", trained);
  Seen seen(2, static_cast<std::int64_t>(trained.landmarks.size()));
  seen.keypoints.select(-1, 2)[0] = 0.1;                              // unsure, all of them
  seen.keypoints[1][0][0] = std::numeric_limits<float>::quiet_NaN();  // one is not a number
  const CapturedPerson found =
      PoseFile(folder / "pose.pt").placed(torch::zeros({2, 3, kInput, kInput}), seen.camera, seen.keypoints);
  EXPECT_FALSE(found.valid[0].item<bool>());
  EXPECT_TRUE(found.valid[1].item<bool>());
  for (const Tensor& tensor : {found.dofs, found.landmarks, found.vertices})
    EXPECT_TRUE(tensor.isfinite().all().item<bool>());
}

TEST(PoseFileRejects, WhatIsNotAPoseFile) {
  const TemporaryFolder folder;
  TrainedPose trained = support::untrained_pose(false);
  write_pose_file(folder / "pose.pt", trained);
  EXPECT_THAT(message_of<FileError>([&] { ActorFile::load(folder / "pose.pt"); }),
              HasSubstr("is a pose file, which takes images"));

  write_atomically(folder / "cut.pt", read_file(folder / "pose.pt").substr(0, 100000));
  EXPECT_THROW(PoseFile(folder / "cut.pt"), FileError);
  EXPECT_THROW(PoseFile(folder / "missing.pt"), FileError);
  torch::jit::Module other("other");
  other.define("def forward(self, x):\n  return x\n");
  other.save((folder / "other.pt").string());
  EXPECT_THAT(message_of<FileError>([&] { PoseFile(folder / "other.pt"); }), HasSubstr("not a Doppel pose file"));
}

/// An image and what is known of it, as the hosts read them. The network's window is the whole image, twice as large
/// as the network's input.
struct HostInput {
  cv::Mat bgr = cv::Mat(2 * kInput, 2 * kInput, CV_8UC3);
  Tensor image;  ///< [1,3,kInput,kInput] what the network is to see
  Seen seen;

  /// @param file the exported file, which tells where the landmarks are
  HostInput(const TrainedPose& trained, PoseFile& file, const TemporaryFolder& folder)
      : seen(1, static_cast<std::int64_t>(trained.landmarks.size())) {
    cv::RNG random(5);
    random.fill(bgr, cv::RNG::UNIFORM, 1, 256);
    cv::imwrite((folder / "image.ppm").string(), bgr);
    const Tensor bytes = torch::from_blob(bgr.data, {1, bgr.rows, bgr.cols, 3}, torch::kUInt8).flip(3);
    image = torch::avg_pool2d(bytes.permute({0, 3, 1, 2}).to(torch::kFloat32) / 255, 2);
    look_at(file.forward(image, seen.camera.rotation).landmarks);
    // A fifth of the longer side around these: 0 to 140.
    seen.keypoints[0][0] = torch::tensor({20.f, 120.f, 1.f});
    seen.keypoints[0][1] = torch::tensor({120.f, 20.f, 1.f});
    write_atomically(folder / "view.txt", view(trained));
    write_atomically(folder / "empty.txt", "");
  }

  /// Zooms until landmarks [1,M,3] about the origin fill the middle of the image, and sees them there.
  void look_at(const Tensor& landmarks) {
    const Tensor in_camera = turn_points(seen.camera.rotation, landmarks) + seen.camera.translation.unsqueeze(1);
    const Tensor rays = (in_camera.slice(2, 0, 2) / in_camera.slice(2, 2, 3))[0];
    const Tensor low = std::get<0>(rays.min(0)), high = std::get<0>(rays.max(0));
    const Tensor zoom = 80 / (high - low).max(), middle = 70 - zoom * (low + high) / 2;
    Tensor intrinsics = seen.camera.intrinsics[0];
    for (int i = 0; i < 2; ++i) {
      intrinsics[i][i] = zoom;
      intrinsics[i][2] = middle[i];
    }
    seen.keypoints.slice(2, 0, 2).copy_((zoom * rays + middle).unsqueeze(0));
  }

  std::string view(const TrainedPose& trained) const {
    const auto row = [](const Tensor& tensor) {
      std::string text;
      const Tensor flat = tensor.flatten();
      for (std::int64_t i = 0; i < flat.size(0); ++i) text += fmt::format(" {:.9g}", flat[i].item<float>());
      return text + "\n";
    };
    std::string text = "intrinsics" + row(seen.camera.intrinsics) + "rotation" + row(seen.camera.rotation) +
                       "translation" + row(seen.camera.translation);
    for (std::size_t m = 0; m < trained.landmarks.size(); ++m)
      text += "keypoint " + trained.landmarks[m].name + row(seen.keypoints[0][static_cast<std::int64_t>(m)]);
    return text;
  }
};

/// Runs a host. @return its exit code
int run_host(const std::string& host, const TemporaryFolder& folder, const std::string& view, const std::string& out) {
  std::string command = host;
  for (const std::string& name : {std::string("pose.pt"), std::string("image.ppm"), view, out})
    command += " '" + (folder / name).string() + "'";
  return std::system((command + " >/dev/null").c_str());
}

Tensor vertices_of(const std::filesystem::path& obj) {
  const TriangleMesh mesh = read_obj(obj, 1.0);
  Tensor vertices = torch::empty({mesh.num_vertices(), 3});
  for (int i = 0; i < mesh.num_vertices(); ++i)
    for (int c = 0; c < 3; ++c) vertices[i][c] = static_cast<float>(mesh.vertices[i][c]);
  return vertices;
}

/// What a host wrote against the library.
void expect_captured(const TemporaryFolder& folder, const std::string& host, const CapturedPerson& expected) {
  EXPECT_LT(difference(vertices_of(folder / (host + ".obj")), expected.vertices[0]), 1e-4) << host;
  const Motion motion = read_motion(folder / (host + ".motion"), static_cast<int>(expected.dofs.size(1)));
  ASSERT_EQ(motion.num_frames(), 1);
  for (std::int64_t d = 0; d < expected.dofs.size(1); ++d)
    EXPECT_NEAR(motion.frames[0][d], expected.dofs[0][d].item<float>(), 1e-3) << host << d;
}

TEST(PoseFileAgrees, WithThePythonAndTheCppHost) {
  const TemporaryFolder folder;
  TrainedPose trained = support::untrained_pose(true);
  write_pose_file(folder / "pose.pt", trained);
  PoseFile file(folder / "pose.pt");
  const HostInput input(trained, file, folder);
  const CapturedPerson expected = file.placed(input.image, input.seen.camera, input.seen.keypoints);

  ASSERT_EQ(run_host(POSE_HOST, folder, "view.txt", "host"), 0);
  expect_captured(folder, "host", expected);
  const cv::Mat host = cv::imread((folder / "host.ppm").string());
  ASSERT_EQ(host.size(), input.bgr.size());
  cv::Mat change;
  cv::absdiff(host, input.bgr, change);
  EXPECT_GT(cv::countNonZero(change.reshape(1)), 100);
  ASSERT_EQ(run_host(POSE_HOST, folder, "empty.txt", "host-origin"), 0);
  EXPECT_FALSE(std::filesystem::exists(folder / "host-origin.ppm"));
  EXPECT_NE(run_host(POSE_HOST, folder, "missing.txt", "nothing"), 0);

  if (std::system("/usr/bin/python3 -c 'import torch' 2>/dev/null") != 0)
    GTEST_SKIP() << "Debian's python3-torch is not installed: the Python host was not tried";
  ASSERT_EQ(run_host("/usr/bin/python3 " CAPTURE_PERSON, folder, "view.txt", "python"), 0);
  expect_captured(folder, "python", expected);
  cv::absdiff(host, cv::imread((folder / "python.ppm").string()), change);
  EXPECT_LT(cv::countNonZero(change.reshape(1) > 1), 30);  // points on the edge between two pixels
  // Without keypoints the window is that of the pixels that are not black, whose size no pixel of the input divides.
  ASSERT_EQ(run_host("/usr/bin/python3 " CAPTURE_PERSON, folder, "empty.txt", "python-origin"), 0);
  EXPECT_LT(difference(vertices_of(folder / "python-origin.obj"), vertices_of(folder / "host-origin.obj")), 1e-4);
}

}  // namespace
}  // namespace doppel::pose_file_test
