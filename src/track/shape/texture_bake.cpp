#include "doppel/track/shape/texture_bake.h"

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "doppel/core/error.h"
#include "doppel/geometry/decompositions.h"
#include "doppel/geometry/image_box.h"
#include "doppel/geometry/topology.h"
#include "doppel/render/mesh/face_tensor.h"
#include "doppel/render/projection.h"
#include "doppel/render/texture/texture_space.h"

namespace doppel {
namespace {

constexpr double kPower = 6.0;              // of the cosine in the weight of a view
constexpr float kDepthTolerance = 0.02F;    // metres that a texel may lie behind the surface of its pixel
constexpr int kBorder = 2;                  // pixels around outlines that do not count
constexpr float kSolidWeight = 0.02F;       // weight from which a texel counts as fully seen
constexpr double kDetailPower = 16.0;       // of the sharpness in the weight of a view's details
constexpr double kUsualSharpness = 500.0;   // pixels per metre; keeps powers of sharpness in the range of float
constexpr double kDetailBlur = 6.0 / 1024;  // of the texture's side: wavelengths below about six times this are details
constexpr double kBlurOfBlocks = 1.5;       // blocks: standard deviation of the blur that removes details, at least
constexpr int kGainStride = 4;              // texels: every fourth decides the gains

/// The window of pixels around an outline that do not count.
cv::Mat border_window() { return cv::Mat::ones(2 * kBorder + 1, 2 * kBorder + 1, CV_8U); }

/// The smallest depth around each pixel, so that points beside the outline of a nearer part count as hidden; 0 beside
/// the background, whose colour must not reach the surface.
/// @param vertices [N] world metres @return CV_32F of the camera's size
cv::Mat nearest_depth(Rasterizer& rasterizer, const std::vector<Eigen::Vector3d>& vertices,
                      const PinholeCamera& camera) {
  const RasterImage& drawn = rasterizer.rasterize_projected(
      vertex_tensor(vertices), projection_tensor({camera}).unsqueeze(0), camera.height, camera.width);
  const cv::Mat depth(camera.height, camera.width, CV_32F, drawn.depth.data_ptr<float>());
  cv::Mat nearest, farthest;
  cv::erode(depth, nearest, border_window());
  cv::dilate(depth, farthest, border_window());
  nearest.setTo(0, farthest == std::numeric_limits<float>::infinity());
  return nearest;
}

/// Depth 0, so that every point is hidden, where the mask's outline is near or nobody is.
void hide_beside(const cv::Mat& mask, cv::Mat& nearest) {
  cv::Mat safe;
  cv::erode(mask, safe, border_window());
  nearest.setTo(0, safe == 0);
}

/// The texels that an image shows. Numbers are those of TextureBake's texels, ascending.
struct SeenTexels {
  std::vector<int> numbers;
  std::vector<float> u, v;    ///< pixels, for cv::remap
  std::vector<float> weight;  ///< of the low frequencies, > 0
  std::vector<float> detail_weight;
};

/// @param vertices [N] world metres @param normals [N] unit length @param nearest CV_32F, depth behind which points are
/// hidden
SeenTexels look_at(const TexelPoints& texels, const std::vector<Eigen::Vector3d>& vertices,
                   const std::vector<Eigen::Vector3d>& normals, const cv::Mat& nearest, const PinholeCamera& camera) {
  SeenTexels seen;
  const Eigen::Vector3d centre = camera.centre();
  const auto* corner = texels.corners.data_ptr<std::int64_t>();
  const auto* share = texels.weights.data_ptr<float>();
  for (int i = 0; i < texels.texel.size(0); ++i, corner += 3, share += 3) {
    const auto blend = [&](const std::vector<Eigen::Vector3d>& values) -> Eigen::Vector3d {
      return share[0] * values[corner[0]] + share[1] * values[corner[1]] + share[2] * values[corner[2]];
    };
    const Eigen::Vector3d point = blend(vertices), normal = blend(normals), to_camera = centre - point;
    const double towards = to_camera.dot(normal);
    if (towards <= 0.0) continue;
    const Eigen::Vector3d local = camera.camera_from_world(point);
    if (local.z() <= 0.0) continue;
    const Eigen::Vector2d pixel = (camera.K * local).hnormalized();
    const int column = cvFloor(pixel.x()), row = cvFloor(pixel.y());
    if (column < 0 || row < 0 || column >= camera.width || row >= camera.height) continue;
    if (local.z() > nearest.at<float>(row, column) + kDepthTolerance) continue;
    const double facing = towards / std::sqrt(to_camera.squaredNorm() * normal.squaredNorm());
    const double sharpness = facing * camera.K(1, 1) / (local.z() * kUsualSharpness);
    seen.numbers.push_back(i);
    seen.u.push_back(static_cast<float>(pixel.x() - 0.5));
    seen.v.push_back(static_cast<float>(pixel.y() - 0.5));
    seen.weight.push_back(static_cast<float>(std::pow(facing, kPower)));
    seen.detail_weight.push_back(static_cast<float>(std::pow(sharpness, kDetailPower)));
  }
  return seen;
}

/// Values of a map at positions in pixels of cv::remap. @return CV_32F of the map's channels, one row for each position
cv::Mat sample(const cv::Mat& map, std::vector<float> u, std::vector<float> v, int interpolation) {
  constexpr std::size_t kColumns = 1024;  // cv::remap takes no side of 32,768 or more
  const std::size_t count = u.size(), rows = (count + kColumns - 1) / kColumns;
  if (count == 0) return {};
  u.resize(rows * kColumns);
  v.resize(rows * kColumns);
  const cv::Size size(kColumns, static_cast<int>(rows));
  cv::Mat sampled, values;
  cv::remap(map, sampled, cv::Mat(size, CV_32F, u.data()), cv::Mat(size, CV_32F, v.data()), interpolation,
            cv::BORDER_REPLICATE);
  sampled.convertTo(values, CV_32F);
  return values.reshape(0, size.area()).rowRange(0, static_cast<int>(count));
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
  constexpr double kKnown = 500.0, kFree = 1e-6;  // of known values and of the mean, beside 1 for each edge
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

/// The colours blurred over the texture; texels that are not seen do not count. The blur is computed for blocks of
/// texels that are small beside it.
/// @param numbers of the texels that have a colour @param colours CV_32FC3, as `sample` returns them @return the same
cv::Mat low_frequencies(const TexelPoints& texels, const std::vector<int>& numbers, const cv::Mat& colours, int size) {
  const double blur = kDetailBlur * size;
  const int side = std::max(1, static_cast<int>(blur / kBlurOfBlocks)), blocks = (size + side - 1) / side;
  cv::Mat sums(blocks, blocks, CV_32FC4, cv::Scalar::all(0));
  const auto* index = texels.texel.data_ptr<std::int64_t>();
  std::vector<float> u, v;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto texel = static_cast<int>(index[numbers[i]]);
    const int row = texel / size, column = texel % size;
    const auto& colour = colours.at<cv::Vec3f>(static_cast<int>(i));
    sums.at<cv::Vec4f>(row / side, column / side) += cv::Vec4f(colour[0], colour[1], colour[2], 1.0F);
    u.push_back((static_cast<float>(column) + 0.5F) / static_cast<float>(side) - 0.5F);
    v.push_back((static_cast<float>(row) + 0.5F) / static_cast<float>(side) - 0.5F);
  }
  cv::GaussianBlur(sums, sums, {}, blur / side);
  const cv::Mat found = sample(sums, std::move(u), std::move(v), cv::INTER_LINEAR);
  cv::Mat low(found.rows, 1, CV_32FC3);
  for (int i = 0; i < found.rows; ++i) {
    const auto& sum = found.at<cv::Vec4f>(i);
    low.at<cv::Vec3f>(i) = cv::Vec3f(sum[0], sum[1], sum[2]) / std::max(sum[3], 1e-6F);
  }
  return low;
}

/// Texels beside a chart take the colour of the nearest texel of the chart, so that look-ups between texels at its edge
/// meet no other colour. @param empty 255 where a texel has no point of the surface, else 0
void pad_charts(cv::Mat& texture, const cv::Mat& empty) {
  constexpr float kPadding = 4.0F;  // texels
  cv::Mat distance, label;
  cv::distanceTransform(empty, distance, label, cv::DIST_L2, cv::DIST_MASK_5, cv::DIST_LABEL_PIXEL);
  const auto pixels = static_cast<int>(empty.total());
  std::vector<cv::Vec3b> colour(pixels + 1);
  for (int i = 0; i < pixels; ++i)
    if (empty.data[i] == 0) colour[label.at<int>(i)] = texture.at<cv::Vec3b>(i);
  for (int i = 0; i < pixels; ++i)
    if (distance.at<float>(i) <= kPadding) texture.at<cv::Vec3b>(i) = colour[label.at<int>(i)];
}

}  // namespace

void TextureBake::Sum::add(int texel, const cv::Vec3f& added, float added_weight) {
  colour[texel] += added_weight * added;
  weight[texel] += added_weight;
}

TextureBake::TextureBake(const TriangleMesh& mesh, int size)
    : mesh_(mesh),
      size_(size),
      texels_(TextureSpace(mesh, size).points()),
      rasterizer_(RenderMesh(mesh).faces),
      detail_(num_texels()) {}

int TextureBake::num_texels() const { return static_cast<int>(texels_.texel.size(0)); }

void TextureBake::add(const std::vector<Eigen::Vector3d>& vertices, const PinholeCamera& camera, int number,
                      const cv::Mat& image, const cv::Mat& mask) {
  const torch::NoGradGuard no_grad;
  Sum& sum = cameras_.try_emplace(number, num_texels()).first->second;
  const cv::Rect box = image_box(vertices, camera, kBorder);
  if (box.empty()) return;
  const PinholeCamera part = camera.cropped(box.x, box.y, 1.0, box.width, box.height);
  cv::Mat nearest = nearest_depth(rasterizer_, vertices, part);
  if (!mask.empty()) hide_beside(mask(box), nearest);
  TriangleMesh posed;
  posed.vertices = vertices;
  posed.faces = mesh_.faces;
  const SeenTexels seen = look_at(texels_, vertices, vertex_normals(posed), nearest, part);
  const cv::Mat colours = sample(image(box), seen.u, seen.v, cv::INTER_CUBIC);
  const cv::Mat low = low_frequencies(texels_, seen.numbers, colours, size_);
  for (std::size_t i = 0; i < seen.numbers.size(); ++i) {
    const auto& blurred = low.at<cv::Vec3f>(static_cast<int>(i));
    sum.add(seen.numbers[i], blurred, seen.weight[i]);
    detail_.add(seen.numbers[i], colours.at<cv::Vec3f>(static_cast<int>(i)) - blurred, seen.detail_weight[i]);
  }
}

double TextureBake::coverage() const {
  int shown = 0;
  for (int i = 0; i < num_texels(); ++i)
    shown += std::any_of(cameras_.begin(), cameras_.end(), [&](const auto& sum) { return sum.second.weight[i] > 0; });
  return static_cast<double>(shown) / std::max(1, num_texels());
}

std::map<int, cv::Vec3d> TextureBake::gains() const {
  std::vector<const Sum*> sums;
  for (const auto& [number, sum] : cameras_) sums.push_back(&sum);
  const int count = static_cast<int>(sums.size());
  std::map<std::pair<int, int>, CommonTexels> pairs;
  for (int i = 0; i < num_texels(); i += kGainStride)
    for (int a = 0; a < count; ++a) {
      const float first = sums[a]->weight[i];
      for (int b = a + 1; first >= kSolidWeight && b < count; ++b) {
        const float second = sums[b]->weight[i];
        if (second < kSolidWeight) continue;
        CommonTexels& common = pairs[{a, b}];
        const double share = first * second / (first + second);
        common.weight += share;
        common.first += share / first * cv::Vec3d(sums[a]->colour[i]);
        common.second += share / second * cv::Vec3d(sums[b]->colour[i]);
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

/// What all cameras saw, with their gains.
TextureBake::Sum TextureBake::evened_sum() const {
  Sum evened(num_texels());
  const std::map<int, cv::Vec3d> gain = gains();
  for (const auto& [number, sum] : cameras_)
    for (int i = 0; i < num_texels(); ++i) {
      evened.colour[i] += sum.colour[i].mul(cv::Vec3f(gain.at(number)));
      evened.weight[i] += sum.weight[i];
    }
  return evened;
}

cv::Mat TextureBake::texture() const {
  const Sum seen = evened_sum();
  if (*std::max_element(seen.weight.begin(), seen.weight.end()) <= 0.0F)
    fail("no image shows the surface, so there is no texture; do the masks and the poses fit the images?");
  const std::vector<cv::Vec3f> behind = spread_colours(seen);
  cv::Mat texture(size_, size_, CV_8UC3, cv::Scalar::all(0)), empty(size_, size_, CV_8U, cv::Scalar(255));
  const auto* texel = texels_.texel.data_ptr<std::int64_t>();
  for (int i = 0; i < num_texels(); ++i) {
    const float share = std::min(1.0F, seen.weight[i] / kSolidWeight);
    const cv::Vec3f mixed = share * (seen.mean(i) + detail_.mean(i)) + (1 - share) * behind[i];
    texture.at<cv::Vec3b>(static_cast<int>(texel[i])) = cv::Vec3b(mixed);
    empty.at<std::uint8_t>(static_cast<int>(texel[i])) = 0;
  }
  pad_charts(texture, empty);
  return texture;
}

/// The colours of the vertices from the texels around them; those of hidden vertices are harmonic over the mesh.
/// @return [texels] these colours, interpolated
std::vector<cv::Vec3f> TextureBake::spread_colours(const Sum& seen) const {
  const int n = mesh_.num_vertices();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(n, 3);
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(n), texels = Eigen::VectorXd::Zero(n);
  const auto* corner = texels_.corners.data_ptr<std::int64_t>();
  const auto* share = texels_.weights.data_ptr<float>();
  for (int i = 0; i < num_texels(); ++i)
    for (int k = 3 * i; k < 3 * i + 3; ++k) {
      for (int c = 0; c < 3; ++c) sum(corner[k], c) += share[k] * seen.colour[i][c];
      weight[corner[k]] += share[k] * seen.weight[i];
      texels[corner[k]] += share[k];
    }
  const Eigen::VectorXd scale = texels.cwiseMax(1e-6).cwiseInverse();
  const Eigen::MatrixXd values = harmonic(MeshTopology(mesh_), scale.asDiagonal() * sum, scale.cwiseProduct(weight));
  std::vector<cv::Vec3f> spread(num_texels(), cv::Vec3f::all(0));
  for (int i = 0; i < num_texels(); ++i)
    for (int k = 3 * i; k < 3 * i + 3; ++k)
      for (int c = 0; c < 3; ++c) spread[i][c] += share[k] * static_cast<float>(values(corner[k], c));
  return spread;
}

}  // namespace doppel
