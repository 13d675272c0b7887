#include "calibrate_rig.h"

#include <algorithm>

#include "doppel/capture/capture_layouts.h"
#include "doppel/capture/filmed_sequence.h"
#include "doppel/capture/person_tracks.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"

namespace doppel::tools {

namespace {

constexpr double kLeastConfidence = 0.1;

}  // namespace

RigFootage open_rig_footage(const std::filesystem::path& path, const std::string& sequence) {
  RigFootage footage;
  footage.capture = find_capture(path);
  const std::vector<SequenceEntry>& all = footage.capture.sequences;
  if (all.empty()) fail("{} has no sequences", path.string());
  const auto found = std::find_if(all.begin(), all.end(), [&](const SequenceEntry& entry) {
    return sequence.empty() ? !entry.keypoints.empty() : entry.name == sequence;
  });
  if (found == all.end() && !sequence.empty()) {
    std::string names;
    for (const SequenceEntry& entry : all) names += (names.empty() ? "" : ", ") + entry.name;
    fail<UsageError>("{} has no sequence {}; its sequences are {}", path.string(), sequence, names);
  }
  footage.sequence = found == all.end() ? 0 : as_size(found - all.begin());
  footage.filmed = filmed_cameras(footage.capture);
  return footage;
}

void read_tracks(RigFootage& footage) {
  footage.tracks = read_tracks_of_rough_rig(footage.capture, footage.entry(), footage.filmed);
  drop_unusable(footage.tracks, kLeastConfidence);
}

std::filesystem::path folder_of(const Capture& capture) {
  return capture.file.empty() ? capture.root : capture.file.parent_path();
}

}  // namespace doppel::tools
