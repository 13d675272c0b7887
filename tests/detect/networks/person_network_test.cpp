#include "doppel/detect/networks/person_network.h"

#include <gmock/gmock.h>

#include "detect/networks/small_networks.h"
#include "doppel/core/error.h"
#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::person_network_test {
namespace {

using namespace test_networks;
using support::message_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
using Vec = Eigen::Vector2d;

constexpr double kExact = 0.1;  ///< pixels
constexpr int kWidth = 48, kHeight = 64;

/// Rows of boxes around the centres of colours: centre -+ half, and a score.
std::string box_net(const std::vector<int>& colours, const std::vector<double>& scores, Vec half) {
  std::vector<LinearOutput> outputs;
  std::vector<int> mass;
  for (std::size_t i = 0; i < colours.size(); ++i) {
    const int c = colours[i];
    // centre_net divides by the brightness b: (sum c x - half b) / b.
    const auto moved = [c](const LinearOutput& output, double by) {
      return LinearOutput{
          [=](int channel, double x, double y) { return output.weight(channel, x, y) + (channel == c ? by : 0.0); }};
    };
    for (const LinearOutput& output : {moved(x_of(c), -half.x()), moved(y_of(c), -half.y()), moved(x_of(c), half.x()),
                                       moved(y_of(c), half.y()), sum_of(c, scores[i])})
      outputs.push_back(output);
    mass.insert(mass.end(), 5, c);
  }
  return centre_net(64, 64, outputs, mass, {1, static_cast<int>(colours.size()), 5});
}

/// A large image with a person: three dots near each other.
cv::Mat scene(double x, double y) {
  cv::Mat image = black(320, 240);
  add_dot(image, 0, x - 9.3, y - 20.0, 2.5);
  add_dot(image, 1, x, y, 2.5);
  add_dot(image, 2, x + 9.1, y + 20.4, 2.5);
  return image;
}

class People : public ::testing::Test {
 protected:
  People() {
    support::write_bytes(folder_ / "pose.onnx", centres_net(kWidth, kHeight));
    support::write_bytes(folder_ / "boxes.onnx", box_net({1}, {0.9}, {5.0, 8.0}));
  }
  /// The network for boxes sees the whole image at 64x64.
  PersonNetworkOptions options(bool with_boxes = true) const {
    PersonNetworkOptions all;
    all.network.model = folder_ / "pose.onnx";
    all.network.input = {kWidth, kHeight};
    all.crop.emplace();
    if (with_boxes) {
      all.crop->boxes.emplace();
      all.crop->boxes->model = folder_ / "boxes.onnx";
      all.crop->boxes->input = {64, 64};
      all.crop->boxes->letterbox = true;
    }
    return all;
  }
  static void expect_person(const std::optional<PersonFinding>& person, double x, double y) {
    ASSERT_TRUE(person);
    ASSERT_EQ(person->points.size(), 3u);
    const Vec expected[] = {{x - 9.3, y - 20.0}, {x, y}, {x + 9.1, y + 20.4}};
    for (int i = 0; i < 3; ++i)
      EXPECT_LT((person->points[i].position - expected[i]).norm(), kExact)
          << i << ": " << person->points[i].position.transpose() << " for " << expected[i].transpose();
  }
  support::TemporaryFolder folder_;
};

TEST_F(People, CropsOfANetworkForBoxes) {
  // The box is 5 by 8 pixels around the centre at a fifth of the image's size: 50 by 80 pixels.
  PersonNetwork network(options(), 3);
  for (const Vec& at : {Vec(100.0, 90.0), Vec(101.7, 91.2), Vec(103.0, 95.5)})
    expect_person(network.find(scene(at.x(), at.y())), at.x(), at.y());
}

TEST_F(People, TheCropFollowsThePersonWithoutTheBoxes) {
  PersonNetworkOptions all = options();
  cv::Mat image = scene(120.0, 100.0);
  PersonNetwork network(all, 3);
  expect_person(network.find(image), 120.0, 100.0);
  // Another person appears, far away and brighter for the network for boxes: the crop stays.
  cv::Mat both = scene(121.5, 101.0);
  add_dot(both, 1, 280.0, 30.0, 8.0);
  expect_person(network.find(both), 121.5, 101.0);
  // Without tracking, the box is between both.
  all.crop->track = false;
  PersonNetwork anew(all, 3);
  expect_person(anew.find(image), 120.0, 100.0);
  const auto moved = anew.find(both);
  ASSERT_TRUE(moved);
  EXPECT_GT((moved->points[0].position - Vec(112.2, 81.0)).norm(), 5.0);
}

TEST_F(People, WithoutBoxesTheWholeImageComesFirst) {
  PersonNetwork network(options(false), 3);
  // The second look, in the crop around the points of the first one, is exact.
  expect_person(network.find(scene(200.0, 120.0)), 200.0, 120.0);
  expect_person(network.find(scene(203.0, 121.0)), 203.0, 121.0);
}

TEST_F(People, TheNearestBoxToAHint) {
  support::write_bytes(folder_ / "boxes.onnx", box_net({0, 2}, {0.9, 0.7}, {5.0, 8.0}));
  support::write_bytes(folder_ / "pose.onnx",
                       centre_net(kWidth, kHeight, {x_of(0), y_of(0), sum_of(0, 1.0), x_of(2), y_of(2), sum_of(2, 1.0)},
                                  {0, 0, 0, 2, 2, 2}, {1, 2, 3}));
  cv::Mat image = black(320, 240);
  add_dot(image, 0, 60.0, 120.0, 3.0);
  add_dot(image, 2, 250.0, 110.0, 3.0);
  PersonNetwork network(options(), 2);
  const auto best = network.find(image);
  ASSERT_TRUE(best);
  EXPECT_LT((best->points[0].position - Vec(60, 120)).norm(), kExact);
  EXPECT_EQ(best->points[1].score, 0.0) << "red is not in the crop";
  network.restart(Vec(240, 100));
  const auto hinted = network.find(image);
  ASSERT_TRUE(hinted);
  EXPECT_LT((hinted->points[1].position - Vec(250, 110)).norm(), kExact);
  EXPECT_EQ(hinted->points[0].score, 0.0) << "blue is not in the crop";
}

TEST_F(People, NobodyIsFoundWithoutABox) {
  PersonNetwork network(options(), 3);
  EXPECT_FALSE(network.find(black(320, 240)));
  expect_person(network.find(scene(120.0, 100.0)), 120.0, 100.0);
}

TEST_F(People, MasksOfAFurtherNetwork) {
  PersonNetworkOptions all = options();
  support::write_bytes(folder_ / "mask.onnx", class_net(80, 60, 1, {20.0f}, {-6.0f}));
  all.mask.emplace();
  all.mask->model = folder_ / "mask.onnx";
  all.mask->input = {80, 60};
  PersonNetwork network(all, 3);
  const auto person = network.find(scene(120.0, 100.0));
  expect_person(person, 120.0, 100.0);
  ASSERT_EQ(person->mask.size(), cv::Size(320, 240));
  EXPECT_GT(person->mask.at<std::uint8_t>(100, 120), 128);
  EXPECT_LT(person->mask.at<std::uint8_t>(100, 140), 128);
}

TEST_F(People, BoxesInTheFormOfSsd) {
  // Image, class, score, x1, y1, x2, y2: two classes at the same dot; the person's box is around it.
  const auto net = [](double person) {
    const auto box = [](double kind, double half) {
      return std::vector<LinearOutput>{sum_of(1, 0.0),
                                       sum_of(1, kind),
                                       sum_of(1, kind == 15 ? 0.6 : 0.9),
                                       {[=](int c, double x, double) { return c == 1 ? x / 64 - half : 0.0; }},
                                       {[=](int c, double, double y) { return c == 1 ? y / 64 - 2 * half : 0.0; }},
                                       {[=](int c, double x, double) { return c == 1 ? x / 64 + half : 0.0; }},
                                       {[=](int c, double, double y) { return c == 1 ? y / 64 + 2 * half : 0.0; }}};
    };
    std::vector<LinearOutput> rows = box(person, 0.08);
    const std::vector<LinearOutput> other = box(7, 0.4);
    rows.insert(rows.end(), other.begin(), other.end());
    return centre_net(64, 64, rows, std::vector<int>(14, 1), {1, 1, 2, 7});
  };
  support::write_bytes(folder_ / "boxes.onnx", net(15));
  PersonNetworkOptions all = options();
  all.crop->boxes->person = 15;
  PersonNetwork network(all, 3);
  expect_person(network.find(scene(150.0, 120.0)), 150.0, 120.0);
}

TEST_F(People, BoxesInTheFormOfYolox) {
  // Cells of 16 pixels, boxes of 1.5 by 4 cells in their middles: the cell (4, 3) of an image of 128x128.
  support::write_bytes(folder_ / "boxes.onnx", yolox_net(128, 128, 16, 1.5, 4.0));
  support::write_bytes(folder_ / "pose.onnx", heatmap_net(kWidth, kHeight, 1));
  cv::Mat image = black(128, 128);
  image(cv::Rect(64, 48, 16, 16)) = cv::Scalar(255, 0, 0);
  PersonNetworkOptions all = options();
  all.crop->boxes->input = {128, 128};
  all.crop->padding = 1.0;
  all.network.deviation.fill(255.0);
  all.network.refine = PeakRefinement::none;
  PersonNetwork network(all, 3);
  const auto person = network.find(image);
  ASSERT_TRUE(person);
  // The crop is 64 pixels high around (72, 56): one pixel of the input is one of the image. The first blue pixel is the
  // peak of the heatmap.
  EXPECT_LT((person->points[0].position - Vec(64.5, 48.5)).norm(), kExact);
}

TEST_F(People, RefusesWhatCannotBe) {
  PersonNetworkOptions all = options();
  all.network.input = {};
  EXPECT_THAT(message_of<UsageError>([&] { PersonNetwork(all, 3); }),
              AllOf(HasSubstr("pose.onnx"), HasSubstr("input")));
  all = options();
  support::write_bytes(folder_ / "boxes.onnx", heatmap_net(64, 64, 8));
  EXPECT_THAT(message_of<Error>([&] { PersonNetwork(all, 3).find(scene(100, 100)); }),
              AllOf(HasSubstr("boxes.onnx"), HasSubstr("[1, 3, 8, 8]"), HasSubstr("[1, N, 5]")));
  all.crop->boxes->output = OutputKind::yolox;
  EXPECT_THAT(message_of<Error>([&] { PersonNetwork(all, 3).find(scene(100, 100)); }),
              HasSubstr("[1, 84, at least 6]"));
  all = options(false);
  EXPECT_THAT(message_of<UsageError>([&] { PersonNetwork(all, 3).find(cv::Mat(4, 4, CV_8U)); }),
              HasSubstr("8-bit BGR"));
  support::write_bytes(folder_ / "pose.onnx", centres_net(kWidth, kHeight).substr(0, 4000));
  EXPECT_THAT(message_of<Error>([&] { PersonNetwork(all, 3); }),
              AllOf(HasSubstr("pose.onnx"), HasSubstr("cannot read")));
}

TEST(BoxOfPoints, IsAQuarterLargerThanTheyAre) {
  const auto box = box_of_points({{{10, 20}, 0.5}, {{0, 0}, 0.0}, {{30, 100}, 0.9}});
  ASSERT_TRUE(box);
  EXPECT_TRUE(box->low.isApprox(Vec(7.5, 10)));
  EXPECT_TRUE(box->high.isApprox(Vec(32.5, 110)));
  EXPECT_FALSE(box_of_points({{{10, 20}, 0.5}, {{0, 0}, 0.0}}));
}

}  // namespace
}  // namespace doppel::person_network_test
