#include "doppel/eval/flicker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/progress.h"
#include "doppel/core/tensor/image_tensor.h"
#include "doppel/data/dataset/batch_builder.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"

namespace doppel {

namespace {

constexpr float kSameDepth = 0.015f;  // metres
constexpr int kInset = 2;             // pixels

/// The surface points of all pixels as they were in the earlier frame. Pixels without a surface take face 0.
/// @param drawn of the later frame @return [S*S,3]
torch::Tensor earlier_points(const FramePair& pair, const RasterImage& drawn) {
  const torch::Tensor face = drawn.face_id[0].flatten().clamp_min(0).to(torch::kInt64);
  const torch::Tensor corners = pair.faces.to(torch::kInt64).index_select(0, face);
  const torch::Tensor positions = pair.vertices[0].index_select(0, corners.flatten()).view({-1, 3, 3});
  return (positions * drawn.barycentrics[0].view({-1, 3, 1})).sum(1);
}

/// Whether the four pixels around (x, y) have this depth. @param depth CV_32FC1; x, y of a first pixel at (0, 0)
bool shows_depth(const cv::Mat& depth, float x, float y, float z) {
  const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(std::floor(y));
  if (!(x >= 0 && y >= 0) || left + 1 >= depth.cols || top + 1 >= depth.rows) return false;
  for (const int row : {top, top + 1})
    for (const int column : {left, left + 1})
      if (!(std::abs(depth.at<float>(row, column) - z) < kSameDepth)) return false;
  return true;
}

/// The pixels at least kInset pixels inside of both masks. @param a, b 0: outside
cv::Mat well_inside(const cv::Mat& a, const cv::Mat& b) {
  const cv::Mat both = (a != 0) & (b != 0);
  const cv::Mat kernel = cv::Mat::ones(2 * kInset + 1, 2 * kInset + 1, CV_8UC1);
  cv::Mat result;
  cv::erode(both, result, kernel, {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar::all(0));
  return result;
}

/// What both frames of a pair show, the earlier one first.
struct PairImages {
  std::array<cv::Mat, 2> drawn, filmed, inside;  ///< RGB, RGB, 255 well inside of drawing and mask
  FramePair pair;
};

/// Draws and reads pairs of frames of one camera.
class PairReader {
 public:
  PairReader(const Dataset& dataset, const torch::Tensor& faces, const ImageFunction& render)
      : dataset_(dataset), faces_(faces), render_(render) {}

  /// @param samples the earlier frame and the later one @param vertices [2,N,3] of both
  /// @return nothing where a frame does not show the person
  std::optional<PairImages> read(const std::vector<SampleId>& samples, const torch::Tensor& vertices,
                                 int camera) const {
    std::vector<int> sides;
    for (const SampleId& sample : samples) sides.push_back(dataset_.crop_box(sample, camera).side);
    if (sides[0] == 0 || sides[1] == 0) return std::nullopt;
    BatchOptions wanted;
    wanted.past_frames = 0;
    wanted.images = true;
    const Batch batch = make_batch(dataset_, samples, {{camera}, {camera}}, wanted);
    const RenderedImages images = render_({samples, camera, batch.image_projection, dataset_.image_size(), sides});
    const std::int64_t S = dataset_.image_size();
    const torch::Tensor colour = eight_bit_colours(images.colour).view({2, S, S, 3});
    const torch::Tensor covered = images.covered.ne(0).to(torch::kUInt8).contiguous().view({2, S, S});
    PairImages result{{}, {}, {}, {faces_, vertices, batch.image_projection.select(1, 0), static_cast<int>(S)}};
    for (int i = 0; i < 2; ++i) {
      result.drawn[i] = image_view(colour[i]).clone();
      result.filmed[i] = image_view(batch.image[i][0]).clone();
      result.inside[i] = well_inside(image_view(batch.image_mask[i][0]), image_view(covered[i]));
    }
    return result;
  }

 private:
  const Dataset& dataset_;
  torch::Tensor faces_;
  const ImageFunction& render_;
};

}  // namespace

SurfaceFlow surface_flow(const FramePair& pair) {
  Rasterizer rasterizer(pair.faces);
  const RasterImage& drawn =
      rasterizer.rasterize_projected(pair.vertices, pair.projection.unsqueeze(1), pair.size, pair.size);
  const torch::Tensor points = earlier_points(
      pair, {drawn.face_id.narrow(0, 1, 1), drawn.depth.narrow(0, 1, 1), drawn.barycentrics.narrow(0, 1, 1)});
  const torch::Tensor homogeneous =
      at::matmul(points, pair.projection[0].narrow(1, 0, 3).t()) + pair.projection[0].select(1, 3);
  const torch::Tensor depth = homogeneous.select(1, 2);
  const torch::Tensor positions = (homogeneous.narrow(1, 0, 2) / depth.unsqueeze(1) - 0.5).contiguous();
  const torch::Tensor earlier_depth = drawn.depth[0].contiguous(), face = drawn.face_id[1].contiguous();

  SurfaceFlow flow{image_view(positions.view({pair.size, pair.size, 2})).clone(),
                   cv::Mat::zeros(pair.size, pair.size, CV_8UC1)};
  const cv::Mat before = image_view(earlier_depth);
  const float* z = depth.contiguous().data_ptr<float>();
  for (int row = 0; row < pair.size; ++row)
    for (int column = 0; column < pair.size; ++column) {
      const cv::Vec2f position = flow.map.at<cv::Vec2f>(row, column);
      const bool seen = face.data_ptr<int>()[row * pair.size + column] >= 0;
      if (seen && shows_depth(before, position[0], position[1], z[row * pair.size + column]))
        flow.visible.at<std::uint8_t>(row, column) = 255;
    }
  return flow;
}

double ColourChange::root_mean_square() const {
  return pixels > 0 ? std::sqrt(sum / (3.0 * static_cast<double>(pixels))) : 0.0;
}

ColourChange& ColourChange::operator+=(const ColourChange& other) {
  sum += other.sum;
  pixels += other.pixels;
  return *this;
}

ColourChange colour_change(const SurfaceFlow& flow, const cv::Mat& earlier, const cv::Mat& later,
                           const cv::Mat& where) {
  cv::Mat from, to, carried;
  earlier.convertTo(from, CV_32FC3);
  later.convertTo(to, CV_32FC3);
  cv::remap(from, carried, flow.map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  const cv::Mat compared = flow.visible & (where != 0);
  const int pixels = cv::countNonZero(compared);
  if (pixels == 0) return {};
  const double norm = cv::norm(carried, to, cv::NORM_L2, compared);
  return {norm * norm, pixels};
}

nlohmann::ordered_json FlickerResult::to_json() const {
  if (drawn.pixels == 0) return nlohmann::ordered_json::object();
  return {{"flicker", drawn.root_mean_square()}, {"filmed_flicker", filmed.root_mean_square()}};
}

namespace {

void add_flicker(const PairImages& seen, FlickerResult& result) {
  const SurfaceFlow flow = surface_flow(seen.pair);
  cv::Mat where;  // inside in the later frame, and the four pixels of the earlier one that are read
  cv::remap(seen.inside[0], where, flow.map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  where = (where == 255) & seen.inside[1];
  result.drawn += colour_change(flow, seen.drawn[0], seen.drawn[1], where);
  result.filmed += colour_change(flow, seen.filmed[0], seen.filmed[1], where);
}

/// Whether the frame before is of the same segment.
bool follows_a_frame(const Dataset& dataset, const SampleId& later) {
  const DatasetSequence& sequence = dataset.sequences().at(as_size(later.sequence));
  return later.frame > std::max(sequence.first_frame, sequence.segment_start(later.frame));
}

}  // namespace

bool has_flicker(const Dataset& dataset, Split split, const EvaluationOptions& options) {
  const std::vector<int> cameras = dataset.camera_indices(options.cameras);
  for (const SampleId& later : evaluated_samples(dataset, split, options))
    if (follows_a_frame(dataset, later))
      for (const int camera : cameras)
        if (dataset.crop_box(later, camera).side > 0 &&
            dataset.crop_box({later.sequence, later.frame - 1}, camera).side > 0)
          return true;
  return false;
}

FlickerResult evaluate_flicker(const Dataset& dataset, Split split, const torch::Tensor& faces,
                               const SurfaceFunction& surface, const ImageFunction& render,
                               const EvaluationOptions& options, const std::string& title) {
  torch::NoGradGuard no_grad;
  const std::vector<int> cameras = dataset.camera_indices(options.cameras);
  const std::vector<SampleId> samples = evaluated_samples(dataset, split, options);
  const PairReader reader(dataset, faces, render);
  FlickerResult result;
  Progress progress(title, static_cast<std::int64_t>(samples.size() * cameras.size()));
  for (const SampleId& later : samples) {
    if (follows_a_frame(dataset, later)) {
      const std::vector<SampleId> both{{later.sequence, later.frame - 1}, later};
      const torch::Tensor vertices = surface(both);
      for (const int camera : cameras)
        if (const auto seen = reader.read(both, vertices, camera)) add_flicker(*seen, result);
    }
    progress.advance(static_cast<std::int64_t>(cameras.size()));
  }
  if (result.drawn.pixels == 0)
    log::warn("{}: no two consecutive frames of the {} split show the person; the figures are left out", title,
              to_string(split));
  return result;
}

}  // namespace doppel
