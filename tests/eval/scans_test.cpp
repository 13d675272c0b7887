#include "doppel/eval/scans.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/types.h>

#include <memory>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/geometry/mesh.h"
#include "support/message_of.h"
#include "support/small_capture.h"
#include "support/temporary_folder.h"

namespace doppel::scans_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kMillimetre = 0.001;
constexpr int kDance = 1;  // index of the sequence of the test split

/// A square in the plane z = height, much larger than what is measured. @param unit of the file, metres
void write_plane(const fs::path& path, double height, double unit = kMillimetre) {
  TriangleMesh mesh;
  mesh.vertices = {{-50, -50, height}, {50, -50, height}, {50, 50, height}, {-50, 50, height}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  fs::create_directories(path.parent_path());
  write_obj(path, mesh, unit);
}

class ScansReference : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    capture_folder_ = std::make_unique<TemporaryFolder>();
    SmallCaptureOptions options;
    options.mask_size = 64;
    options.train_frames = 3;
    dataset_ = std::make_unique<Dataset>(Dataset::open(make_small_capture(capture_folder_->path(), options)));
  }
  static void TearDownTestSuite() {
    dataset_.reset();
    capture_folder_.reset();
  }

  fs::path at(const std::string& name) const { return folder_ / name; }
  Scans scans(double unit = kMillimetre) const { return Scans(*dataset_, test_, folder_.path(), unit); }
  std::string complaint(const std::vector<SampleId>& samples) const {
    return message_of<UsageError>([&] { Scans(*dataset_, samples, folder_.path(), kMillimetre); });
  }

  static std::unique_ptr<TemporaryFolder> capture_folder_;
  static std::unique_ptr<Dataset> dataset_;
  TemporaryFolder folder_;
  const std::vector<SampleId> test_ = dataset_->samples(Split::test);
  /// More points than the mesh of a scan has vertices, below its plane.
  const torch::Tensor points_ = torch::rand({40, 3}, at::detail::createCPUGenerator(1));
};
std::unique_ptr<TemporaryFolder> ScansReference::capture_folder_;
std::unique_ptr<Dataset> ScansReference::dataset_;
using ScansRejects = ScansReference;

TEST_F(ScansReference, MeanDistanceToAPlane) {
  write_plane(at("dance/3.obj"), 1.5);
  const double expected = 1.5 - points_.select(1, 2).mean().item<double>();
  const Scans found = scans();
  EXPECT_EQ(found.size(), 1u);
  EXPECT_NEAR(found.mean_distance({kDance, 3}, points_).value(), expected, 1e-6);
  EXPECT_FALSE(found.mean_distance({kDance, 2}, points_));
  EXPECT_FALSE(found.mean_distance({0, 3}, points_));
}

TEST_F(ScansReference, TheUnitOfTheFiles) {
  write_plane(at("dance/3.obj"), 1.5, 1.0);
  const double expected = 1.5 - points_.select(1, 2).mean().item<double>();
  EXPECT_NEAR(scans(1.0).mean_distance({kDance, 3}, points_).value(), expected, 1e-6);
  EXPECT_NE(scans().mean_distance({kDance, 3}, points_).value(), expected);
}

// What the scan has besides, and nothing of the surface is near to, does not count.
TEST_F(ScansReference, OneDirectionOnly) {
  write_plane(at("dance/3.obj"), 1.5);
  const double before = scans().mean_distance({kDance, 3}, points_).value();
  TriangleMesh mesh = read_obj(at("dance/3.obj"), kMillimetre);
  mesh.vertices.insert(mesh.vertices.end(), {{0, 0, 900}, {1, 0, 900}, {0, 1, 900}});
  mesh.faces.push_back({4, 5, 6});
  write_obj(at("dance/3.obj"), mesh, kMillimetre);
  EXPECT_NEAR(scans().mean_distance({kDance, 3}, points_).value(), before, 1e-9);
}

TEST_F(ScansReference, NamesOfFiles) {
  write_plane(at("000003.obj"), 1.5);
  write_plane(at("1.obj"), 2.5);
  write_plane(at("77.obj"), 2.5);
  write_plane(at("template.obj"), 2.5);
  EXPECT_EQ(scans().size(), 2u);
  EXPECT_TRUE(scans().mean_distance({kDance, 3}, points_));
  // A folder of the sequence replaces the files beside it.
  write_plane(at("dance/2.obj"), 1.5);
  EXPECT_EQ(scans().size(), 1u);
  EXPECT_FALSE(scans().mean_distance({kDance, 3}, points_));
}

TEST_F(ScansReference, NamesInCapitals) {
  write_plane(at("0003.obj"), 1.5);
  fs::rename(at("0003.obj"), at("0003.OBJ"));
  const Scans found = scans();
  EXPECT_EQ(found.size(), 1u);
  EXPECT_NEAR(found.mean_distance({kDance, 3}, points_).value(), 1.5 - points_.select(1, 2).mean().item<double>(),
              1e-6);
  fs::remove(at("0003.OBJ"));
  write_atomically(at("0003.PLY"), "ply\n");
  EXPECT_THAT(complaint(test_), HasSubstr(".ply files are not read"));
}

TEST_F(ScansRejects, FoldersWithoutScans) {
  EXPECT_THAT(message_of<UsageError>([&] { Scans(*dataset_, test_, at("none"), 1.0); }),
              AllOf(HasSubstr("none"), HasSubstr("does not exist")));
  write_plane(at("dance/77.obj"), 1.5);
  EXPECT_THAT(complaint(test_), AllOf(HasSubstr("none of the 5 evaluated frames"), HasSubstr("dance/0.obj"),
                                      HasSubstr("row of the motion"), Not(HasSubstr(".ply"))));
  write_atomically(at("dance/0.ply"), "ply\n");
  EXPECT_THAT(complaint(test_), HasSubstr(".ply files are not read"));
}

TEST_F(ScansRejects, TwoScansOfOneFrame) {
  write_plane(at("dance/3.obj"), 1.5);
  write_plane(at("dance/03.obj"), 1.5);
  EXPECT_THAT(complaint(test_), AllOf(HasSubstr("3.obj"), HasSubstr("03.obj"), HasSubstr("one frame")));
}

TEST_F(ScansRejects, FramesOfTwoSequencesInOneFolder) {
  write_plane(at("2.obj"), 1.5);
  std::vector<SampleId> both = test_;
  for (const SampleId& sample : dataset_->samples(Split::train)) both.push_back(sample);
  EXPECT_THAT(complaint(both), HasSubstr("2 sequences are evaluated"));
  fs::create_directories(at("walk"));
  EXPECT_EQ(Scans(*dataset_, both, folder_.path(), kMillimetre).size(), 1u);
}

TEST_F(ScansRejects, FilesThatAreNoMesh) {
  write_atomically(at("dance/3.obj"), "v 0 0 0\n");
  EXPECT_THAT(message_of<FileError>([&] { scans().mean_distance({kDance, 3}, points_); }), HasSubstr("3.obj"));
}

}  // namespace
}  // namespace doppel::scans_test
