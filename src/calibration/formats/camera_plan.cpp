#include "doppel/calibration/formats/camera_plan.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>

namespace doppel {
namespace {

constexpr int kPlanSide = 640, kPlanMargin = 70;

/// A projection of the world along one axis onto one half of the image.
class PlanView {
 public:
  PlanView(cv::Mat canvas, const std::vector<Camera>& cameras, int down_axis, double down_sign,
           const std::string& title)
      : canvas_(std::move(canvas)), down_axis_(down_axis), down_sign_(down_sign) {
    canvas_.setTo(cv::Scalar::all(250));
    Eigen::Vector2d low = flat({0, 0, 0}), high = low;
    for (const Camera& camera : cameras) {
      low = low.cwiseMin(flat(camera.centre()));
      high = high.cwiseMax(flat(camera.centre()));
    }
    middle_ = 0.5 * (low + high);
    extent_ = std::max((high - low).maxCoeff(), 1e-6);
    draw_grid();
    cv::putText(canvas_, title, {12, 24}, cv::FONT_HERSHEY_SIMPLEX, 0.5, cv::Scalar::all(60), 1, cv::LINE_AA);
  }

  void draw(const Camera& camera) {
    const Eigen::Vector2d from = flat(camera.centre()), along = flat(camera.R.row(2).transpose());
    const cv::Point2d start = pixel(from);
    cv::arrowedLine(canvas_, start, pixel(from + 0.12 * extent_ * along), {180, 90, 20}, 2, cv::LINE_AA, 0, 0.25);
    cv::circle(canvas_, start, 5, {40, 40, 40}, cv::FILLED, cv::LINE_AA);
    cv::putText(canvas_, camera.name, start + cv::Point2d(8, -6), cv::FONT_HERSHEY_SIMPLEX, 0.4, cv::Scalar::all(0), 1,
                cv::LINE_AA);
  }

 private:
  Eigen::Vector2d flat(const Eigen::Vector3d& v) const { return {v.x(), down_sign_ * v[down_axis_]}; }
  cv::Point2d pixel(const Eigen::Vector2d& at) const {
    const double scale = (kPlanSide - 2 * kPlanMargin) / extent_;
    return {0.5 * kPlanSide + scale * (at.x() - middle_.x()), 0.5 * kPlanSide + scale * (at.y() - middle_.y())};
  }
  void draw_grid() {
    const double step = std::pow(10.0, std::floor(std::log10(extent_)));
    for (int axis = 0; axis < 2; ++axis)
      for (double at = std::floor((middle_[axis] - extent_) / step) * step; at < middle_[axis] + extent_; at += step) {
        Eigen::Vector2d a = middle_.array() - extent_, b = middle_.array() + extent_;
        a[axis] = b[axis] = at;
        const double shade = std::abs(at) < 0.5 * step ? 150 : 225;  // the axes through the origin are darker
        cv::line(canvas_, pixel(a), pixel(b), cv::Scalar::all(shade), 1, cv::LINE_AA);
      }
    cv::putText(canvas_, "grid " + cv::format("%g m", step), {12, kPlanSide - 12}, cv::FONT_HERSHEY_SIMPLEX, 0.45,
                cv::Scalar::all(60), 1, cv::LINE_AA);
  }

  cv::Mat canvas_;
  int down_axis_;
  double down_sign_;
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
  double extent_ = 1.0;
};

}  // namespace

cv::Mat draw_camera_plan(const std::vector<Camera>& cameras) {
  cv::Mat image(kPlanSide, 2 * kPlanSide, CV_8UC3);
  PlanView above(image.colRange(0, kPlanSide), cameras, 2, 1.0, "from above: x right, z down");
  PlanView side(image.colRange(kPlanSide, 2 * kPlanSide), cameras, 1, -1.0, "from the side: x right, y up");
  for (const Camera& camera : cameras) {
    above.draw(camera);
    side.draw(camera);
  }
  cv::line(image, {kPlanSide, 0}, {kPlanSide, kPlanSide}, cv::Scalar::all(120));
  return image;
}

}  // namespace doppel
