#include "doppel/rigging/scan/atlas.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel::atlas_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using support::message_of;
using ::testing::Contains;
using ::testing::HasSubstr;

/// A texture that tells its own coordinates: blue is the column, green the row, red the number.
cv::Mat ramp(int width, int height, int number) {
  cv::Mat image(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image.at<cv::Vec3b>(y, x) = {static_cast<uchar>(255 * x / (width - 1)),
                                   static_cast<uchar>(255 * y / (height - 1)), static_cast<uchar>(number)};
  return image;
}

/// A texture that continues itself when it repeats; neighbours differ by 20 at most.
cv::Mat wave(int size) {
  cv::Mat image(size, size, CV_8UC3);
  const auto at = [&](int position) {
    return cv::saturate_cast<uchar>(127.5 + 127.5 * std::sin(2.0 * CV_PI * position / size));
  };
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) image.at<cv::Vec3b>(y, x) = {at(x), at(y), at(x + y)};
  return image;
}

/// A square of two triangles whose UVs run from `low` to `high`.
ScanPart square(const std::string& name, const Vector2d& low, const Vector2d& high, const cv::Mat& texture) {
  ScanPart part;
  part.name = name;
  part.mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  part.mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  part.mesh.uvs = {low, {high.x(), low.y()}, high, {low.x(), high.y()}};
  part.mesh.face_uvs = part.mesh.faces;
  part.mesh.texture = texture;
  return part;
}

Vector3d texel(const cv::Mat& texture, const Vector2d& uv) {
  const int x = std::clamp(static_cast<int>((uv.x() - std::floor(uv.x())) * texture.cols), 0, texture.cols - 1);
  const int y = std::clamp(static_cast<int>((1.0 - (uv.y() - std::floor(uv.y()))) * texture.rows), 0, texture.rows - 1);
  const cv::Vec3b pixel = texture.at<cv::Vec3b>(y, x);
  return {static_cast<double>(pixel[0]), static_cast<double>(pixel[1]), static_cast<double>(pixel[2])};
}

/// The largest difference between a part's own texture and the atlas, over points of its faces.
double largest_difference(const ScanPart& part, const MergedScan& merged, std::size_t p) {
  double worst = 0.0;
  for (int f = 0; f < part.mesh.num_faces(); ++f)
    for (int i = 0; i < 200; ++i) {
      const double a = 0.05 + 0.9 * (i % 14) / 14.0, b = (0.97 - a) * (0.05 + 0.9 * i / 200.0), c = 1.0 - a - b;
      const auto at = [&](const TriangleMesh& mesh, int face) {
        const Triangle& uv = mesh.face_uvs[face];
        return Vector2d(a * mesh.uvs[uv[0]] + b * mesh.uvs[uv[1]] + c * mesh.uvs[uv[2]]);
      };
      worst = std::max(worst, (texel(part.mesh.texture, at(part.mesh, f)) -
                               texel(merged.mesh.texture, at(merged.mesh, merged.first_face[p] + f)))
                                  .cwiseAbs()
                                  .maxCoeff());
    }
  return worst;
}

TEST(Atlas, OneTextureStaysUntouched) {
  const ScanPart part = square("skin", {0, 0}, {1, 1}, ramp(64, 32, 7));
  const MergedScan merged = merge_parts({{part}});
  EXPECT_EQ(cv::norm(merged.mesh.texture, part.mesh.texture, cv::NORM_INF), 0.0);
  EXPECT_EQ(merged.mesh.faces, part.mesh.faces);
  EXPECT_EQ(largest_difference(part, merged, 0), 0.0);
  EXPECT_TRUE(merged.notes.empty());
}

TEST(Atlas, SeveralTexturesKeepTheirPixels) {
  const ScanParts scan{{square("skin", {0, 0}, {1, 1}, ramp(64, 48, 50)),
                        square("coat", {0.1, 0.2}, {0.9, 0.7}, ramp(120, 40, 100)),
                        square("hair", {0, 0}, {1, 1}, ramp(32, 96, 150))}};
  const MergedScan merged = merge_parts(scan);
  EXPECT_EQ(merged.mesh.num_vertices(), 12);
  EXPECT_EQ(merged.first_face, (std::vector<int>{0, 2, 4, 6}));
  EXPECT_THAT(merged.notes, ::testing::Not(Contains(HasSubstr("scaled"))));
  for (std::size_t p = 0; p < 3; ++p) EXPECT_LE(largest_difference(scan.parts[p], merged, p), 8.0) << p;
  for (const Vector2d& uv : merged.mesh.uvs) EXPECT_TRUE((uv.array() >= 0.0).all() && (uv.array() <= 1.0).all());
}

TEST(Atlas, AnIslandInAnotherTileIsMovedBack) {
  const ScanPart part = square("udim", {3.0, -2.0}, {4.0, -1.0}, ramp(64, 64, 9));
  const MergedScan merged = merge_parts({{part}});
  EXPECT_EQ(merged.mesh.texture.cols, 64);
  EXPECT_LE(largest_difference(part, merged, 0), 4.0);
}

TEST(Atlas, RepeatsAreBaked) {
  const ScanPart part = square("cloth", {-0.5, 0.25}, {2.5, 1.5}, wave(40));
  const MergedScan merged = merge_parts({{part}});
  EXPECT_GE(merged.mesh.texture.cols, 3 * 40);
  EXPECT_THAT(merged.notes, Contains(HasSubstr("baked")));
  EXPECT_LE(largest_difference(part, merged, 0), 41.0);  // a pixel along both axes
}

TEST(Atlas, TooManyRepeatsAreBakedCoarsely) {
  const ScanPart part = square("net", {0, 0}, {50, 50}, ramp(64, 64, 9));
  const MergedScan merged = merge_parts({{part}});
  EXPECT_LE(merged.mesh.texture.cols, 10 * 64);
  EXPECT_THAT(merged.notes, Contains(HasSubstr("repeats 50 times")));
}

TEST(Atlas, LargeTexturesAreScaledToFit) {
  const ScanParts scan{
      {square("a", {0, 0}, {1, 1}, ramp(400, 400, 50)), square("b", {0, 0}, {1, 1}, ramp(400, 400, 100))}};
  AtlasOptions options;
  options.largest_size = 256;
  const MergedScan merged = merge_parts(scan, options);
  EXPECT_LE(std::max(merged.mesh.texture.cols, merged.mesh.texture.rows), 256);
  EXPECT_THAT(merged.notes, Contains(HasSubstr("textures were scaled by 0.")));
  for (std::size_t p = 0; p < 2; ++p) EXPECT_LE(largest_difference(scan.parts[p], merged, p), 10.0);
}

TEST(Atlas, PartsWithTheSameImageShareIt) {
  const cv::Mat image = ramp(100, 100, 1);
  const MergedScan merged = merge_parts({{square("a", {0, 0}, {1, 1}, image), square("b", {0, 0}, {1, 1}, image)}});
  EXPECT_EQ(merged.mesh.texture.cols, 100);
}

TEST(Atlas, PlainPartsTakeTheirColour) {
  ScanPart plain = square("button", {0, 0}, {1, 1}, cv::Mat());
  plain.mesh.uvs.clear();
  plain.mesh.face_uvs.clear();
  plain.colour = {1.0, 0.5, 0.0};
  const MergedScan merged = merge_parts({{square("skin", {0, 0}, {1, 1}, ramp(64, 64, 7)), plain}});
  const Vector3d bgr = texel(merged.mesh.texture, merged.mesh.uvs[merged.mesh.face_uvs[3][1]]);
  EXPECT_NEAR(bgr[2], 255.0, 1.0);
  EXPECT_NEAR(bgr[1], 127.5, 1.0);
  EXPECT_NEAR(bgr[0], 0.0, 1.0);
}

TEST(Atlas, WithoutTexturesThereAreColoursPerVertex) {
  ScanPart red = square("red", {0, 0}, {1, 1}, cv::Mat()), blue = red;
  red.colour = {1, 0, 0};
  blue.colour = {0, 0, 1};
  const MergedScan merged = merge_parts({{red, blue}});
  EXPECT_TRUE(merged.mesh.texture.empty());
  ASSERT_EQ(merged.mesh.colours.size(), 8u);
  EXPECT_EQ(merged.mesh.colours[0], Vector3d(1, 0, 0));
  EXPECT_EQ(merged.mesh.colours[7], Vector3d(0, 0, 1));
}

TEST(Atlas, TellsWhatIsWrongWithItsInput) {
  EXPECT_THAT(message_of<UsageError>([] { merge_parts({}); }), HasSubstr("holds no surface"));
  ScanPart broken = square("shirt", {0, 0}, {1, 1}, ramp(16, 16, 1));
  broken.mesh.uvs[2].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message_of<UsageError>([&] { merge_parts({{broken}}); }), HasSubstr("shirt has a texture coordinate"));
}

}  // namespace
}  // namespace doppel::atlas_test
