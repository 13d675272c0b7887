#include "detect_network.h"

#include <map>

#include "detect_masks.h"
#include "doppel/core/error.h"
#include "doppel/detect/keypoints/keypoint_map.h"
#include "doppel/detect/keypoints/keypoint_table.h"
#include "doppel/detect/networks/network_config.h"
#include "doppel/geometry/image_file.h"

namespace doppel::tools {

namespace {

Person person_of(const DetectNetwork& chosen, const PersonFinding& found) {
  if (found.points.size() != chosen.layout.points.size())
    fail("{}: the network finds a mask and no points; leave out --layout", chosen.options.network.model.string());
  Person person;
  for (const NetworkPoint& point : found.points)
    person.push_back({static_cast<float>(point.position.x()), static_cast<float>(point.position.y()),
                      static_cast<float>(point.score)});
  return person;
}

double mean_confidence(const std::map<long, People>& frames) {
  double sum = 0.0;
  long count = 0;
  for (const auto& [frame, people] : frames)
    for (const Person& person : people)
      for (const Keypoint& point : person) {
        sum += point.confidence;
        ++count;
      }
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

}  // namespace

DetectNetwork choose_network(const std::string& model, const std::string& config, const std::string& layout,
                             bool masks) {
  DetectNetwork chosen;
  if (!config.empty()) chosen.options = load_person_network(config);
  if (!model.empty()) chosen.options.network.model = model;
  if (chosen.options.network.model.empty())
    fail<UsageError>("--config {} names no `model`; give the network's file with --network", config);
  if (!layout.empty()) chosen.layout = read_keypoint_map(layout).layout;
  if (masks && !layout.empty() && !chosen.options.mask)
    fail<UsageError>(
        "--masks: {} finds points; name a network for masks in the section `mask` of --config (docs/detect.md)",
        chosen.options.network.model.string());
  if (!masks) chosen.options.mask.reset();
  return chosen;
}

std::optional<DetectReport> detect_camera_with(const DetectNetwork& chosen, PersonNetwork& network,
                                               const DetectSource& source, const DetectFiles& files,
                                               std::optional<Eigen::Vector2d> person,
                                               const std::function<bool()>& advance) {
  const auto images = open_frames(source.images, PixelFormat::colour);
  network.restart(person);
  std::map<long, People> frames;
  DetectReport report;
  for (const long frame : source.frames) {
    const cv::Mat image = images->read(frame);
    const std::optional<PersonFinding> found = network.find(image);
    ++report.frames;
    report.with_person += found.has_value();
    People& people = frames[frame];
    if (found && !files.keypoints.empty()) people.push_back(person_of(chosen, *found));
    if (!files.masks.empty())
      write_image(mask_file(files.masks, frame), found ? found->mask : cv::Mat(image.size(), CV_8U, cv::Scalar(0)));
    if (!advance()) return std::nullopt;
  }
  report.mean_confidence = mean_confidence(frames);
  if (!files.keypoints.empty()) write_keypoint_table(files.keypoints, chosen.layout, frames);
  return report;
}

}  // namespace doppel::tools
