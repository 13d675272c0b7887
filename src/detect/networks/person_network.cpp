#include "doppel/detect/networks/person_network.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "doppel/core/error.h"
#include "doppel/detect/networks/image_network.h"
#include "doppel/detect/networks/output_choice.h"

namespace doppel {

namespace {

constexpr double kBoxMargin = 1.25;  ///< of the box around points
constexpr int kMinSeenShare = 4;     ///< a tracked person is lost when fewer than one point in four is seen
constexpr int kMaskIsPerson = 128;   ///< probability * 255 of pixels that count for a box
constexpr double kMinBox = 2.0;      ///< pixels

void require_image(const cv::Mat& image) {
  if (image.empty() || image.dims != 2 || image.type() != CV_8UC3)
    fail<UsageError>("finding a person: the image has {}x{} pixels and {} channels of {} bytes; it must be 8-bit BGR",
                     image.cols, image.rows, image.channels(), image.elemSize1());
}

PersonBox whole_box(cv::Size image) { return {Eigen::Vector2d::Zero(), Eigen::Vector2d(image.width, image.height)}; }

/// The part of a box inside of the image. @return nothing when it has less than two pixels
std::optional<PersonBox> inside(const PersonBox& box, cv::Size image) {
  const Eigen::Vector2d end(image.width, image.height);
  const PersonBox part{box.low.cwiseMax(0.0).cwiseMin(end), box.high.cwiseMax(0.0).cwiseMin(end), box.score};
  return part.size().minCoeff() >= kMinBox ? std::optional(part) : std::nullopt;
}

std::optional<PersonBox> box_of_mask(const cv::Mat& mask) {
  const cv::Rect seen = cv::boundingRect(mask >= kMaskIsPerson);
  if (seen.empty()) return std::nullopt;
  return PersonBox{Eigen::Vector2d(seen.x, seen.y), Eigen::Vector2d(seen.br().x, seen.br().y)};
}

}  // namespace

/// A network with the adapter of its outputs, which is chosen when the network first runs.
class NetworkStage {
 public:
  /// @throws as ImageNetwork
  NetworkStage(const NetworkOptions& options, const Wanted& wanted) : network_(options), wanted_(wanted) {}

  const NetworkOptions& options() const { return network_.options(); }

  /// @throws as ImageNetwork::run; Error naming the file when the outputs do not have the form wanted
  NetworkResult run(const cv::Mat& image, const NetworkView& view) {
    const std::vector<NetworkOutput> outputs = network_.run(network_input(image, view, options()));
    try {
      if (!adapter_) adapter_ = choose_adapter(options(), wanted_, outputs, view.input);
      return adapter_->read(outputs, view.input);
    } catch (const Error& e) {
      fail("{}: {}", network_.files(), e.what());
    }
  }

 private:
  ImageNetwork network_;
  Wanted wanted_;
  std::unique_ptr<OutputAdapter> adapter_;
};

std::optional<PersonBox> box_of_points(const std::vector<NetworkPoint>& points) {
  PersonBox box;
  int seen = 0;
  for (const NetworkPoint& point : points) {
    if (!(point.score > 0.0)) continue;
    box.low = seen > 0 ? box.low.cwiseMin(point.position).eval() : point.position;
    box.high = seen > 0 ? box.high.cwiseMax(point.position).eval() : point.position;
    ++seen;
  }
  if (seen < 2) return std::nullopt;
  const Eigen::Vector2d margin = 0.5 * (kBoxMargin - 1.0) * box.size();
  return PersonBox{box.low - margin, box.high + margin};
}

struct PersonNetwork::Impl {
  Impl(const PersonNetworkOptions& all, int points)
      : options(all), num_points(points), person(all.network, {Wanted::What::person, points}) {
    if (all.crop && all.network.input.empty())
      fail<UsageError>("{}: a network for crops of the person needs its `input`: [width, height]",
                       all.network.model.string());
    if (all.crop && all.crop->boxes) boxes.emplace(*all.crop->boxes, Wanted{Wanted::What::boxes});
    if (all.mask) mask.emplace(*all.mask, Wanted{Wanted::What::mask});
  }

  /// Of the boxes in the image the nearest one to the last position, or the best one.
  std::optional<PersonBox> find_box(const cv::Mat& image) {
    if (!boxes) return whole_box(image.size());
    const NetworkView view = whole_view(boxes->options(), image.size());
    std::optional<PersonBox> best;
    const auto distance = [&](const PersonBox& box) { return (box.centre() - *position).norm(); };
    for (const PersonBox& box : boxes->run(image, view).boxes) {
      const PersonBox found{view.image_from_input(box.low), view.image_from_input(box.high), box.score};
      const std::optional<PersonBox> part = inside(found, image.size());
      if (part && (!best || (position && distance(*part) < distance(*best)))) best = part;
    }
    return best;
  }

  NetworkView view_of(const PersonBox& box, cv::Size image) const {
    const bool all = box.low.isZero() && box.high == whole_box(image).high;
    return crop_view(box, all ? 1.0 : options.crop->padding, options.network.input);
  }

  PersonFinding look(const cv::Mat& image, const NetworkView& view) {
    NetworkResult result = person.run(image, view);
    for (NetworkPoint& point : result.points)
      if (point.score > 0.0) point.position = view.image_from_input(point.position);
    PersonFinding found{std::move(result.points), {}};
    if (!result.mask.empty()) found.mask = image_mask(result.mask, view, image.size());
    return found;
  }

  static int count_seen(const PersonFinding& found) {
    return static_cast<int>(std::count_if(found.points.begin(), found.points.end(),
                                          [](const NetworkPoint& point) { return point.score > 0.0; }));
  }

  /// @param share of the points that must be seen: one in `share`
  static bool is_person(const PersonFinding& found, int share) {
    if (found.points.empty()) return !found.mask.empty() && cv::countNonZero(found.mask) > 0;
    const int seen = count_seen(found);
    return seen > 0 && seen * share >= static_cast<int>(found.points.size());
  }

  static std::optional<PersonBox> box_of(const PersonFinding& found, cv::Size image) {
    const std::optional<PersonBox> box = found.points.empty() ? box_of_mask(found.mask) : box_of_points(found.points);
    return box ? inside(*box, image) : std::nullopt;
  }

  /// The person in the crop that follows from the image before. @return nothing when there is none, or it is lost
  std::optional<PersonFinding> follow(const cv::Mat& image) {
    if (!tracked) return std::nullopt;
    PersonFinding found = look(image, view_of(*tracked, image.size()));
    return is_person(found, kMinSeenShare) ? std::optional(std::move(found)) : std::nullopt;
  }

  std::optional<PersonFinding> find_anew(const cv::Mat& image) {
    const std::optional<PersonBox> box = find_box(image);
    if (!box) return std::nullopt;
    PersonFinding found = look(image, view_of(*box, image.size()));
    if (!is_person(found, static_cast<int>(found.points.size()))) return std::nullopt;
    // In the whole image a person is small: look again where the first look found one.
    if (!boxes) {
      tracked = box_of(found, image.size());
      if (auto closer = follow(image)) return closer;
    }
    return found;
  }

  std::optional<PersonFinding> find_in_crop(const cv::Mat& image) {
    std::optional<PersonFinding> found = follow(image);
    if (!found) found = find_anew(image);
    tracked = found ? box_of(*found, image.size()) : std::nullopt;
    if (tracked) position = tracked->centre();
    if (!options.crop->track) tracked.reset();
    return found;
  }

  std::optional<PersonFinding> find_in_whole(const cv::Mat& image) {
    PersonFinding found = look(image, whole_view(options.network, image.size()));
    return is_person(found, num_points) ? std::optional(std::move(found)) : std::nullopt;
  }

  PersonNetworkOptions options;
  int num_points;
  NetworkStage person;
  std::optional<NetworkStage> boxes, mask;
  std::optional<PersonBox> tracked;         ///< where to look next
  std::optional<Eigen::Vector2d> position;  ///< last known, or the user's hint
};

PersonNetwork::PersonNetwork(const PersonNetworkOptions& options, int points)
    : impl_(std::make_unique<Impl>(options, points)) {}
PersonNetwork::~PersonNetwork() = default;
PersonNetwork::PersonNetwork(PersonNetwork&&) noexcept = default;
PersonNetwork& PersonNetwork::operator=(PersonNetwork&&) noexcept = default;

std::optional<PersonFinding> PersonNetwork::find(const cv::Mat& image) {
  require_image(image);
  std::optional<PersonFinding> found = impl_->options.crop ? impl_->find_in_crop(image) : impl_->find_in_whole(image);
  if (found && impl_->mask) {
    const NetworkView view = whole_view(impl_->mask->options(), image.size());
    found->mask = image_mask(impl_->mask->run(image, view).mask, view, image.size());
  }
  return found;
}

void PersonNetwork::restart(std::optional<Eigen::Vector2d> near) {
  impl_->tracked.reset();
  impl_->position = std::move(near);
}

}  // namespace doppel
