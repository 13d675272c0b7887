#include "doppel/detect/keypoints/keypoints.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "doppel/detect/keypoints/landmark_key.h"

namespace doppel {

namespace {

constexpr double kReachPerSide = 0.03;

double total_confidence(const Person& person) {
  double sum = 0.0;
  for (const Keypoint& point : person) sum += point.confidence;
  return sum;
}

/// The sum of confidences over points on or near the mask.
double confidence_inside(const Person& person, const cv::Mat& distance, double reach) {
  double sum = 0.0;
  for (const Keypoint& point : person) {
    // Compared before the conversion: a float beyond the range of int has no int.
    const bool inside = point.x >= 0 && point.y >= 0 && point.x < static_cast<float>(distance.cols) &&
                        point.y < static_cast<float>(distance.rows);
    if (!inside) continue;
    if (distance.at<float>(static_cast<int>(point.y), static_cast<int>(point.x)) <= reach) sum += point.confidence;
  }
  return sum;
}

}  // namespace

std::optional<int> PointLayout::find(const std::string& point) const { return find_landmark(points, point); }

int index_of_person(const People& people, const cv::Mat& mask) {
  if (people.size() < 2) return static_cast<int>(people.size()) - 1;
  std::vector<double> scores(people.size(), 0.0);
  const cv::Rect box = mask.empty() ? cv::Rect() : cv::boundingRect(mask);
  if (box.area() > 0) {
    cv::Mat distance;
    cv::distanceTransform(~mask, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    const double reach = kReachPerSide * std::max(box.width, box.height);
    for (std::size_t i = 0; i < people.size(); ++i) scores[i] = confidence_inside(people[i], distance, reach);
  }
  if (*std::max_element(scores.begin(), scores.end()) == 0.0)
    for (std::size_t i = 0; i < people.size(); ++i) scores[i] = total_confidence(people[i]);
  return static_cast<int>(std::max_element(scores.begin(), scores.end()) - scores.begin());
}

std::optional<Person> choose_person(const People& people, const cv::Mat& mask) {
  const int index = index_of_person(people, mask);
  return index < 0 ? std::nullopt : std::optional(people[index]);
}

}  // namespace doppel
