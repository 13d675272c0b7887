#include "doppel/detect/blazepose/mask_agreement.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <cstdint>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/detect/blazepose/possible_parts.h"
#include "doppel/detect/masks/components.h"

namespace doppel {

namespace {

constexpr int kMinOthers = 2;

struct Ray {
  Eigen::Vector3d origin, direction;  ///< world, direction of length 1
};

std::optional<Ray> ray_of(const Camera& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector3d seen = camera.K.inverse() * pixel.homogeneous();
  const std::optional<Eigen::Vector2d> point = camera.undistorted(seen.hnormalized());
  if (!point) return std::nullopt;
  return Ray{camera.centre(), (camera.R.transpose() * point->homogeneous()).normalized()};
}

/// A camera with a mask that is not black.
struct View {
  std::size_t index;
  const Camera* camera;
  cv::Mat person;  ///< the mask, 0 or 255
  cv::Mat near;    ///< the mask and what is within the tolerance
};

void check(const std::vector<cv::Mat>& masks, std::span<const Camera> cameras, const MaskAgreement& options) {
  if (masks.size() != cameras.size())
    fail<UsageError>("comparing masks: {} masks for {} cameras; expected one for each", masks.size(), cameras.size());
  for (std::size_t i = 0; i < masks.size(); ++i)
    if (!masks[i].empty() &&
        (masks[i].type() != CV_8U || masks[i].size() != cv::Size(cameras[i].width, cameras[i].height)))
      fail<UsageError>("comparing masks: that of camera {} has {}x{} pixels and {} channels; expected {}x{} and 8 bits",
                       cameras[i].name, masks[i].cols, masks[i].rows, masks[i].channels(), cameras[i].width,
                       cameras[i].height);
  const auto is_share = [](double share) { return share > 0 && share <= 1; };
  if (!is_share(options.share) || !is_share(options.possible_share) || options.tolerance < 0 || !(options.step > 0) ||
      !(options.radius > 0))
    fail<UsageError>(
        "comparing masks with shares {} and {}, tolerance {}, step {}, radius {}: shares must be in (0, 1], the "
        "tolerance "
        "0 or more, step and radius positive",
        options.share, options.possible_share, options.tolerance, options.step, options.radius);
}

std::vector<View> views_of(const std::vector<cv::Mat>& masks, std::span<const Camera> cameras, int tolerance) {
  std::vector<View> views;
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * tolerance + 1, 2 * tolerance + 1});
  for (std::size_t i = 0; i < masks.size(); ++i) {
    if (masks[i].empty() || cv::countNonZero(masks[i]) == 0) continue;
    views.push_back({i, &cameras[i], masks[i], {}});
    cv::dilate(masks[i], views.back().near, disc);
  }
  return views;
}

/// The point nearest to the rays through the middles of the masks. Nothing if the rays are parallel.
std::optional<Eigen::Vector3d> middle_of(const std::vector<View>& views) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const View& view : views) {
    const cv::Moments moments = cv::moments(view.near, true);
    const auto ray = ray_of(*view.camera, {moments.m10 / moments.m00 + 0.5, moments.m01 / moments.m00 + 0.5});
    if (!ray) continue;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray->direction * ray->direction.transpose();
    normal += across;
    right += across * ray->origin;
  }
  const Eigen::FullPivLU<Eigen::Matrix3d> solver(normal);
  if (solver.rcond() < 1e-6) return std::nullopt;
  return solver.solve(right);
}

class Agreement {
 public:
  Agreement(const std::vector<View>& views, const Eigen::Vector3d& middle, const MaskAgreement& options)
      : views_(views), middle_(middle), options_(options) {}

  /// The pixels of a view that the others support. @param pixels 0 or 255 @param share of the other views
  /// @param unseen whether pixels count that the others do not have in their images
  cv::Mat supported(const View& view, const cv::Mat& pixels, double share, bool unseen) const {
    cv::Mat result = pixels.clone();
    cv::parallel_for_({0, pixels.rows}, [&](const cv::Range& rows) {
      for (int row = rows.start; row < rows.end; ++row)
        for (int column = 0; column < pixels.cols; ++column)
          if (pixels.at<std::uint8_t>(row, column) != 0 && !supports(view, {column + 0.5, row + 0.5}, share, unseen))
            result.at<std::uint8_t>(row, column) = 0;
    });
    return result;
  }

 private:
  /// Points of the ray are tested from the middle outwards.
  bool supports(const View& view, const Eigen::Vector2d& pixel, double share, bool unseen) const {
    const auto ray = ray_of(*view.camera, pixel);
    if (!ray) return true;
    const double along = ray->direction.dot(middle_ - ray->origin);
    const double across = (ray->origin + along * ray->direction - middle_).norm();
    if (across > options_.radius) return false;
    if (unseen && seen_from(ray->origin + along * ray->direction, view.index).all < kMinOthers) return true;
    const double half = std::sqrt(options_.radius * options_.radius - across * across);
    for (double offset = 0; offset <= half; offset += options_.step)
      for (const double side : {-1.0, 1.0})
        if (along + side * offset > 0 &&
            is_inside(ray->origin + (along + side * offset) * ray->direction, view.index, share))
          return true;
    return false;
  }

  /// How many of the other views have a point in their image, and how many of them on their mask.
  struct Seen {
    int all = 0, on_mask = 0;
  };
  Seen seen_from(const Eigen::Vector3d& point, std::size_t except) const {
    Seen seen;
    for (const View& view : views_) {
      if (view.index == except || view.camera->camera_from_world(point).z() <= 0) continue;
      const Eigen::Vector2d pixel = view.camera->project(point);
      if (!(pixel.x() >= 0) || !(pixel.y() >= 0) || pixel.x() >= view.near.cols || pixel.y() >= view.near.rows)
        continue;
      ++seen.all;
      seen.on_mask += view.near.at<std::uint8_t>(static_cast<int>(pixel.y()), static_cast<int>(pixel.x())) != 0;
    }
    return seen;
  }

  bool is_inside(const Eigen::Vector3d& point, std::size_t except, double share) const {
    const Seen seen = seen_from(point, except);
    return seen.all >= kMinOthers && seen.on_mask >= share * seen.all;
  }

  const std::vector<View>& views_;
  Eigen::Vector3d middle_;
  MaskAgreement options_;
};

/// The person in a view as the others see it too. @param possible 255 where the view may show the person
cv::Mat settled(const Agreement& agreement, const View& view, const cv::Mat& possible, const MaskAgreement& options) {
  const cv::Mat person = agreement.supported(view, view.person, options.share, true);
  if (cv::countNonZero(possible) == 0) return person;
  return components_touching(person | agreement.supported(view, possible, options.possible_share, false), person);
}

}  // namespace

SettledPixels settle_masks(std::vector<cv::Mat>& masks, std::span<const Camera> cameras, const MaskAgreement& options) {
  check(masks, cameras, options);
  std::vector<cv::Mat> possible(masks.size());
  for (std::size_t i = 0; i < masks.size(); ++i) {
    if (masks[i].empty()) continue;
    possible[i] = masks[i] == kPossiblePerson;
    masks[i] = cv::Mat(masks[i] == 255);  // the caller may keep the pixels from before
  }
  const std::vector<View> views = views_of(masks, cameras, options.tolerance);
  const auto middle = views.size() > as_size(kMinOthers) ? middle_of(views) : std::nullopt;
  SettledPixels changes;
  if (!middle) return changes;
  const Agreement agreement(views, *middle, options);
  for (const View& view : views) {
    const cv::Mat mask = settled(agreement, view, possible[view.index], options);
    changes.removed += cv::countNonZero(view.person & ~mask);
    changes.added += cv::countNonZero(mask & ~view.person);
    masks[view.index] = mask;
  }
  return changes;
}

}  // namespace doppel
