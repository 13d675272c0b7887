#include "doppel/data/capture/vertex_labels.h"

#include <gmock/gmock.h>
#include <torch/types.h>

#include <algorithm>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "doppel/core/error.h"
#include "doppel/geometry/topology.h"
#include "doppel/layers/surface.h"
#include "doppel/render/mesh/render_mesh.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"
#include "support/message_of.h"
#include "support/ring_of_cameras.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::vertex_labels_test {
namespace {

namespace fs = std::filesystem;
using support::message_of;
using ::testing::HasSubstr;

constexpr int kSize = 400;

Eigen::Vector3d middle(const std::vector<Eigen::Vector3d>& vertices) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& vertex : vertices) sum += vertex;
  return sum / static_cast<double>(vertices.size());
}

/// The label image of a camera: each pixel has the label of the nearest corner of the face seen there.
cv::Mat draw(const Character& character, const std::vector<Eigen::Vector3d>& vertices, const Camera& camera) {
  torch::Tensor points = torch::empty({1, character.num_vertices(), 3});
  for (int i = 0; i < character.num_vertices(); ++i)
    for (int k = 0; k < 3; ++k) points[0][i][k] = vertices[i][k];
  Rasterizer rasterizer(RenderMesh(character.mesh).faces);
  const RasterImage& image = rasterizer.rasterize_projected(
      points, projection_tensor({PinholeCamera(camera)}).unsqueeze(0), camera.height, camera.width);
  const int* face = image.face_id.data_ptr<int>();
  const float* shares = image.barycentrics.data_ptr<float>();
  cv::Mat labels = cv::Mat::zeros(camera.height, camera.width, CV_8UC1);
  for (int i = 0; i < camera.height * camera.width; ++i) {
    if (face[i] < 0) continue;
    const auto corner = std::max_element(shares + 3 * i, shares + 3 * i + 3) - (shares + 3 * i);
    const int vertex = character.mesh.faces[face[i]][corner];
    labels.data[i] = static_cast<std::uint8_t>(character.labels[vertex]);
  }
  return labels;
}

/// Neighbours of vertices with another label.
std::vector<bool> borders(const Character& character) {
  std::vector<bool> result(character.num_vertices(), false);
  const MeshTopology topology(character.mesh);
  for (const auto& [a, b] : topology.edges())
    if (character.labels[a] != character.labels[b]) result[a] = result[b] = true;
  return result;
}

struct Labelled {
  Character character = make_test_character(5, 16, 60);
  std::vector<Eigen::Vector3d> vertices = character.mesh.vertices;
  std::vector<LabelView> views(int count) const {
    std::vector<LabelView> result;
    for (const Camera& camera : ring_of_cameras(count, kSize, middle(vertices)))
      result.push_back({camera, draw(character, vertices, camera)});
    return result;
  }
  /// Vertices away from the borders of labels whose label is another than the character's.
  int wrong(const std::vector<int>& labels) const {
    const std::vector<bool> border = borders(character);
    int count = 0;
    for (std::size_t i = 0; i < labels.size(); ++i) count += !border[i] && labels[i] != character.labels[i];
    return count;
  }
};

TEST(VertexLabels, AreRecoveredFromARingOfCameras) {
  const Labelled body;
  const VertexLabels found = label_vertices(body.character, body.vertices, body.views(8));
  EXPECT_EQ(body.wrong(found.labels), 0);
  EXPECT_GT(found.voted, body.character.num_vertices() * 9 / 10);
}

TEST(VertexLabels, AreRecoveredInAnotherPose) {
  Labelled body;
  std::vector<double> dofs = body.character.rest_dofs;
  dofs[*body.character.skeleton.find_dof("lean_2")] += 0.5;
  const torch::Tensor posed =
      CharacterSurface(body.character)->skinned(torch::tensor(dofs, torch::kFloat64).unsqueeze(0)).contiguous();
  for (std::size_t i = 0; i < body.vertices.size(); ++i)
    body.vertices[i] = Eigen::Map<const Eigen::Vector3d>(posed.data_ptr<double>() + 3 * i);
  const std::vector<LabelView> views = body.views(8);
  EXPECT_EQ(body.wrong(label_vertices(body.character, body.vertices, views).labels), 0);
  EXPECT_GT(body.wrong(label_vertices(body.character, body.character.mesh.vertices, views).labels), 0);
}

TEST(VertexLabels, OfHiddenVerticesAreTheNearestOnes) {
  const Labelled body;
  const VertexLabels found = label_vertices(body.character, body.vertices, body.views(1));
  EXPECT_LT(found.voted, body.character.num_vertices() * 6 / 10) << "the far side is hidden";
  EXPECT_LT(body.wrong(found.labels), body.character.num_vertices() / 20) << "labels of this body are rings";
}

TEST(VertexLabels, MajorityDecides) {
  const Labelled body;
  std::vector<LabelView> views = body.views(8);
  const VertexLabels right = label_vertices(body.character, body.vertices, views);
  views[3].labels.setTo(6, views[3].labels > 0);
  const VertexLabels found = label_vertices(body.character, body.vertices, views);
  int changed = 0;
  for (std::size_t i = 0; i < found.labels.size(); ++i) changed += found.labels[i] != right.labels[i];
  EXPECT_LT(changed, body.character.num_vertices() / 50) << "a vertex is seen by three others and more";
}

TEST(VertexLabels, ThePixelIsThatOfTheLens) {
  const Labelled body;
  std::vector<LabelView> views = body.views(8);
  for (LabelView& view : views) {
    view.camera.distortion = {-0.25, 0.05};
    cv::Mat bent = cv::Mat::zeros(view.labels.size(), CV_8UC1);
    // Pixel by pixel backwards: where the straight image's pixel comes to lie.
    Camera straight = view.camera;
    straight.distortion = {};
    for (int row = 0; row < kSize; ++row)
      for (int column = 0; column < kSize; ++column) {
        const Eigen::Vector3d ray = straight.K.inverse() * Eigen::Vector3d(column + 0.5, row + 0.5, 1.0);
        const Eigen::Vector2d at = view.camera.project(straight.R.transpose() * (ray - straight.t));
        if (at.x() >= 0.0 && at.y() >= 0.0 && at.x() < kSize && at.y() < kSize)
          bent.at<std::uint8_t>(static_cast<int>(at.y()), static_cast<int>(at.x())) =
              view.labels.at<std::uint8_t>(row, column);
      }
    view.labels = bent;
  }
  EXPECT_EQ(body.wrong(label_vertices(body.character, body.vertices, views).labels), 0);
}

TEST(VertexLabels, SomethingMustBeSeen) {
  const Labelled body;
  EXPECT_THAT(message_of<Error>([&] { label_vertices(body.character, body.vertices, {}); }),
              HasSubstr("no vertex is visible on a label in any of 0 images"));
  std::vector<LabelView> views = body.views(2);
  for (LabelView& view : views) view.labels.setTo(0);
  EXPECT_THROW(label_vertices(body.character, body.vertices, views), Error);
  EXPECT_THROW(label_vertices(body.character, {}, views), Error);
}

class LabelFiles : public ::testing::Test {
 protected:
  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_.path() / name) << text;
    return folder_.path() / name;
  }
  std::string complaint(const std::string& legend) const {
    const fs::path path = write("legend.yaml", legend);
    return message_of<FileError>([&] { LabelLegend::read(path); });
  }
  support::TemporaryFolder folder_;
};

TEST_F(LabelFiles, LegendsMapColoursAndGreyValues) {
  const fs::path path = write("legend.yaml", "background: 0\r\nface: [0, 0, 255]\r\nskirt: 200\r\n");
  const LabelLegend legend = LabelLegend::read(path);
  cv::Mat image(1, 3, CV_8UC3, cv::Scalar(0, 0, 0));
  image.at<cv::Vec3b>(0, 1) = {255, 0, 0};
  image.at<cv::Vec3b>(0, 2) = {200, 200, 200};
  const cv::Mat labels = legend.labels(image, "image.png");
  EXPECT_EQ(std::vector<int>(labels.begin<std::uint8_t>(), labels.end<std::uint8_t>()), (std::vector<int>{0, 13, 12}));
  image.at<cv::Vec3b>(0, 1) = {254, 0, 3};
  EXPECT_THAT(message_of<FileError>([&] { legend.labels(image, "image.png"); }),
              HasSubstr("image.png: pixel (1, 0) has the colour (red 3, green 0, blue 254)"));
  const cv::Mat plain(1, 2, CV_8UC1, cv::Scalar(9));
  EXPECT_EQ(LabelLegend().labels(plain, "image.png").at<std::uint8_t>(0, 0), 9);
  EXPECT_THROW(LabelLegend().labels(cv::Mat(1, 2, CV_8UC1, cv::Scalar(21)), "image.png"), FileError);
  EXPECT_THAT(message_of<FileError>([&] { LabelLegend().labels(cv::Mat(1, 2, CV_16UC1, cv::Scalar(9)), "deep.png"); }),
              HasSubstr("this one has 16"));
}

TEST_F(LabelFiles, LegendsSayWhatIsWrong) {
  EXPECT_THAT(complaint("trousers: 9\n"), HasSubstr("legend.yaml:1"));
  EXPECT_THAT(complaint("pant: 9\n"), HasSubstr("pants"));
  EXPECT_THAT(complaint("pants: [1, 2]\n"), HasSubstr("grey value or [red, green, blue]"));
  EXPECT_THAT(complaint("pants: 300\n"), HasSubstr("0 to 255"));
  EXPECT_THAT(complaint("pants: green\n"), HasSubstr("pants"));
  EXPECT_THAT(complaint("face: 3\nskirt: [3, 3, 3]\n"), HasSubstr("every label needs its own"));
  EXPECT_THAT(complaint(""), HasSubstr("names no label"));
  EXPECT_THAT(complaint("- 1\n"), HasSubstr("legend.yaml"));
}

TEST_F(LabelFiles, ImagesBelongToCameras) {
  const auto ring = ring_of_cameras(3, 40, {0.0, 0.5, 0.0});
  const std::vector<Camera> cameras(ring.begin(), ring.end());
  const auto complaint = [&] {
    return message_of<Error>([&] { read_label_views(folder_.path(), cameras, LabelLegend()); });
  };
  EXPECT_THAT(complaint(), HasSubstr("the names of the cameras (c0, c1, c2)"));
  EXPECT_THAT(message_of<Error>([&] { read_label_views(folder_.path() / "none", cameras, LabelLegend()); }),
              HasSubstr("is no folder"));
  cv::imwrite((folder_.path() / "c1.png").string(), cv::Mat(20, 20, CV_8UC1, cv::Scalar(5)));
  const std::vector<LabelView> views = read_label_views(folder_.path(), cameras, LabelLegend());
  ASSERT_EQ(views.size(), 1u);
  EXPECT_EQ(views[0].camera.name, "c1");
  EXPECT_EQ(views[0].camera.width, 20) << "half the size of the calibration";
  EXPECT_EQ(views[0].labels.at<std::uint8_t>(3, 3), 5);
  cv::imwrite((folder_.path() / "c2.png").string(), cv::Mat(20, 40, CV_8UC1, cv::Scalar(5)));
  EXPECT_THAT(complaint(), HasSubstr("another aspect ratio"));
  write("c2.png", "not an image");
  EXPECT_THAT(complaint(), HasSubstr("not an image that OpenCV can decode"));
  fs::remove(folder_.path() / "c2.png");
  write("c7.png", "");
  EXPECT_THAT(complaint(), HasSubstr("belongs to no camera; the calibration has c0, c1, c2"));
}

}  // namespace
}  // namespace doppel::vertex_labels_test
