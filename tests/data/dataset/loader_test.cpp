#include "doppel/data/dataset/loader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <set>

#include "data/capture/capture_fixture.h"
#include "doppel/core/error.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/data/dataset/studio_crops.h"
#include "doppel/data/prepare/store_layout.h"
#include "support/message_of.h"

namespace doppel::loader_test {
namespace {

using test_capture::CaptureFixture;

/// One prepared capture for all tests of this file; they only read it.
class LoaderData : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    fixture_ = new CaptureFixture();
    fixture_->prepare();
    dataset_ = new Dataset(Dataset::open(fixture_->out()));
  }
  static void TearDownTestSuite() {
    delete dataset_;
    delete fixture_;
  }
  static LoaderOptions options(int workers = 0) {
    LoaderOptions result;
    result.batch_size = 5;
    result.cameras_per_sample = 2;
    result.seed = 42;
    result.workers = workers;
    return result;
  }
  static CaptureFixture* fixture_;
  static Dataset* dataset_;
};
CaptureFixture* LoaderData::fixture_ = nullptr;
Dataset* LoaderData::dataset_ = nullptr;

using LoaderReference = LoaderData;
using LoaderAgrees = LoaderData;
using LoaderRecovers = LoaderData;
using LoaderRejects = LoaderData;

bool same_images(const Batch& a, const Batch& b) {
  if (!a.image.defined()) return !b.image.defined();
  return torch::equal(a.image, b.image) && torch::equal(a.image_mask, b.image_mask) &&
         torch::equal(a.image_projection, b.image_projection);
}

bool same(const Batch& a, const Batch& b) {
  return same_images(a, b) && torch::equal(a.frames, b.frames) && torch::equal(a.sequence, b.sequence) &&
         torch::equal(a.dofs, b.dofs) && torch::equal(a.cameras, b.cameras) &&
         torch::equal(a.projection, b.projection) && torch::equal(a.distance, b.distance) &&
         torch::equal(a.pixel_scale, b.pixel_scale) && torch::equal(a.valid, b.valid) &&
         torch::equal(a.contour, b.contour) && torch::equal(a.contour_offsets, b.contour_offsets);
}

TEST(PermutationReference, IsAPermutationAndDependsOnSeedAndEpoch) {
  const auto order = seeded_permutation(100, 7, 3);
  EXPECT_EQ(std::set<std::int64_t>(order.begin(), order.end()).size(), 100u);
  EXPECT_EQ(order, seeded_permutation(100, 7, 3));
  EXPECT_NE(order, seeded_permutation(100, 7, 4));
  EXPECT_NE(order, seeded_permutation(100, 8, 3));
  EXPECT_TRUE(seeded_permutation(0, 1, 1).empty());
}

// Fixed for all time: a checkpoint of today must find the same frames tomorrow and on other machines.
TEST(PermutationReference, NeverChanges) {
  EXPECT_EQ(seeded_permutation(8, 1, 0), (std::vector<std::int64_t>{4, 2, 1, 5, 0, 3, 7, 6}));
}

TEST_F(LoaderReference, ShapesAndTypes) {
  Loader loader(*dataset_, options());
  const Batch batch = loader.next();
  EXPECT_EQ(batch.frames.sizes(), (std::vector<std::int64_t>{5}));
  EXPECT_EQ(batch.dofs.sizes(), (std::vector<std::int64_t>{5, 3, dataset_->num_dofs()}));
  EXPECT_EQ(batch.cameras.sizes(), (std::vector<std::int64_t>{5, 2}));
  EXPECT_EQ(batch.projection.sizes(), (std::vector<std::int64_t>{5, 2, 3, 4}));
  EXPECT_EQ(batch.distance.sizes(), (std::vector<std::int64_t>{5, 2, 64, 64}));
  EXPECT_EQ(batch.valid.scalar_type(), torch::kBool);
  EXPECT_EQ(batch.contour_offsets.size(0), 11);
  EXPECT_EQ(batch.contour_offsets[10].item<std::int64_t>(), batch.contour.size(0));
  EXPECT_TRUE(batch.valid.all().item<bool>());
}

TEST_F(LoaderReference, EveryEpochVisitsEveryFrameOnce) {
  LoaderOptions chosen = options();
  chosen.batch_size = 4;
  Loader loader(*dataset_, chosen);
  std::vector<std::vector<std::int64_t>> orders;
  for (int epoch = 0; epoch < 2; ++epoch) {
    std::vector<std::int64_t> order;
    for (int i = 0; i < 3; ++i) {
      const Batch batch = loader.next();
      for (int b = 0; b < 4; ++b) order.push_back(batch.frames[b].item<std::int64_t>());
    }
    EXPECT_EQ(std::set<std::int64_t>(order.begin(), order.end()).size(), 12u);
    orders.push_back(order);
  }
  EXPECT_NE(orders[0], orders[1]);
}

TEST_F(LoaderReference, DrawsDifferentCamerasWithoutRepetition) {
  Loader loader(*dataset_, options());
  std::set<std::pair<std::int64_t, std::int64_t>> pairs;
  for (int i = 0; i < 10; ++i) {
    const Batch batch = loader.next();
    for (int b = 0; b < 5; ++b)
      pairs.emplace(batch.cameras[b][0].item<std::int64_t>(), batch.cameras[b][1].item<std::int64_t>());
  }
  for (const auto& [first, second] : pairs) EXPECT_NE(first, second);
  EXPECT_EQ(pairs.size(), 6u);  // every ordered pair of three cameras
}

TEST_F(LoaderReference, NamedCamerasAlone) {
  LoaderOptions chosen = options();
  chosen.cameras = {"2"};
  Loader loader(*dataset_, chosen);
  EXPECT_TRUE((loader.next().cameras == 2).all().item<bool>());
}

// The window repeats the first frame of the segment instead of going before it. The fixture cuts at row 5.
TEST_F(LoaderReference, HistoryNeverCrossesACut) {
  const auto row_of = [&](long frame) {
    const auto& row = dataset_->sequences()[0].motion.frames[frame];
    return torch::tensor(std::vector<float>(row.begin(), row.end()));
  };
  const auto expect_rows = [&](long frame, const std::vector<long>& rows) {
    const torch::Tensor window = dataset_->dof_window({0, frame}, 2);
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(torch::equal(window[i], row_of(rows[i]))) << frame << " " << i;
  };
  expect_rows(0, {0, 0, 0});
  expect_rows(1, {0, 0, 1});
  expect_rows(2, {0, 1, 2});
  expect_rows(4, {2, 3, 4});
  expect_rows(5, {5, 5, 5});
  expect_rows(6, {5, 5, 6});
  expect_rows(7, {5, 6, 7});
}

/// [3,N] -> [N,4]
torch::Tensor homogeneous_of(Eigen::Matrix3Xf vertices) {
  const torch::Tensor rows = torch::from_blob(vertices.data(), {vertices.cols(), 3}).clone();
  return torch::cat({rows, torch::ones({rows.size(0), 1})}, 1);
}

// The silhouette's own numbers must agree with the character: projected vertices lie inside the outline or on it.
TEST_F(LoaderReference, ProjectionAndDistanceFitTogether) {
  Loader loader(*dataset_, options());
  const Batch batch = loader.next();
  TemplateChecker checker(fixture_->character);
  for (int b = 0; b < 5; ++b) {
    const auto& rows = dataset_->sequences()[0].motion.frames;
    const Eigen::Matrix3Xf vertices = checker.skin(rows[batch.frames[b].item<std::int64_t>()]);
    const torch::Tensor homogeneous = homogeneous_of(vertices);
    for (int c = 0; c < 2; ++c) {
      const torch::Tensor seen = torch::matmul(homogeneous, batch.projection[b][c].t());
      const torch::Tensor pixel = (seen.slice(1, 0, 2) / seen.slice(1, 2, 3)).floor().to(torch::kInt64);
      const torch::Tensor distance =
          batch.distance[b][c].flatten().index_select(0, pixel.select(1, 1) * 64 + pixel.select(1, 0));
      EXPECT_LT(distance.max().item<float>(), 1.6f);
      EXPECT_LT(distance.min().item<float>(), -1.0f);
    }
  }
}

TEST_F(LoaderReference, ContourPixelsLieOnTheInnerSideOfTheOutline) {
  Loader loader(*dataset_, options());
  const Batch batch = loader.next();
  for (int i = 0; i < 10; ++i) {
    const auto begin = batch.contour_offsets[i].item<std::int64_t>(),
               end = batch.contour_offsets[i + 1].item<std::int64_t>();
    ASSERT_GT(end, begin + 20);
    const torch::Tensor points = batch.contour.slice(0, begin, end);
    EXPECT_TRUE(((points - points.floor()) == 0.5f).all().item<bool>());
    const torch::Tensor pixel = points.floor().to(torch::kInt64);
    const torch::Tensor distance =
        batch.distance[i / 2][i % 2].flatten().index_select(0, pixel.select(1, 1) * 64 + pixel.select(1, 0));
    EXPECT_TRUE((distance == -0.5f).all().item<bool>());
  }
}

TEST_F(LoaderAgrees, WithAnyNumberOfWorkersPrefetchAndCache) {
  std::vector<Batch> expected;
  Loader plain(*dataset_, options());
  for (int i = 0; i < 12; ++i) expected.push_back(plain.next());
  for (const int workers : {1, 2, 5})
    for (const int prefetch : {1, 3, 9})
      for (const int cache_mb : {0, 1024}) {
        LoaderOptions chosen = options(workers);
        chosen.prefetch = prefetch;
        chosen.cache_mb = cache_mb;
        Loader loader(*dataset_, chosen);
        for (int i = 0; i < 12; ++i)
          ASSERT_TRUE(same(loader.next(), expected[i]))
              << workers << " workers, prefetch " << prefetch << ", batch " << i;
      }
}

TEST_F(LoaderAgrees, ImagesWithAnyNumberOfWorkersAndCache) {
  LoaderOptions chosen = options();
  chosen.images = true;
  chosen.image_size = 40;
  std::vector<Batch> expected;
  Loader plain(*dataset_, chosen);
  for (int i = 0; i < 8; ++i) expected.push_back(plain.next());
  for (const int workers : {1, 3})
    for (const int cache_mb : {0, 1, 1024}) {  // 1 MB holds some of the images
      chosen.workers = workers;
      chosen.cache_mb = cache_mb;
      Loader loader(*dataset_, chosen);
      for (int i = 0; i < 8; ++i)
        ASSERT_TRUE(same(loader.next(), expected[i])) << workers << " workers, " << cache_mb << " MB, batch " << i;
    }
}

TEST_F(LoaderReference, ImagesCarryColourMaskAndCamera) {
  LoaderOptions chosen = options();
  EXPECT_FALSE(Loader(*dataset_, chosen).next().image.defined());
  chosen.images = true;
  const Batch batch = Loader(*dataset_, chosen).next();
  ASSERT_EQ(batch.image.sizes(), (std::vector<std::int64_t>{5, 2, 48, 48, 3}));
  ASSERT_EQ(batch.image_mask.sizes(), (std::vector<std::int64_t>{5, 2, 48, 48}));
  EXPECT_EQ(batch.image.scalar_type(), torch::kUInt8);
  EXPECT_EQ(batch.image_mask.max().item<int>(), 1);
  TemplateChecker checker(fixture_->character);
  for (int b = 0; b < 5; ++b) {
    const long frame = batch.frames[b].item<std::int64_t>();
    const Eigen::Matrix3Xf vertices = checker.skin(dataset_->sequences()[0].motion.frames[frame]);
    const torch::Tensor homogeneous = homogeneous_of(vertices);
    for (int c = 0; c < 2; ++c) {
      cv::Mat stored = dataset_->crop_image({0, frame}, static_cast<int>(batch.cameras[b][c].item<std::int64_t>()));
      const torch::Tensor bgr = torch::from_blob(stored.data, {48, 48, 3}, torch::kUInt8);
      EXPECT_TRUE(torch::equal(batch.image[b][c], bgr.flip(2)));
      // The fixture paints the person reddish on green; the rest is what the video's compression makes of it.
      const torch::Tensor inside = batch.image_mask[b][c].ne(0);
      const torch::Tensor colour = std::get<0>(batch.image[b][c].index({inside}).to(torch::kInt32).median(0));
      EXPECT_GT(colour[0].item<int>(), colour[1].item<int>() + 20);
      const torch::Tensor seen = torch::matmul(homogeneous, batch.image_projection[b][c].t());
      const torch::Tensor pixel = (seen.slice(1, 0, 2) / seen.slice(1, 2, 3)).floor().to(torch::kInt64);
      const torch::Tensor hit = inside.flatten().index_select(0, pixel.select(1, 1) * 48 + pixel.select(1, 0));
      EXPECT_GT(hit.to(torch::kFloat32).mean().item<float>(), 0.7f);  // vertices on the outline may fall beside
    }
  }
}

TEST_F(LoaderReference, SmallerImagesShowTheSameWindow) {
  BatchOptions chosen;
  chosen.images = true;
  const Batch whole = make_batch(*dataset_, {{0, 3}}, {{1}}, chosen);
  chosen.image_size = 24;
  const Batch half = make_batch(*dataset_, {{0, 3}}, {{1}}, chosen);
  const torch::Tensor expected = whole.image[0][0].to(torch::kFloat32).view({24, 2, 24, 2, 3}).mean({1, 3});
  EXPECT_LE((half.image[0][0].to(torch::kFloat32) - expected).abs().max().item<float>(), 0.5f);
  EXPECT_TRUE(torch::allclose(half.image_projection.slice(2, 0, 2) * 2, whole.image_projection.slice(2, 0, 2)));
  const torch::Tensor area = whole.image_mask.sum(), small = half.image_mask.sum();
  EXPECT_NEAR(small.item<float>() * 4.0f, area.item<float>(), 0.1f * area.item<float>());
}

TEST_F(LoaderRejects, ImagesLargerThanTheStoredOnes) {
  LoaderOptions chosen = options();
  chosen.images = true;
  for (const int size : {49, -1}) {
    chosen.image_size = size;
    EXPECT_THROW(Loader(*dataset_, chosen), UsageError);
    EXPECT_THROW(make_batch(*dataset_, {{0, 1}}, {{0}}, {2, true, size}), UsageError);
  }
}

// Beyond the camera's image masks are continued for the distance transform, but an image has nobody there.
TEST(DatasetReference, NobodyBeyondTheImage) {
  const CaptureFixture fixture(test_capture::Options{1, 3, 2, true});
  fixture.prepare();
  const std::string key = record_key("training", "0", 1);
  {
    Store store(fixture.out() / "store", Store::Mode::write);
    FrameRecord record = decode_record(store.get(key).value(), key);
    record.full_mask = encode_mask(cv::Mat(record.height, record.width, CV_8U, cv::Scalar(255)));
    record.box = {-16, 32, 128};  // of 112 x 128 pixels: 12.5 % beyond the left edge, 25 % below the lower
    store.put({{key, encode_record(record)}});
  }
  const Dataset dataset = Dataset::open(fixture.out());
  const ImageCrop crop = dataset.image({0, 1}, 0);
  ASSERT_EQ(crop.pixels, 48);
  const auto at = [&](int x, int y) { return static_cast<int>(crop.foreground[48 * y + x]); };
  EXPECT_EQ(at(5, 10), 0);
  EXPECT_EQ(at(6, 10), 1);
  EXPECT_EQ(at(47, 35), 1);
  EXPECT_EQ(at(47, 36), 0);
}

TEST(DatasetReference, EmptyViewsHaveBlackImages) {
  const CaptureFixture fixture(test_capture::Options{1, 3, 2, true});
  fixture.prepare();
  const std::string key = record_key("training", "0", 1);
  {
    Store store(fixture.out() / "store", Store::Mode::write);
    FrameRecord record = decode_record(store.get(key).value(), key);
    record.box = {};
    record.crop_mask = record.crop_image = "";
    store.put({{key, encode_record(record)}});
  }
  const Dataset dataset = Dataset::open(fixture.out());
  const Batch batch = make_batch(dataset, {{0, 1}}, {{0}}, {2, true, 0});
  EXPECT_FALSE(batch.valid.item<bool>());
  EXPECT_EQ(batch.image.max().item<int>(), 0);
  EXPECT_EQ(batch.image_mask.max().item<int>(), 0);
  EXPECT_TRUE(torch::isfinite(batch.image_projection).all().item<bool>());
}

class BackgroundCapture : public ::testing::Test {
 protected:
  BackgroundCapture() : fixture_(test_capture::Options{2, 3, 2, true}) {
    std::filesystem::create_directories(fixture_.root() / "background");
    for (int camera = 0; camera < 2; ++camera) {
      image_[camera].create(test_capture::kHeight, test_capture::kWidth, CV_8UC3);
      cv::randu(image_[camera], 0, 255);
      write(camera, image_[camera]);
    }
    fixture_.write_yaml("background: background/{camera:03}.png\n" + fixture_.yaml(""));
    fixture_.prepare();
  }
  void write(int camera, const cv::Mat& image) const { cv::imwrite(path(camera).string(), image); }
  std::filesystem::path path(int camera) const {
    return fixture_.root() / "background" / ("00" + std::to_string(camera) + ".png");
  }
  CaptureFixture fixture_;
  cv::Mat image_[2];
};
using BackgroundReference = BackgroundCapture;
using BackgroundRejects = BackgroundCapture;

TEST_F(BackgroundReference, TheImageOfEachCamera) {
  const Dataset dataset = Dataset::open(fixture_.out());
  for (int camera = 0; camera < 2; ++camera)
    EXPECT_EQ(cv::norm(dataset.background(camera), image_[camera], cv::NORM_INF), 0.0);
}

TEST_F(BackgroundReference, CropsShowTheSamePartAsTheImages) {
  // Red is the column and green the row of the camera's image.
  cv::Mat ramp(test_capture::kHeight, test_capture::kWidth, CV_8UC3);
  for (int v = 0; v < ramp.rows; ++v)
    for (int u = 0; u < ramp.cols; ++u)
      ramp.at<cv::Vec3b>(v, u) = {7, cv::saturate_cast<uchar>(v), cv::saturate_cast<uchar>(u)};
  write(1, ramp);
  const Dataset dataset = Dataset::open(fixture_.out());
  StudioCrops crops(dataset);
  ASSERT_TRUE(crops.exist());
  const SampleId sample{0, 1};
  const Batch batch = make_batch(dataset, {sample}, {{0, 1}}, {2, true, 0});
  const torch::Tensor found = 255 * crops.of(batch)[0][1];
  const CropBox box = dataset.crop_box(sample, 1);
  const auto side = found.size(0);
  ASSERT_EQ(batch.image.size(2), side);
  for (std::int64_t i = side / 4; i < side; i += side / 4) {
    const double at = (static_cast<double>(i) + 0.5) * box.side / static_cast<double>(side) - 0.5;
    EXPECT_NEAR(found[i][i][0].item<double>(), box.u0 + at, 1.0);
    EXPECT_NEAR(found[i][i][1].item<double>(), box.v0 + at, 1.0);
    EXPECT_EQ(found[i][i][2].item<double>(), 7.0);
  }
}

TEST_F(LoaderReference, NoBackgroundWithoutImages) { EXPECT_TRUE(dataset_->background(0).empty()); }

TEST_F(BackgroundRejects, MissingAndOtherSizes) {
  const Dataset dataset = Dataset::open(fixture_.out());
  std::filesystem::remove(path(0));
  EXPECT_THROW(dataset.background(0), FileError);
  write(1, cv::Mat(50, 60, CV_8UC3, cv::Scalar(1, 2, 3)));
  EXPECT_THROW(dataset.background(1), FileError);
}

TEST_F(LoaderRecovers, TheSameBatchesAfterRestore) {
  Loader unbroken(*dataset_, options(2));
  std::vector<std::string> states;
  std::vector<Batch> batches;
  for (int i = 0; i < 9; ++i) {
    states.push_back(unbroken.state());
    batches.push_back(unbroken.next());
  }
  for (const int at : {0, 1, 4, 7}) {
    LoaderOptions chosen = options(at % 3);
    chosen.seed = 999;  // the checkpoint's seed wins
    Loader resumed(*dataset_, chosen);
    resumed.next();
    resumed.restore(states[at]);
    for (int i = at; i < 9; ++i)
      ASSERT_TRUE(same(resumed.next(), batches[i])) << "restored at " << at << ", batch " << i;
    EXPECT_EQ(Loader(*dataset_, options()).state(), states[0]);
  }
}

TEST_F(LoaderRejects, StatesOfOtherData) {
  LoaderOptions other = options();
  other.cameras = {"0", "1"};
  const std::string state = Loader(*dataset_, other).state();
  Loader loader(*dataset_, options());
  EXPECT_THROW(loader.restore(state), Error);
  EXPECT_THROW(loader.restore(""), Error);
  EXPECT_THROW(loader.restore("{}"), Error);
  EXPECT_THROW(loader.restore("[1,2]"), Error);
  other = options();
  other.batch_size = 6;
  EXPECT_THROW(loader.restore(Loader(*dataset_, other).state()), Error);
}

TEST_F(LoaderRejects, OptionsThatMakeNoSense) {
  const auto rejects = [&](auto change) {
    LoaderOptions chosen = options();
    change(chosen);
    EXPECT_THROW(Loader(*dataset_, chosen), UsageError);
  };
  rejects([](LoaderOptions& o) { o.batch_size = 0; });
  rejects([](LoaderOptions& o) { o.cameras = {"7"}; });
  rejects([](LoaderOptions& o) { o.workers = -1; });
  rejects([](LoaderOptions& o) { o.prefetch = 0; });
  rejects([](LoaderOptions& o) { o.past_frames = -1; });
  rejects([](LoaderOptions& o) { o.cameras_per_sample = -1; });
}

TEST_F(LoaderReference, MakeBatchGivesWhatWasAskedFor) {
  const Batch batch = make_batch(*dataset_, {{1, 2}, {0, 7}}, {{1, 0}, {2, 2}}, {1});
  EXPECT_EQ(batch.frames[1].item<std::int64_t>(), 7);
  EXPECT_EQ(batch.sequence[0].item<std::int64_t>(), 1);
  EXPECT_EQ(batch.cameras[0][0].item<std::int64_t>(), 1);
  EXPECT_TRUE(torch::equal(batch.distance[1][0], batch.distance[1][1]));
  EXPECT_EQ(batch.dofs.size(1), 2);
  EXPECT_THROW(make_batch(*dataset_, {}, {}, {2}), UsageError);
  EXPECT_THROW(make_batch(*dataset_, {{0, 1}, {0, 2}}, {{0}, {0, 1}}, {2}), UsageError);
}

// An error in a worker reaches the caller, and the loader can be taken down afterwards.
TEST(LoaderRejectsDamage, ADamagedRecordSurfacesInNext) {
  const CaptureFixture fixture(test_capture::Options{1, 4, 2, true});
  fixture.prepare();
  {
    Store store(fixture.out() / "store", Store::Mode::write);
    std::string record = store.get(record_key("training", "0", 2)).value();
    record[record.size() / 2] = static_cast<char>(record[record.size() / 2] ^ 1);
    store.put({{record_key("training", "0", 2), record}});
  }
  const Dataset dataset = Dataset::open(fixture.out());
  LoaderOptions chosen;
  chosen.batch_size = 4;
  chosen.workers = 2;
  Loader loader(dataset, chosen);
  EXPECT_THROW(loader.next(), Error);
}

TEST(DatasetRejects, FoldersThatAreNotPrepared) {
  const CaptureFixture fixture(test_capture::Options{1, 3, 2, true});
  EXPECT_THROW(Dataset::open(fixture.root()), UsageError);
  EXPECT_THROW(Dataset::open(fixture.path("nowhere")), UsageError);
  fixture.prepare();
  const Dataset dataset = Dataset::open(fixture.out());
  EXPECT_THROW(dataset.mask({0, 99}, 0), Error);
  EXPECT_THROW(dataset.camera_index("x"), UsageError);
  EXPECT_THROW(dataset.samples(Split::train, 0), UsageError);
  write_motion(fixture.root() / "training/poses.motion", test_capture::swaying_motion(fixture.character, 2, 0.0), true);
  EXPECT_THROW(Dataset::open(fixture.out()), Error);
}

/// The file of the fixture's skeleton with another one in it.
void exchange_skeleton(const CaptureFixture& fixture, const Skeleton& skeleton) {
  for (const auto& entry : std::filesystem::directory_iterator(fixture.root() / "character"))
    if (entry.path().extension() == ".skeleton") write_skeleton(entry.path(), skeleton);
}

TEST(DatasetRejects, AnExchangedSkeleton) {
  const CaptureFixture fixture;
  fixture.prepare();
  Skeleton scaled = fixture.character.skeleton;
  scaled.joints.back().offset *= 1.25;
  exchange_skeleton(fixture, scaled);
  EXPECT_NO_THROW(Dataset::open(fixture.out()));
  Skeleton renamed = fixture.character.skeleton;
  renamed.joints.back().name += "_other";
  exchange_skeleton(fixture, renamed);
  EXPECT_THAT(support::message_of<Error>([&] { Dataset::open(fixture.out()); }),
              testing::HasSubstr("character of the preparation"));
}

TEST(DatasetRejects, ALandmarkWithoutItsJointInAnOldStore) {
  const CaptureFixture fixture;
  fixture.prepare();
  Store store(fixture.out() / kStoreFolder, Store::Mode::write);
  StoreLayout layout = read_store_layout(store);
  layout.skeleton.clear();  // as older versions
  layout.landmarks = {{"knee", fixture.character.skeleton.num_joints() - 1, Eigen::Vector3d::Zero(), 0.01}};
  write_store_layout(store, layout);
  EXPECT_NO_THROW(Dataset::open(fixture.out()));
  layout.landmarks[0].joint += 1;
  write_store_layout(store, layout);
  EXPECT_THAT(support::message_of<Error>([&] { Dataset::open(fixture.out()); }),
              testing::HasSubstr("character of the preparation"));
  layout.landmarks[0].joint = -1;
  write_store_layout(store, layout);
  EXPECT_THAT(support::message_of<Error>([&] { Dataset::open(fixture.out()); }),
              testing::HasSubstr("impossible sizes"));
}

TEST(DatasetRejects, CamerasThatAreNotThoseOfTheStore) {
  const CaptureFixture fixture;
  fixture.prepare();
  Capture capture = read_capture(fixture.out());
  capture.cameras = {capture.cameras.back()};
  write_capture(fixture.out() / "capture.yaml", capture);
  EXPECT_THAT(support::message_of<Error>([&] { Dataset::open(fixture.out()); }),
              testing::HasSubstr("those of the store"));
}

}  // namespace
}  // namespace doppel::loader_test
