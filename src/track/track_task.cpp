#include "doppel/track/track_task.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"

namespace doppel {

namespace fs = std::filesystem;

std::vector<FootageSequence> chosen_sequences(const Footage& footage, const TrackTask& task) {
  std::vector<FootageSequence> chosen;
  std::vector<std::string> known;
  for (FootageSequence sequence : footage.sequences()) {
    known.push_back(sequence.name);
    const auto& wanted = task.sequences;
    if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), sequence.name) == wanted.end()) continue;
    if (task.limit_frames > 0)
      sequence.last_frame = std::min(sequence.last_frame, sequence.first_frame + task.limit_frames - 1);
    chosen.push_back(std::move(sequence));
  }
  if (!task.sequences.empty() && chosen.size() != task.sequences.size())
    fail<UsageError>("not all of the sequences {} are in the capture; it has {}", fmt::join(task.sequences, ", "),
                     fmt::join(known, ", "));
  return own_units(chosen, task);
}

long count_frames(const std::vector<FootageSequence>& sequences) {
  long total = 0;
  for (const FootageSequence& sequence : sequences) total += sequence.num_frames();
  return total;
}

std::vector<long> spread_frames(const FootageSequence& sequence, int count) {
  std::vector<long> frames;
  for (int i = 0; i < count; ++i) {
    const long frame = sequence.first_frame + (2 * i + 1) * sequence.num_frames() / (2 * count);
    if (frames.empty() || frame != frames.back()) frames.push_back(frame);
  }
  return frames;
}

void require_masks(const Footage& footage, const std::vector<FootageSequence>& sequences, const std::string& method) {
  for (const FootageSequence& sequence : sequences)
    if (!sequence.has_masks) footage.capture().sequences[sequence.index].require_masks(method);
}

void warn_without_masks(const std::vector<FootageSequence>& sequences) {
  std::vector<std::string> names;
  for (const FootageSequence& sequence : sequences)
    if (!sequence.has_masks) names.push_back(sequence.name);
  if (!names.empty())
    log::warn(
        "no masks in {}: the pose is fitted to the keypoints alone, without silhouette and contour terms; name "
        "`masks`, or a way to compute them (docs/capture.md), for a pose that follows the outline too",
        fmt::join(names, ", "));
}

std::string tracked_method(const fs::path& folder) {
  const fs::path file = folder / "track.json";
  if (!fs::exists(file)) return "";
  const auto report = nlohmann::json::parse(read_file(file), nullptr, false);
  return report.is_object() && report.contains("method") && report["method"].is_string()
             ? report["method"].get<std::string>()
             : "";
}

void check_tracked_method(const fs::path& folder, const std::string& method) {
  const std::string before = tracked_method(folder);
  if (!before.empty() && before != method)
    fail<UsageError>("{} holds the tracking of the method {}, and this is {}; choose another folder with --out",
                     folder.string(), before, method);
}

void open_out_folder(const Footage& footage, const fs::path& out, const std::string& method) {
  if (out.empty()) fail<UsageError>("no output folder was given");
  const fs::path& file = footage.capture().file;
  if (!file.empty() && fs::weakly_canonical(out / "capture.yaml") == fs::weakly_canonical(file))
    fail<UsageError>("{} holds the capture itself; choose another folder with --out", out.string());
  check_tracked_method(out, method);
  if (tracked_method(out).empty()) check_capture_out(out / "capture.yaml");
  fs::create_directories(out);
}

void check_one_camera(const Footage& footage) {
  if (footage.cameras().size() == 1) return;
  std::vector<std::string> names;
  for (const PinholeCamera& camera : footage.cameras()) names.push_back(camera.name);
  fail<UsageError>("this method uses one camera, and the capture has {}; choose one of {} with --camera", names.size(),
                   fmt::join(names, ", "));
}

void check_not_stopped(const FootageSequence& sequence, long frame) {
  if (stop_requested()) fail("stopped at frame {} of sequence {}", frame, sequence.name);
}

}  // namespace doppel
