#include "doppel/data/capture/layouts/sequence_files.h"

#include <algorithm>
#include <optional>

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

namespace {

/// How well a sequence's words tell files: all of them stand among those of the files, and perhaps in their order.
/// Nothing if a word is missing.
std::optional<std::pair<std::size_t, bool>> likeness(const SequenceFiles& sequence, const std::string& name,
                                                     const std::set<std::string>& words) {
  if (!std::includes(words.begin(), words.end(), sequence.words.begin(), sequence.words.end())) return std::nullopt;
  return std::pair(sequence.words.size(), ("_" + name + "_").find("_" + sequence.name + "_") != std::string::npos);
}

/// The words that are no numbers.
std::set<std::string> letters_of(const std::set<std::string>& words) {
  std::set<std::string> letters;
  for (const std::string& word : words)
    if (word.find_first_not_of("0123456789") != std::string::npos) letters.insert(word);
  return letters;
}

/// Whether the files are of another take: their words differ in numbers alone.
bool is_of_another_take(const SequenceFiles& sequence, const SequenceFiles& files) {
  return sequence.words != files.words && letters_of(sequence.words) == letters_of(files.words) &&
         sequence.words.size() == files.words.size();
}

}  // namespace

bool belong_to(std::size_t sequence, const std::vector<SequenceFiles>& filmed, const std::string& name,
               const std::set<std::string>& words) {
  const auto own = likeness(filmed[sequence], name, words);
  return own && std::none_of(filmed.begin(), filmed.end(), [&](const SequenceFiles& other) {
           const auto found = likeness(other, name, words);
           return found && *found > *own;
         });
}

const SequenceFiles* files_of_sequence(std::size_t sequence, const std::vector<SequenceFiles>& filmed,
                                       const SortedFiles& files) {
  if (filmed.size() == 1 && files.sequences.size() == 1 && !is_of_another_take(filmed[0], files.sequences[0]))
    return &files.sequences.front();
  const SequenceFiles* best = nullptr;
  bool ambiguous = false;
  for (const SequenceFiles& other : files.sequences) {
    if (!belong_to(sequence, filmed, other.name, other.words)) continue;
    if (best && other.words.size() > best->words.size()) continue;
    ambiguous = best && other.words.size() == best->words.size();
    best = &other;
  }
  return ambiguous ? nullptr : best;
}

}  // namespace doppel
