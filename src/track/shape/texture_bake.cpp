#include "doppel/track/shape/texture_bake.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "doppel/core/error.h"
#include "doppel/core/tensor/image_tensor.h"
#include "doppel/geometry/decompositions.h"
#include "doppel/geometry/topology.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/projection.h"

namespace doppel {
namespace {

using torch::Tensor;

constexpr double kPower = 6.0;              // of the cosine in the weight of a view
constexpr float kDepthTolerance = 0.02F;    // metres that a texel may lie behind the surface of its pixel
constexpr int kBorder = 2;                  // pixels around outlines that do not count
constexpr float kSolidWeight = 0.02F;       // weight from which a texel counts as fully seen
constexpr double kDetailPower = 16.0;       // of the sharpness in the weight of a view's details
constexpr double kUsualSharpness = 500.0;   // pixels per metre; keeps powers of sharpness in the range of float
constexpr double kDetailBlur = 6.0 / 1024;  // of the texture's side: wavelengths below about six times this are details
constexpr int kGainStride = 2;              // texels: every second row and column decides the gains

/// [1,3,T,T] as an image of three channels, which owns its pixels.
cv::Mat image_of_map(const Tensor& map) { return image_view(map[0].permute({1, 2, 0}).contiguous()).clone(); }

/// The smallest depth around each pixel, so that points beside the outline of a nearer part count as hidden; 0 beside
/// the background, whose colour must not reach the surface.
cv::Mat nearest_depth(Rasterizer& rasterizer, const Tensor& surface, const PinholeCamera& camera) {
  const Tensor projection = projection_tensor({camera}).unsqueeze(0);
  const RasterImage& drawn = rasterizer.rasterize_projected(surface, projection, camera.height, camera.width);
  const cv::Mat depth(camera.height, camera.width, CV_32F, drawn.depth.data_ptr<float>());
  const cv::Mat window = cv::Mat::ones(2 * kBorder + 1, 2 * kBorder + 1, CV_8U);
  cv::Mat nearest, farthest;
  cv::erode(depth, nearest, window);
  cv::dilate(depth, farthest, window);
  nearest.setTo(0, farthest == std::numeric_limits<float>::infinity());
  return nearest;
}

/// Where the texels lie in the image of a camera.
struct TexelViews {
  cv::Mat u, v;       ///< CV_32F pixels, for cv::remap
  cv::Mat weight;     ///< CV_32F, 0 where the texel is hidden or faces away
  cv::Mat sharpness;  ///< CV_32F, pixels that a metre of the surface takes, foreshortened, over kUsualSharpness
};

TexelViews look_at(const cv::Mat& positions, const cv::Mat& normals, const cv::Mat& inside, const cv::Mat& nearest,
                   const PinholeCamera& camera) {
  TexelViews views{cv::Mat(positions.size(), CV_32F, cv::Scalar(-1)), cv::Mat(positions.size(), CV_32F, cv::Scalar(-1)),
                   cv::Mat(positions.size(), CV_32F, cv::Scalar(0)), cv::Mat(positions.size(), CV_32F, cv::Scalar(0))};
  const Eigen::Vector3d centre = camera.centre();
  for (int y = 0; y < positions.rows; ++y)
    for (int x = 0; x < positions.cols; ++x) {
      const cv::Vec3f &p = positions.at<cv::Vec3f>(y, x), &n = normals.at<cv::Vec3f>(y, x);
      const Eigen::Vector3d point(p[0], p[1], p[2]), to_camera = (centre - point).normalized();
      const double facing = to_camera.dot(Eigen::Vector3d(n[0], n[1], n[2]));
      if (inside.at<std::uint8_t>(y, x) == 0 || facing <= 0.0) continue;
      const Eigen::Vector3d local = camera.R * point + camera.t;
      if (local.z() <= 0.0) continue;
      const Eigen::Vector2d pixel = camera.project(point);
      const int column = cvFloor(pixel.x()), row = cvFloor(pixel.y());
      if (column < 0 || row < 0 || column >= camera.width || row >= camera.height) continue;
      if (local.z() > nearest.at<float>(row, column) + kDepthTolerance) continue;
      views.u.at<float>(y, x) = static_cast<float>(pixel.x() - 0.5);
      views.v.at<float>(y, x) = static_cast<float>(pixel.y() - 0.5);
      views.weight.at<float>(y, x) = static_cast<float>(std::pow(facing, kPower));
      views.sharpness.at<float>(y, x) = static_cast<float>(facing * camera.K(1, 1) / (local.z() * kUsualSharpness));
    }
  return views;
}

/// What two cameras saw of the texels that both see: weighted sums of their colours.
struct CommonTexels {
  double weight = 0.0;
  cv::Vec3d first{0, 0, 0}, second{0, 0, 0};
};

/// The logarithms of the gains of one channel, [C]: least squares over the pairs of
/// (g_a + log o_a - g_b - log o_b)^2, with the mean 0. A camera without common texels keeps about 0.
Eigen::VectorXd solve_gains(int count, const std::map<std::pair<int, int>, CommonTexels>& pairs, int channel) {
  constexpr double kStay = 1e-3;  // weight of 0, relative to the mean weight of a pair
  double total = 0.0;
  for (const auto& [cameras, common] : pairs) total += common.weight;
  const double stay = kStay * std::max(total, 1.0) / std::max<double>(1.0, static_cast<double>(pairs.size()));
  Eigen::MatrixXd matrix = stay * Eigen::MatrixXd::Identity(count, count);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
  for (const auto& [cameras, common] : pairs) {
    const auto [a, b] = cameras;
    if (common.first[channel] <= 0.0 || common.second[channel] <= 0.0) continue;
    const double ratio = std::log(common.second[channel] / common.first[channel]);
    matrix(a, a) += common.weight;
    matrix(b, b) += common.weight;
    matrix(a, b) -= common.weight;
    matrix(b, a) -= common.weight;
    right[a] += common.weight * ratio;
    right[b] -= common.weight * ratio;
  }
  Eigen::VectorXd gains = solve_symmetric(matrix, right);
  gains.array() -= gains.mean();
  return gains;
}

/// Values of vertices that are known where `weight` is not 0: minimises the squared differences over edges, and the
/// weighted squared distances from the known values. A part of the mesh without any gets the mean.
/// @param sum [N,3] weighted sums @param weight [N] @return [N,3]
Eigen::MatrixXd harmonic(const MeshTopology& topology, const Eigen::MatrixXd& sum, const Eigen::VectorXd& weight) {
  constexpr double kKnown = 100.0, kFree = 1e-6;  // of known values and of the mean, beside 1 for each edge
  const auto n = static_cast<int>(weight.size());
  const Eigen::RowVectorXd mean = sum.colwise().sum() / weight.sum();
  Eigen::MatrixXd right(n, sum.cols());
  std::vector<Eigen::Triplet<double>> entries;
  for (int v = 0; v < n; ++v) {
    right.row(v) = kKnown * sum.row(v) + kFree * mean;
    entries.emplace_back(v, v, kKnown * weight[v] + kFree);
  }
  for (const auto& [a, b] : topology.edges()) {
    entries.emplace_back(a, a, 1.0);
    entries.emplace_back(b, b, 1.0);
    entries.emplace_back(a, b, -1.0);
    entries.emplace_back(b, a, -1.0);
  }
  Eigen::SparseMatrix<double> matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(matrix).solve(right);
}

/// Each channel times `weight`.
cv::Mat weighted(const cv::Mat& colour, const cv::Mat& weight) {
  cv::Mat weights;
  cv::merge(std::vector<cv::Mat>(3, weight), weights);
  return colour.mul(weights);
}

/// The blurred texels; those without weight do not count.
cv::Mat low_frequencies(const cv::Mat& colour, const cv::Mat& weight) {
  cv::Mat seen, sum, share;
  cv::Mat(weight > 0).convertTo(seen, CV_32F, 1.0 / 255.0);
  const double blur = kDetailBlur * colour.cols;
  cv::GaussianBlur(weighted(colour, seen), sum, {}, blur);
  cv::GaussianBlur(seen, share, {}, blur);
  return weighted(sum, 1.0 / cv::max(share, 1e-6F));
}

}  // namespace

void TextureBake::Sum::add(const cv::Mat& added, const cv::Mat& added_weight) {
  colour += weighted(added, added_weight);
  weight += added_weight;
}

cv::Mat TextureBake::Sum::mean() const { return weighted(colour, 1.0 / cv::max(weight, 1e-12F)); }

TextureBake::TextureBake(const TriangleMesh& mesh, int size)
    : mesh_(mesh), space_(mesh, size), rasterizer_(RenderMesh(mesh).faces), detail_(size) {}

void TextureBake::add(const std::vector<Eigen::Vector3d>& vertices, const PinholeCamera& camera, int number,
                      const cv::Mat& image, const cv::Mat& mask) {
  const torch::NoGradGuard no_grad;
  const Tensor surface = vertex_tensor(vertices);
  const cv::Mat inside(space_.size(), space_.size(), CV_8U, space_.mask().data_ptr<bool>());
  TexelViews views = look_at(image_of_map(space_.positions(surface)), image_of_map(space_.normals(surface)), inside,
                             nearest_depth(rasterizer_, surface, camera), camera);
  if (!mask.empty()) {
    cv::Mat safe, shown;
    cv::erode(mask, safe, cv::Mat::ones(2 * kBorder + 1, 2 * kBorder + 1, CV_8U));
    cv::remap(safe, shown, views.u, views.v, cv::INTER_NEAREST, cv::BORDER_CONSTANT);
    views.weight.setTo(0, shown == 0);
  }
  cv::Mat colour;
  cv::remap(image, colour, views.u, views.v, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  colour.convertTo(colour, CV_32FC3);
  const cv::Mat low = low_frequencies(colour, views.weight);
  cameras_.try_emplace(number, Sum(space_.size())).first->second.add(low, views.weight);
  cv::Mat sharpest;
  cv::pow(views.sharpness, kDetailPower, sharpest);
  sharpest.setTo(0, views.weight == 0);
  detail_.add(colour - low, sharpest);
}

cv::Mat TextureBake::seen_weight() const {
  cv::Mat weight = cv::Mat::zeros(space_.size(), space_.size(), CV_32F);
  for (const auto& [number, sum] : cameras_) weight += sum.weight;
  return weight;
}

double TextureBake::coverage() const {
  const cv::Mat inside(space_.size(), space_.size(), CV_8U, space_.mask().data_ptr<bool>());
  return static_cast<double>(cv::countNonZero(seen_weight() > 0)) / std::max(1, cv::countNonZero(inside));
}

std::map<int, cv::Vec3d> TextureBake::gains() const {
  std::vector<const Sum*> sums;
  for (const auto& [number, sum] : cameras_) sums.push_back(&sum);
  const int count = static_cast<int>(sums.size());
  std::map<std::pair<int, int>, CommonTexels> pairs;
  for (int y = 0; y < space_.size(); y += kGainStride)
    for (int x = 0; x < space_.size(); x += kGainStride)
      for (int a = 0; a < count; ++a) {
        const float first = sums[a]->weight.at<float>(y, x);
        for (int b = a + 1; first >= kSolidWeight && b < count; ++b) {
          const float second = sums[b]->weight.at<float>(y, x);
          if (second < kSolidWeight) continue;
          CommonTexels& common = pairs[{a, b}];
          const double share = first * second / (first + second);
          common.weight += share;
          common.first += share / first * cv::Vec3d(sums[a]->colour.at<cv::Vec3f>(y, x));
          common.second += share / second * cv::Vec3d(sums[b]->colour.at<cv::Vec3f>(y, x));
        }
      }
  std::map<int, cv::Vec3d> gains;
  for (int channel = 0; channel < 3; ++channel) {
    const Eigen::VectorXd found = solve_gains(count, pairs, channel);
    int c = 0;
    for (const auto& [number, sum] : cameras_) gains[number][channel] = std::exp(found[c++]);
  }
  return gains;
}

cv::Mat TextureBake::corrected_sum(const std::map<int, cv::Vec3d>& gains) const {
  cv::Mat sum = cv::Mat::zeros(space_.size(), space_.size(), CV_32FC3);
  for (const auto& [number, camera] : cameras_) {
    cv::Mat corrected;
    cv::multiply(camera.colour, cv::Scalar(gains.at(number)), corrected);
    sum += corrected;
  }
  return sum;
}

cv::Mat TextureBake::texture() const {
  const cv::Mat weight = seen_weight();
  if (cv::countNonZero(weight > 0) == 0)
    fail("no image shows the surface, so there is no texture; do the masks and the poses fit the images?");
  cv::Mat weights, colour;
  cv::merge(std::vector<cv::Mat>(3, cv::max(weight, 1e-6F)), weights);
  cv::divide(corrected_sum(gains()), weights, colour);
  const cv::Mat behind = spread_colours(colour, weight);
  colour += detail_.mean();
  cv::Mat result(colour.size(), CV_8UC3);
  for (int y = 0; y < colour.rows; ++y)
    for (int x = 0; x < colour.cols; ++x) {
      const float share = std::min(1.0F, weight.at<float>(y, x) / kSolidWeight);
      const cv::Vec3f mixed = share * colour.at<cv::Vec3f>(y, x) + (1 - share) * behind.at<cv::Vec3f>(y, x);
      for (int k = 0; k < 3; ++k) result.at<cv::Vec3b>(y, x)[k] = cv::saturate_cast<std::uint8_t>(mixed[k]);
    }
  return result;
}

/// The colours of the vertices from the texels at their corners; those of hidden vertices are harmonic over the mesh.
/// @return CV_32FC3, these colours interpolated over all texels
cv::Mat TextureBake::spread_colours(const cv::Mat& colour, const cv::Mat& weight) const {
  const int n = mesh_.num_vertices();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(n, 3);
  Eigen::VectorXd seen = Eigen::VectorXd::Zero(n);
  for (std::size_t f = 0; f < mesh_.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector2d uv = mesh_.uvs[mesh_.face_uvs[f][k]];
      const int x = std::clamp(cvFloor(uv.x() * colour.cols), 0, colour.cols - 1),
                y = std::clamp(cvFloor((1 - uv.y()) * colour.rows), 0, colour.rows - 1);
      const double share = weight.at<float>(y, x);
      const int vertex = mesh_.faces[f][k];
      seen[vertex] += share;
      for (int c = 0; c < 3; ++c) sum(vertex, c) += share * colour.at<cv::Vec3f>(y, x)[c];
    }
  const Eigen::MatrixXd spread = harmonic(MeshTopology(mesh_), sum, seen);
  Tensor values = torch::empty({1, n, 3});
  for (int v = 0; v < n; ++v)
    for (int c = 0; c < 3; ++c) values.data_ptr<float>()[3 * v + c] = static_cast<float>(spread(v, c));
  return image_of_map(space_.positions(values));
}

}  // namespace doppel
