#include "doppel/track/refine/surface_flow.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/core/thin_out.h"

namespace doppel {
namespace {

constexpr int kContrast = 64;              // grey levels between backdrop and person, beyond which more do not help
constexpr float kMaxRoundTrip = 1.0F;      // pixels between the start and the end of the flow there and back
constexpr double kSameColour = 24.0;       // grey levels of each channel between a drawing and its film
constexpr int kOutlineBorder = 2;          // pixels at outlines of the drawing that do not count
constexpr int kStructureWindow = 9;        // pixels, side of the window of the gradients
constexpr double kNoise = 3.0;             // grey levels per pixel: gradients below say nothing of a position
constexpr float kVertexTolerance = 0.01F;  // metres that a visible vertex may lie behind the drawn surface

cv::Mat grey_of(const cv::Mat& colour) {
  cv::Mat grey;
  cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

/// The grey level that differs most from those of the person, so that the outline shows.
int backdrop_for(const cv::Mat& grey, const cv::Mat& inside) {
  cv::Mat histogram;
  cv::calcHist(std::vector<cv::Mat>{grey}, {0}, inside, histogram, {256}, {0.0F, 256.0F});
  int best = 0;
  double highest = -1.0;
  for (int level = 0; level < 256; ++level) {
    double contrast = 0.0;
    for (int g = 0; g < 256; ++g)
      contrast += static_cast<double>(histogram.at<float>(g)) * std::min(std::abs(g - level), kContrast);
    if (contrast <= highest) continue;
    highest = contrast;
    best = level;
  }
  return best;
}

/// Each pixel of a grid plus its flow, for cv::remap.
cv::Mat targets_of(const cv::Mat& flow) {
  cv::Mat targets(flow.size(), CV_32FC2);
  for (int y = 0; y < flow.rows; ++y)
    for (int x = 0; x < flow.cols; ++x)
      targets.at<cv::Vec2f>(y, x) = flow.at<cv::Vec2f>(y, x) + cv::Vec2f(static_cast<float>(x), static_cast<float>(y));
  return targets;
}

/// 255 where the flow there and back ends near its start.
cv::Mat round_trips(const cv::Mat& there, const cv::Mat& back, const cv::Mat& targets) {
  cv::Mat returned;
  cv::remap(back, returned, targets, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar::all(1e4));
  cv::Mat good(there.size(), CV_8U);
  for (int y = 0; y < good.rows; ++y)
    for (int x = 0; x < good.cols; ++x) {
      const cv::Vec2f rest = there.at<cv::Vec2f>(y, x) + returned.at<cv::Vec2f>(y, x);
      good.at<std::uint8_t>(y, x) = rest.dot(rest) <= kMaxRoundTrip * kMaxRoundTrip ? 255 : 0;
    }
  return good;
}

/// 255 where the film has the colour of the drawing. Without texture the flow back may lead elsewhere, which does no
/// harm there.
cv::Mat same_colours(const cv::Mat& drawing, const cv::Mat& film, const cv::Mat& targets) {
  cv::Mat moved, difference;
  cv::remap(film, moved, targets, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  cv::absdiff(moved, drawing, difference);
  cv::Mat same;
  cv::inRange(difference, cv::Scalar::all(0), cv::Scalar::all(kSameColour), same);
  return same;
}

/// Mean products of the gradients around each pixel.
cv::Mat structure_of(const cv::Mat& grey) {
  cv::Mat x, y, structure;
  cv::Sobel(grey, x, CV_32F, 1, 0, 3, 1.0 / 8.0);
  cv::Sobel(grey, y, CV_32F, 0, 1, 3, 1.0 / 8.0);
  cv::merge(std::vector<cv::Mat>{x.mul(x), x.mul(y), y.mul(y)}, structure);
  cv::boxFilter(structure, structure, -1, {kStructureWindow, kStructureWindow});
  return structure;
}

/// With the structure M: the root of M (M + noise I)^-1.
Eigen::Matrix2d sureness_of(const cv::Vec3f& structure) {
  Eigen::Matrix2d matrix;
  matrix << structure[0], structure[1], structure[1], structure[2];
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(matrix);
  const Eigen::Vector2d strength = solver.eigenvalues().cwiseMax(0.0);
  const Eigen::Vector2d share = (strength.array() / (strength.array() + kNoise * kNoise)).sqrt();
  return solver.eigenvectors() * share.asDiagonal() * solver.eigenvectors().transpose();
}

}  // namespace

FlowFinder::FlowFinder(double finest_width)
    : finest_width_(finest_width), flow_(cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_FAST)) {}

SurfaceFlow FlowFinder::find(const DrawnSurface& drawn, const cv::Mat& image, const cv::Mat& mask) {
  SurfaceFlow result;
  result.box = drawn.box;
  if (drawn.empty()) return result;
  const cv::Mat film = image(drawn.box);
  const cv::Mat person = mask.empty() ? cv::Mat(film.size(), CV_8U, cv::Scalar(255)) : mask(drawn.box);
  cv::Mat drawing = grey_of(drawn.colour), filmed = grey_of(film);
  const int backdrop = backdrop_for(drawing, drawn.covered);
  drawing.setTo(backdrop, drawn.covered == 0);
  filmed.setTo(backdrop, person == 0);
  cv::Mat back;
  flow_->setFinestScale(std::max(0, static_cast<int>(std::lround(std::log2(image.cols / finest_width_)))));
  flow_->calc(drawing, filmed, result.flow);
  flow_->calc(filmed, drawing, back);
  const cv::Mat targets = targets_of(result.flow);
  cv::Mat inner, seen;
  cv::erode(drawn.covered, inner, cv::Mat::ones(2 * kOutlineBorder + 1, 2 * kOutlineBorder + 1, CV_8U));
  cv::remap(person, seen, targets, cv::noArray(), cv::INTER_NEAREST, cv::BORDER_CONSTANT);
  result.sure =
      (round_trips(result.flow, back, targets) | same_colours(drawn.colour, film, targets)) & inner & (seen > 0);
  result.structure = structure_of(drawing);
  return result;
}

AlignedFilm align_film(const SurfaceFlow& flow, const cv::Mat& image) {
  AlignedFilm aligned{cv::Mat(image.size(), image.type(), cv::Scalar::all(0)),
                      cv::Mat(image.size(), CV_8U, cv::Scalar(0))};
  if (flow.empty()) return aligned;
  cv::Mat moved;
  cv::remap(image(flow.box), moved, targets_of(flow.flow), cv::noArray(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  moved.copyTo(aligned.image(flow.box));
  flow.sure.copyTo(aligned.mask(flow.box));
  return aligned;
}

std::vector<SurfaceMatch> surface_matches(const SurfaceFlow& flow, const DrawnSurface& drawn,
                                          const std::vector<Eigen::Vector3d>& vertices, const PinholeCamera& camera,
                                          int number, int most) {
  std::vector<SurfaceMatch> matches;
  if (flow.empty()) return matches;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const double depth = camera.camera_from_world(vertices[v]).z();
    if (depth <= 0.0) continue;
    const Eigen::Vector2d pixel = camera.project(vertices[v]);
    const cv::Point at(cvFloor(pixel.x()) - flow.box.x, cvFloor(pixel.y()) - flow.box.y);
    if (!cv::Rect({0, 0}, flow.box.size()).contains(at) || flow.sure.at<std::uint8_t>(at) == 0) continue;
    if (depth > static_cast<double>(drawn.depth.at<float>(at) + kVertexTolerance)) continue;
    const cv::Vec2f moved = flow.flow.at<cv::Vec2f>(at);
    matches.push_back({number, static_cast<int>(v), pixel + Eigen::Vector2d(moved[0], moved[1]),
                       sureness_of(flow.structure.at<cv::Vec3f>(at))});
  }
  thin_out(matches, most);
  return matches;
}

}  // namespace doppel
