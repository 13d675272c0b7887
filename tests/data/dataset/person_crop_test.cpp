#include "doppel/data/dataset/person_crop.h"

#include <gmock/gmock.h>

#include <opencv2/imgproc.hpp>

#include "data/capture/keypoint_fixture.h"
#include "doppel/core/error.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/data/dataset/loader.h"

namespace doppel::person_crop_test {
namespace {

using namespace test_capture;

constexpr float kBlack[3]{-0.485f / 0.229f, -0.456f / 0.224f, -0.406f / 0.225f};

TEST(PersonWindows, FollowTheKeypointsThenTheMask) {
  const cv::Rect2d mask(100, 50, 80, 200);
  const std::vector<Keypoint> points{{110, 60, 0.9f}, {170, 60, 0.9f}, {140, 140, 0.5f}, {140, 220, 0.5f}};
  PersonWindow window = person_window(points, mask);
  EXPECT_DOUBLE_EQ(window.side, 1.4 * 160);
  EXPECT_DOUBLE_EQ(window.u0 + 0.5 * window.side, 140);
  EXPECT_DOUBLE_EQ(window.v0 + 0.5 * window.side, 140);
  // An unsure point and one far from the mask do not count.
  std::vector<Keypoint> wild = points;
  wild.push_back({500, 500, 0.39f});
  wild.push_back({10, 60, 0.9f});
  EXPECT_DOUBLE_EQ(person_window(wild, mask).side, window.side);
  EXPECT_DOUBLE_EQ(person_window(wild, {}).side, 1.4 * 160);  // no mask: 10 .. 170 is as long
  // Too few points: the mask.
  window = person_window({points[0], points[1], points[2]}, mask);
  EXPECT_DOUBLE_EQ(window.side, 1.4 * 200);
  EXPECT_DOUBLE_EQ(window.v0 + 0.5 * window.side, 150);
  EXPECT_TRUE(person_window({}, {}).empty());
  EXPECT_TRUE(person_window(std::vector<Keypoint>(9), {}).empty());
}

/// A red disc of radius 30 around (70, 60) on green.
PersonImage disc() {
  PersonImage image;
  image.rgb = cv::Mat(160, 200, CV_8UC3, cv::Scalar(20, 200, 30));
  cv::circle(image.rgb, {70, 60}, 30, cv::Scalar(180, 60, 40), cv::FILLED);
  image.foreground = cv::Mat::zeros(image.rgb.size(), CV_8U);
  cv::circle(image.foreground, {70, 60}, 30, 255, cv::FILLED);
  return image;
}

torch::Tensor written(const PersonImage& image, const PersonWindow& window, const Photometry& change, int pixels) {
  torch::Tensor result = torch::empty({3, pixels, pixels});
  write_person(image, window, change, pixels, result.data_ptr<float>());
  return result;
}

TEST(PersonImages, AreBlackAroundThePersonAndNormalised) {
  const PersonImage image = disc();
  const torch::Tensor result = written(image, {30.5, 20.5, 80}, {}, 40);  // the disc's middle is the window's
  const float colour[3]{180, 60, 40};
  for (int k = 0; k < 3; ++k) {
    const float deviation[3]{0.229f, 0.224f, 0.225f};
    EXPECT_NEAR(result[k][20][20].item<float>(), kBlack[k] + colour[k] / 255.0f / deviation[k], 1e-4);
    for (const auto& [row, column] : {std::pair(0, 0), std::pair(39, 39), std::pair(2, 20)})
      EXPECT_FLOAT_EQ(result[k][row][column].item<float>(), kBlack[k]);
  }
  // No green shines through anywhere: along the edge everything is a darker red.
  const auto red = result[0] - kBlack[0], green = result[1] - kBlack[1];
  EXPECT_LT((green - red * (60.0f / 180.0f) * (0.229f / 0.224f)).abs().max().item<float>(), 0.03f);
  // Nothing is shifted by a part of a pixel.
  const auto positions = torch::arange(40).to(torch::kFloat32) + 0.5f;
  for (const int along : {0, 1})
    EXPECT_NEAR((red.sum(1 - along) * positions).sum().item<float>() / red.sum().item<float>(), 20.0f, 0.03f);
}

TEST(PersonImages, PartsOfAImageSeeTheSame) {
  const PersonImage whole = disc();
  PersonImage part = whole;
  const cv::Rect box(30, 20, 90, 90);
  part.rgb = whole.rgb(box).clone();
  part.foreground = whole.foreground(box).clone();
  part.u0 = 30;
  part.v0 = 20;
  const PersonWindow window{31.3, 22.7, 80.0};
  EXPECT_LT((written(whole, window, {}, 64) - written(part, window, {}, 64)).abs().max().item<float>(), 1e-5f);
  cv::resize(part.rgb, part.rgb, {180, 180}, 0, 0, cv::INTER_NEAREST);
  cv::resize(part.foreground, part.foreground, {180, 180}, 0, 0, cv::INTER_NEAREST);
  part.scale = 2.0;
  EXPECT_EQ(part.mask_box(), whole.mask_box());
  EXPECT_LT((written(whole, window, {}, 64) - written(part, window, {}, 64)).abs().mean().item<float>(), 0.05f);
}

TEST(PersonImages, ColoursChangeAsAsked) {
  const PersonImage image = disc();
  const PersonWindow window{40.5, 30.5, 60};
  const auto middle = [&](const Photometry& change) {
    const torch::Tensor result = written(image, window, change, 31);
    std::array<double, 3> colour;
    const double deviation[3]{0.229, 0.224, 0.225};
    for (int k = 0; k < 3; ++k) {
      EXPECT_FLOAT_EQ(result[k][0][0].item<float>(), kBlack[k]) << "black stays black";
      colour[k] = 255.0 * deviation[k] * (result[k][15][15].item<float>() - kBlack[k]);
    }
    return colour;
  };
  Photometry change;
  change.brightness = 1.2;
  EXPECT_NEAR(middle(change)[0], 216, 0.1);
  EXPECT_NEAR(middle(change)[2], 48, 0.1);
  change = {};
  change.saturation = 0.0;
  const double grey = 0.299 * 180 + 0.587 * 60 + 0.114 * 40;
  for (const double value : middle(change)) EXPECT_NEAR(value, grey, 0.1);
  change = {};
  change.contrast = 0.5;
  EXPECT_NEAR(middle(change)[0], 0.5 * 180 + 0.5 * grey, 1.0);
  change = {};
  change.hue = 2.0 * CV_PI / 3.0;  // a third of the circle: red becomes green
  EXPECT_NEAR(middle(change)[1], 180, 0.1);
  EXPECT_NEAR(middle(change)[2], 60, 0.1);
}

TEST(PersonImages, DrawsStayInTheirRanges) {
  SplitMix random(3);
  double least = 2.0, most = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const Photometry change = draw_photometry(random);
    for (const double factor : {change.brightness, change.contrast, change.saturation}) {
      EXPECT_GE(factor, 0.8);
      EXPECT_LE(factor, 1.2);
      least = std::min(least, factor);
      most = std::max(most, factor);
    }
    EXPECT_LE(std::abs(change.hue), 0.1 * CV_PI);
    const PersonWindow window = draw_window({100, 50, 200}, random);
    EXPECT_NEAR(window.side, 200, 10);
    EXPECT_NEAR(window.u0 + 0.5 * window.side, 200, 10.0001);
    EXPECT_NEAR(window.v0 + 0.5 * window.side, 150, 10.0001);
  }
  EXPECT_LT(least, 0.81);
  EXPECT_GT(most, 1.19);
}

TEST(PersonImages, OfOneWholeImage) {
  const PersonImage image = disc();
  cv::Mat bgr;
  cv::cvtColor(image.rgb, bgr, cv::COLOR_RGB2BGR);
  PinholeCamera camera(ring_camera(0, 3));
  camera.width = 200;
  camera.height = 160;
  const PersonInput input = person_input(bgr, image.foreground, {}, camera, 48);
  EXPECT_TRUE(input.valid);
  EXPECT_EQ(input.image.sizes(), (std::vector<std::int64_t>{3, 48, 48}));
  EXPECT_GT(input.image[0][24][24].item<float>(), 0.5f);
  EXPECT_EQ(input.camera.width, 48);
  const PersonInput nobody = person_input(bgr, cv::Mat::zeros(160, 200, CV_8U), {}, camera, 48);
  EXPECT_FALSE(nobody.valid);
  EXPECT_FLOAT_EQ(nobody.image[1].max().item<float>(), kBlack[1]);
  EXPECT_THROW(person_input(bgr, cv::Mat::zeros(16, 20, CV_8U), {}, camera, 48), UsageError);
}

/// Batches of the small capture with what networks see.
class PersonBatches : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    Options images;
    images.videos = false;
    fixture_ = new CaptureFixture(images);
    add_keypoints(*fixture_);
    PrepareOptions lossless = fixture_->prepare_options();  // lossy colours of neighbouring pixels run into each other
    lossless.jpeg_quality = 0;
    prepare_capture(fixture_->capture(), lossless);
    dataset_ = new Dataset(Dataset::open(fixture_->out()));
  }
  static void TearDownTestSuite() {
    delete dataset_;
    delete fixture_;
  }
  static LoaderOptions options(int workers, bool augment = true) {
    LoaderOptions result;
    result.batch_size = 4;
    result.workers = workers;
    result.keypoints = true;
    result.person_size = 32;
    result.augment = augment;
    result.seed = 11;
    return result;
  }
  static bool same(const Batch& a, const Batch& b) {
    return torch::equal(a.person, b.person) && torch::equal(a.person_camera, b.person_camera) &&
           torch::equal(a.person_projection, b.person_projection) && torch::equal(a.keypoints, b.keypoints);
  }
  static CaptureFixture* fixture_;
  static Dataset* dataset_;
};
CaptureFixture* PersonBatches::fixture_ = nullptr;
Dataset* PersonBatches::dataset_ = nullptr;

TEST_F(PersonBatches, AreTheSameForAnyNumberOfWorkers) {
  Loader alone(*dataset_, options(0)), one(*dataset_, options(1)), two(*dataset_, options(2));
  LoaderOptions uncached = options(2);
  uncached.cache_mb = 0;
  Loader fresh(*dataset_, uncached);
  bool varied = false;
  torch::Tensor last;
  for (int i = 0; i < 8; ++i) {
    const Batch batch = alone.next();
    EXPECT_TRUE(same(batch, one.next()));
    EXPECT_TRUE(same(batch, two.next()));
    EXPECT_TRUE(same(batch, fresh.next()));
    varied |= batch.person_camera.max().item<std::int64_t>() > batch.person_camera.min().item<std::int64_t>();
    EXPECT_TRUE(batch.person_valid.all().item<bool>());
  }
  EXPECT_TRUE(varied) << "the camera is drawn";
}

TEST_F(PersonBatches, DependOnTheSeedAndResume) {
  LoaderOptions other = options(0);
  other.seed = 12;
  Loader loader(*dataset_, options(0)), seeded(*dataset_, other), resumed(*dataset_, options(2));
  EXPECT_FALSE(torch::equal(loader.next().person, seeded.next().person));
  const std::string state = loader.state();
  const Batch next = loader.next();
  resumed.restore(state);
  EXPECT_TRUE(same(next, resumed.next()));
}

TEST_F(PersonBatches, WithoutAugmentationShowTheFirstCameraAsItIs) {
  BatchOptions plain;
  plain.person_size = 32;
  plain.keypoints = true;
  const Batch batch = make_batch(*dataset_, {{0, 3}, {0, 4}}, {{1, 2}, {2, 0}}, plain);
  EXPECT_EQ(batch.person.sizes(), (std::vector<std::int64_t>{2, 1, 3, 32, 32}));
  EXPECT_EQ(batch.person_camera.max().item<std::int64_t>(), 0);
  plain.augment = true;
  EXPECT_FALSE(torch::equal(make_batch(*dataset_, {{0, 3}, {0, 4}}, {{1, 2}, {2, 0}}, plain).person, batch.person));
  // The landmarks project into the window, where the person is.
  const auto dofs = fixture_->motion("training").frames[3];
  for (const auto& p : landmark_positions(fixture_->character.skeleton, dataset_->landmarks(), dofs)) {
    const auto seen = batch.person_projection[0][0].matmul(torch::tensor({p.x(), p.y(), p.z(), 1.0}, torch::kFloat32));
    for (int k = 0; k < 2; ++k) {
      const float pixel = (seen[k] / seen[2]).item<float>();
      EXPECT_GT(pixel, 32 * 0.1);
      EXPECT_LT(pixel, 32 * 0.9);
    }
  }
  // 20 % of margin on either side of the longer one: a seventh of the window.
  const auto lit = (batch.person[0][0][2] > kBlack[2] + 0.1).any(1).nonzero();
  EXPECT_GT(lit.size(0), 32 / 2);
  EXPECT_LT(lit.size(0), 31);
  // Reddish on black, as the fixture draws the person: the green around is gone.
  const auto lightness = [&](int k) { return (batch.person[0][0][k] - kBlack[k]).sum().item<float>(); };
  EXPECT_GT(batch.person[0][0][0].max().item<float>(), 0.0f);
  EXPECT_LT(lightness(1), 0.6f * lightness(0));
}

TEST_F(PersonBatches, RefuseSizesThatMakeNoSense) {
  for (const int size : {-1, 8, 100000}) {
    LoaderOptions chosen = options(0);
    chosen.person_size = size;
    EXPECT_THROW(Loader(*dataset_, chosen), UsageError) << size;
  }
}

}  // namespace
}  // namespace doppel::person_crop_test
