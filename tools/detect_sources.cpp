#include "detect_sources.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numeric>
#include <set>

#include "doppel/core/error.h"
#include "doppel/core/lower_case.h"
#include "doppel/data/capture/capture_cameras.h"
#include "doppel/data/capture/find_capture.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;

/// The names of the images in a folder, sorted.
std::vector<std::string> images_of(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.is_regular_file() && is_image(entry.path())) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

/// A file name, cut at the digits at the end of its stem.
struct FrameName {
  std::string before, digits, extension;
};

FrameName frame_name(const fs::path& file) {
  const std::string stem = file.stem().string();
  std::size_t begin = stem.size();
  while (begin > 0 && std::isdigit(static_cast<unsigned char>(stem[begin - 1]))) --begin;
  return {stem.substr(0, begin), stem.substr(begin), file.extension().string()};
}

DetectSource source_of_images(const fs::path& folder, const std::vector<std::string>& names) {
  const FrameName first = frame_name(names[0]);
  DetectSource source;
  source.camera = fs::absolute(folder / "x").parent_path().filename().string();
  for (const std::string& name : names) {
    const FrameName parts = frame_name(name);
    if (parts.before != first.before || parts.extension != first.extension || parts.digits.empty() ||
        parts.digits.size() > 18)
      fail<UsageError>("{}: the images must have equal names that end in the frame number; {} and {} do not",
                       folder.string(), names[0], name);
    source.frames.push_back(std::stol(parts.digits));
  }
  std::sort(source.frames.begin(), source.frames.end());
  // Numbers begin with zeros up to the shortest length: 07, 99, 100.
  const std::size_t length =
      std::accumulate(names.begin(), names.end(), first.digits.size(),
                      [](auto least, const auto& name) { return std::min(least, frame_name(name).digits.size()); });
  for (const std::string& name : names)
    if (const std::string digits = frame_name(name).digits; digits.size() > length && digits[0] == '0')
      fail<UsageError>("{}: the numbers of the images must begin with zeros up to one length; that of {} does not",
                       folder.string(), name);
  const std::string number = length > 1 ? fmt::format("{{frame:0{}}}", length) : "{frame}";
  source.images = (folder / (first.before + number + first.extension)).string();
  return source;
}

std::vector<long> range(long first, long last) {
  std::vector<long> numbers(static_cast<std::size_t>(std::max(0L, last - first + 1)));
  std::iota(numbers.begin(), numbers.end(), first);
  return numbers;
}

long last_frame(const std::string& images) { return open_frames(images, PixelFormat::colour)->num_frames(-1) - 1; }

std::vector<DetectSource> sources_of_capture(const fs::path& path) {
  const Capture capture = find_capture(path);
  const CaptureCameras cameras = choose_cameras(capture);
  std::vector<DetectSource> sources;
  for (const SequenceEntry& sequence : capture.sequences) {
    for (std::size_t i = 0; i < cameras.cameras.size(); ++i) {
      const std::string& name = cameras.cameras[i].name;
      const std::string images = capture.source(sequence.videos, cameras.file_index[i], name);
      // Rows between two frames take their keypoints from both.
      const FrameClock clock = capture.clock(sequence, name);
      const long begin = std::max(0L, static_cast<long>(std::floor(clock.time(sequence.first_frame))));
      const long end = last_frame(images);
      const long last =
          sequence.last_frame ? std::min(end, static_cast<long>(std::ceil(clock.time(*sequence.last_frame)))) : end;
      sources.push_back(
          {sequence.name, name, images, range(begin, last), cameras.cameras[i], clock, capture.person_of(sequence)});
      if (sources.back().frames.empty())
        fail("{}: sequence {} begins at frame {} of camera {}, but its images end at frame {}", path.string(),
             sequence.name, begin, name, end);
    }
  }
  return sources;
}

}  // namespace

bool is_image(const fs::path& path) {
  static const std::set<std::string> kExtensions{".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp"};
  return kExtensions.contains(lower_case(path.extension().string()));
}

std::pair<long, long> filmed_rows(const DetectSource& source) {
  const FrameClock& clock = source.clock;
  long begin =
      std::max(0L, static_cast<long>((static_cast<double>(source.frames.front()) - clock.offset) / clock.rate));
  while (begin > 0 && clock.frame(begin - 1) >= source.frames.front()) --begin;
  while (clock.frame(begin) < source.frames.front()) ++begin;
  return {begin, clock.num_rows(source.frames.back() + 1) - 1};
}

std::vector<DetectSource> detect_sources(const fs::path& path) {
  if (!fs::exists(path)) fail<UsageError>("{} does not exist", path.string());
  const bool folder = fs::is_directory(path);
  const std::string extension = path.extension().string();
  if (folder && !fs::exists(path / "capture.yaml")) {
    const std::vector<std::string> names = images_of(path);
    if (!names.empty()) return {source_of_images(path, names)};
  }
  if (folder || extension == ".yaml" || extension == ".yml") return sources_of_capture(path);
  return {{"", path.stem().string(), path.string(), range(0, last_frame(path.string()))}};
}

}  // namespace doppel::tools
