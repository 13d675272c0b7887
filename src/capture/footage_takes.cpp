#include "doppel/capture/footage_takes.h"

#include <algorithm>

#include "doppel/capture/file_roles.h"

namespace doppel {

std::map<int, std::string> Take::paths() const {
  std::map<int, std::string> paths;
  for (const auto& [camera, stream] : by_camera) paths[camera] = stream.path;
  return paths;
}

std::size_t Takes::most_cameras() const {
  std::size_t most = 0;
  for (const Take& take : takes) most = std::max(most, take.by_camera.size());
  return most;
}

Takes find_takes(const std::vector<FileStream>& streams, const std::vector<std::string>& cameras) {
  std::vector<std::string> stems;
  for (const FileStream& stream : streams) stems.push_back(stream.stem());
  const CameraMatch match = match_cameras(stems, cameras);
  Takes result;
  result.way = match.way;
  std::map<std::string, std::size_t> index;
  for (std::size_t i = 0; i < streams.size(); ++i) {
    if (!match.camera[i]) {
      result.unmatched.push_back(streams[i].path);
      continue;
    }
    const auto [found, is_new] = index.try_emplace(match.take[i], result.takes.size());
    if (is_new) result.takes.push_back({take_name(match.take[i]), take_words(match.take[i]), {}});
    if (!result.takes[found->second].by_camera.try_emplace(*match.camera[i], streams[i]).second)
      result.unmatched.push_back(streams[i].path);
  }
  return result;
}

const Take* take_of_sequence(const Take& sequence, const Takes& takes, bool only) {
  if (only && takes.takes.size() == 1) return &takes.takes.front();
  const Take* best = nullptr;
  bool ambiguous = false;
  for (const Take& take : takes.takes) {
    if (!std::includes(take.words.begin(), take.words.end(), sequence.words.begin(), sequence.words.end())) continue;
    if (best && take.words.size() > best->words.size()) continue;
    ambiguous = best && take.words.size() == best->words.size();
    best = &take;
  }
  return ambiguous ? nullptr : best;
}

}  // namespace doppel
