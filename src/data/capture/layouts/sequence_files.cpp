#include "doppel/data/capture/layouts/sequence_files.h"

#include <algorithm>

#include "doppel/data/capture/layouts/name_words.h"

namespace doppel {

std::map<int, std::string> SequenceFiles::paths() const {
  std::map<int, std::string> paths;
  for (const auto& [camera, stream] : by_camera) paths[camera] = stream.path;
  return paths;
}

std::size_t SortedFiles::most_cameras() const {
  std::size_t most = 0;
  for (const SequenceFiles& sequence : sequences) most = std::max(most, sequence.by_camera.size());
  return most;
}

SortedFiles sort_files(const std::vector<FileStream>& streams, const std::vector<std::string>& cameras) {
  std::vector<std::string> stems;
  stems.reserve(streams.size());
  for (const FileStream& stream : streams) stems.push_back(stream.stem());
  const CameraMatch match = match_cameras(stems, cameras);
  SortedFiles result;
  result.way = match.way;
  std::map<std::string, std::size_t> index;
  for (std::size_t i = 0; i < streams.size(); ++i) {
    if (!match.camera[i]) {
      result.unmatched.push_back(streams[i].path);
      continue;
    }
    const auto [found, is_new] = index.try_emplace(match.sequence[i], result.sequences.size());
    if (is_new) result.sequences.push_back({telling_name(match.sequence[i]), telling_words(match.sequence[i]), {}});
    if (!result.sequences[found->second].by_camera.try_emplace(*match.camera[i], streams[i]).second)
      result.unmatched.push_back(streams[i].path);
  }
  return result;
}

const SequenceFiles* files_of_sequence(const SequenceFiles& sequence, const SortedFiles& files, bool only) {
  if (only && files.sequences.size() == 1) return &files.sequences.front();
  const SequenceFiles* best = nullptr;
  bool ambiguous = false;
  for (const SequenceFiles& other : files.sequences) {
    if (!std::includes(other.words.begin(), other.words.end(), sequence.words.begin(), sequence.words.end())) continue;
    if (best && other.words.size() > best->words.size()) continue;
    ambiguous = best && other.words.size() == best->words.size();
    best = &other;
  }
  return ambiguous ? nullptr : best;
}

}  // namespace doppel
