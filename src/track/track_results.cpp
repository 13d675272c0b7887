#include "doppel/track/track_results.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/track/track_curves.h"

namespace doppel {

namespace fs = std::filesystem;

using nlohmann::ordered_json;

namespace {

constexpr char kReport[] = "track.json", kSections[] = "curves.json";
constexpr char kWrittenByTrack[] = "Written by `doppel track`: the capture with the tracked motions.";

/// The capture with the tracked motions instead of its own.
Capture tracked_capture(const Footage& footage, const fs::path& out, const std::vector<FootageSequence>& tracked,
                        const fs::path& character = {}) {
  Capture capture = footage.capture();
  if (!character.empty()) capture.character = fs::absolute(character).lexically_normal().string();
  for (SequenceEntry& entry : capture.sequences)
    for (const FootageSequence& sequence : tracked) {
      if (sequence.name != entry.name) continue;
      const fs::path motion = fs::absolute(out / (entry.name + ".motion")).lexically_normal();
      const fs::path inside = motion.lexically_relative(capture.root);
      entry.motion = inside.empty() || *inside.begin() == ".." ? motion.string() : inside.string();
      entry.first_frame = sequence.first_frame;
      entry.last_frame = sequence.last_frame;
      std::erase_if(entry.cuts, [&](long cut) { return cut > sequence.last_frame; });
    }
  const auto untracked = [](const SequenceEntry& entry) { return entry.motion.empty(); };
  capture.sequences.erase(std::remove_if(capture.sequences.begin(), capture.sequences.end(), untracked),
                          capture.sequences.end());
  return capture;
}

/// The sections of track.html by sequence.
void write_sections(const fs::path& out, const TrackReport& report) {
  ordered_json sections = ordered_json::object();
  for (const SequenceReport& sequence : report.sequences)
    sections[sequence.tracked.sequence.name] = track_section(out, sequence);
  write_atomically(out / kSections, sections.dump() + "\n");
}

ordered_json read_json(const fs::path& path) {
  try {
    return ordered_json::parse(read_file(path));
  } catch (const ordered_json::exception& e) {
    fail_at({path.string(), 0}, "it is not a file of a shard ({}); track this shard again", e.what());
  }
}

/// Copies the files of a shard's sequences: all but its reports.
void copy_sequences(const fs::path& shard, const fs::path& out) {
  const std::set<std::string> reports{"shard.json", kReport, kSections};
  for (const auto& entry : fs::directory_iterator(shard))
    if (entry.is_regular_file() && !reports.contains(entry.path().filename().string()))
      fs::copy_file(entry.path(), out / entry.path().filename());
}

}  // namespace

void write_results(const Footage& footage, const TrackTask& task, const TrackReport& report) {
  const fs::path& out = task.out;
  write_atomically(out / kReport, to_json(report).dump(1) + "\n");
  if (task.shard) return write_sections(out, report);
  std::vector<FootageSequence> tracked;
  for (const SequenceReport& sequence : report.sequences) {
    tracked.push_back(sequence.tracked.sequence);
    // Those of an earlier run are of other poses.
    if (sequence.tracked.vertices.empty()) fs::remove(out / (sequence.tracked.sequence.name + "_vertices.npy"));
  }
  write_capture(out / "capture.yaml", tracked_capture(footage, out, tracked, report.character), {kWrittenByTrack});
  write_atomically(out / "track.html", track_curves(out, report));
}

std::vector<fs::path> merge_sequences(const std::vector<std::string>& names, const fs::path& out,
                                      const std::vector<fs::path>& shards) {
  std::vector<ordered_json> reports;
  for (const fs::path& shard : shards) reports.push_back(read_json(shard / kReport));
  ordered_json merged = reports.at(0);
  merged["sequences"] = ordered_json::object();
  std::vector<fs::path> folders;
  for (std::size_t k = 0; k < names.size(); ++k) {
    folders.push_back(shards[k % shards.size()]);
    const ordered_json& report = reports[k % shards.size()];
    if (!report.contains("sequences") || !report["sequences"].contains(names[k]))
      fail_at({(folders.back() / kReport).string(), 0}, "the sequence {} is missing; track this shard again", names[k]);
    merged["sequences"][names[k]] = report["sequences"][names[k]];
  }
  fs::create_directories(out);
  for (const fs::path& shard : shards) copy_sequences(shard, out);
  write_atomically(out / kReport, merged.dump(1) + "\n");
  return folders;
}

void merge_tracks(const Footage& footage, const TrackTask& task, const std::vector<fs::path>& shards) {
  open_out_folder(footage, task.out, shards.empty() ? "" : tracked_method(shards.front()));
  const std::vector<FootageSequence> chosen = chosen_sequences(footage, task);
  std::vector<std::string> names, sections;
  for (const FootageSequence& sequence : chosen) names.push_back(sequence.name);
  const std::vector<fs::path> folders = merge_sequences(names, task.out, shards);
  for (std::size_t k = 0; k < names.size(); ++k) {
    const ordered_json own = read_json(folders[k] / kSections);
    if (!own.contains(names[k]) || !own[names[k]].is_string())
      fail_at({(folders[k] / kSections).string(), 0}, "the sequence {} is missing; track this shard again", names[k]);
    sections.push_back(own[names[k]].get<std::string>());
  }
  write_capture(task.out / "capture.yaml", tracked_capture(footage, task.out, chosen), {kWrittenByTrack});
  write_atomically(task.out / "track.html", track_page(sections));
}

}  // namespace doppel
