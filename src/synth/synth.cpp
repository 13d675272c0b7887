#include "doppel/synth/synth.h"

#include <ATen/Parallel.h>

#include <atomic>
#include <nlohmann/json.hpp>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/crc32c.h"
#include "doppel/core/error.h"
#include "doppel/core/log.h"
#include "doppel/core/npy.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/core/workers.h"
#include "doppel/geometry/image_file.h"
#include "doppel/synth/capture_writer.h"
#include "doppel/synth/film.h"
#include "doppel/synth/making_folder.h"
#include "doppel/synth/other_body.h"
#include "doppel/synth/studio.h"

namespace doppel::synth {

namespace {

namespace fs = std::filesystem;

/// Sets LibTorch to one thread in its scope: workers do one take or camera each.
class OneThreadEach {
 public:
  OneThreadEach() : before_(at::get_num_threads()) { at::set_num_threads(1); }
  ~OneThreadEach() { at::set_num_threads(before_); }
  OneThreadEach(const OneThreadEach&) = delete;
  OneThreadEach& operator=(const OneThreadEach&) = delete;

 private:
  int before_;
};

Actor actor_of(const SynthOptions& options) {
  Actor actor = make_actor(options.actor);
  if (options.body != kOwnBody) give_body(actor, measures_of(options.body));
  return actor;
}

/// What two runs must have in common so that one may go on with the files of the other.
std::string work_text(const SynthOptions& o) {
  nlohmann::ordered_json clips = nlohmann::ordered_json::array();
  for (const auto& files : {o.clips, o.test_clips}) {
    clips.push_back(nlohmann::ordered_json::array());
    for (const fs::path& file : files) {
      const std::string content = read_file(file);
      clips.back().push_back({file.string(), crc32c(content.data(), content.size())});
    }
  }
  const nlohmann::ordered_json work = {{"vertices", o.actor.vertices},
                                       {"nodes", o.actor.nodes},
                                       {"body", o.body},
                                       {"cloth", cloth_name(o.cloth.model)},
                                       {"cameras", o.cameras},
                                       {"size", o.size},
                                       {"lens", static_cast<int>(o.lens)},
                                       {"frames", {o.frames, o.test_frames, o.take_frames}},
                                       {"movements", static_cast<int>(o.movements)},
                                       {"clips", clips},
                                       {"tables", o.keypoint_tables},
                                       {"turn", o.turn},
                                       {"seed", o.seed}};
  return work.dump(2) + "\n";
}

/// Makes the files of a capture in a folder, and leaves alone what is there.
class CaptureJob {
 public:
  CaptureJob(const CaptureSet& set, const std::vector<SequencePlan>& sequences)
      : set_(set), sequences_(sequences), crew_(set.options.threads) {}

  /// @param kept called when something is complete that another run need not make again
  /// @return false: the user has stopped the work
  bool run(const std::function<void()>& kept) {
    kept_ = kept;
    for (const SequencePlan& sequence : sequences_)
      if (!simulate(sequence)) return false;
    return film();
  }

 private:
  const SynthOptions& options() const { return set_.options; }

  fs::path take_file(const SequencePlan& sequence, std::size_t take, const char* extension) const {
    return set_.root / "ground_truth" / sequence.name / fmt::format("take_{:04}{}", take, extension);
  }

  /// Shares items with a line that shows the progress. @param steps of all items
  void share(const std::string& title, std::size_t items, long steps,
             const std::function<void(std::size_t item)>& work) {
    if (items == 0) return;
    const OneThreadEach one_thread_each;
    Progress progress(title, steps);
    steps_done_ = 0;
    long shown = 0;
    const auto show = [&] {
      const long steps_now = steps_done_;
      progress.advance(steps_now - shown);
      shown = steps_now;
    };
    try {
      crew_.share(
          items, [&](std::size_t, std::size_t item) { work(item); }, show);
    } catch (const Error& e) {
      if (!stop_requested()) throw;
      log::warn("{}", e.what());  // mostly a simulation that was stopped in the middle of a take
    }
  }

  /// Makes the true surfaces and the poses of a sequence.
  bool simulate(const SequencePlan& sequence) {
    const fs::path surfaces = surfaces_file(set_.root, sequence.name);
    const fs::path poses = motion_rows_file(set_.root / sequence.name);
    if (!fs::exists(surfaces) || !fs::exists(poses)) {
      if (!options().shards.empty()) {
        const fs::path& first = options().shards[0];
        take_over(surfaces_file(first, sequence.name), surfaces);
        take_over(motion_rows_file(first / sequence.name), poses);
      } else {
        if (!make_takes(sequence)) return false;
        join_takes(sequence);
      }
    }
    remove_takes(sequence);
    return true;
  }

  bool make_takes(const SequencePlan& sequence) {
    std::vector<std::size_t> missing;
    long frames = 0;
    for (std::size_t k = 0; k < sequence.takes.size(); ++k)
      if (!fs::exists(take_file(sequence, k, ".npy"))) missing.push_back(k), frames += sequence.takes[k].frames;
    share("synth: surfaces, " + sequence.name, missing.size(), frames, [&](std::size_t item) {
      make_take(sequence, missing[item]);
      steps_done_ += sequence.takes[missing[item]].frames;
    });
    return crew_.wanted();
  }

  void make_take(const SequencePlan& sequence, std::size_t k) {
    const Take take = perform(set_.actor, sequence.takes[k], options());
    write_motion(take_file(sequence, k, ".motion"), take.motion, true);
    NpyStream stream(take_file(sequence, k, ".npy"), {set_.actor.character.num_vertices(), 3});
    for (const Points& surface : take.ground_truth) stream.append(flat(surface));
    stream.close();
    kept_();
  }

  /// Joins the files of the takes.
  void join_takes(const SequencePlan& sequence) {
    const Character& c = set_.actor.character;
    Motion motion;
    NpyStream all(surfaces_file(set_.root, sequence.name), {c.num_vertices(), 3});
    for (std::size_t k = 0; k < sequence.takes.size(); ++k) {
      NpyItems surfaces(take_file(sequence, k, ".npy"));
      for (std::int64_t f = 0; f < surfaces.size(); ++f) all.append(surfaces.read(f));
      for (std::vector<double>& pose : read_motion(take_file(sequence, k, ".motion"), c.num_dofs()).frames) {
        motion.ids.push_back(motion.num_frames());
        motion.frames.push_back(std::move(pose));
      }
    }
    write_motion_rows(set_.root / sequence.name, motion);
    all.close();
  }

  void remove_takes(const SequencePlan& sequence) const {
    for (std::size_t k = 0; k < sequence.takes.size(); ++k)
      for (const char* extension : {".npy", ".motion"}) fs::remove(take_file(sequence, k, extension));
  }

  /// A camera of a sequence.
  struct Film {
    std::size_t sequence = 0;
    int camera = 0;
  };

  bool film() {
    std::vector<Film> missing;
    long frames = 0;
    std::size_t unit = 0;
    for (std::size_t s = 0; s < sequences_.size(); ++s)
      for (int camera = 0; camera < options().cameras; ++camera, ++unit) {
        if (files_of(s, camera, set_.root).complete()) continue;
        if (!options().shards.empty()) {
          if (!crew_.wanted()) return false;
          take_over(s, camera, options().shards[unit % options().shards.size()]);
          kept_();
          continue;
        }
        if (options().shard && !options().shard->owns(unit)) continue;
        missing.push_back({s, camera});
        frames += sequences_[s].frames();
      }
    share("synth: film", missing.size(), frames, [&](std::size_t item) {
      const auto [s, camera] = missing[item];
      const auto next = [&] {
        ++steps_done_;
        return crew_.wanted();
      };
      if (film_camera(set_, sequences_[s].name, static_cast<int>(s), camera, next)) kept_();
    });
    return crew_.wanted();
  }

  CameraFiles files_of(std::size_t sequence, int camera, const fs::path& root) const {
    return {root / sequences_[sequence].name, camera, options().keypoint_tables};
  }

  /// Copies the files of a camera from a shard.
  void take_over(std::size_t sequence, int camera, const fs::path& shard) const {
    const CameraFiles from = files_of(sequence, camera, shard), to = files_of(sequence, camera, set_.root);
    for (const auto part : {&CameraFiles::video, &CameraFiles::masks, &CameraFiles::keypoints, &CameraFiles::joints})
      take_over(from.*part, to.*part);
  }

  static void take_over(const fs::path& from, const fs::path& to) {
    if (!fs::exists(from)) fail("{} is missing; run the command of this shard again", from.string());
    fs::create_directories(to.parent_path());
    if (fs::is_directory(from))
      fs::copy(from, to, fs::copy_options::recursive | fs::copy_options::overwrite_existing);
    else  // the last file of a camera says that all are there, so it must be whole
      write_atomically(to, [&](const fs::path& temporary) { fs::copy_file(from, temporary); });
  }

  static std::vector<float> flat(const Points& points) {
    std::vector<float> values;
    values.reserve(3 * points.size());
    for (const Eigen::Vector3d& p : points)
      for (const double x : p) values.push_back(static_cast<float>(x));
    return values;
  }

  const CaptureSet& set_;
  const std::vector<SequencePlan>& sequences_;
  Workers crew_;
  std::function<void()> kept_;
  std::atomic<long> steps_done_{0};
};

/// Writes the files that do not depend on time.
void write_still_files(const CaptureSet& set, const std::vector<SequencePlan>& sequences, const std::string& name) {
  write_character(set.root / "character", set.actor.character);
  fs::create_directories(set.root / "calibration");
  for (const std::string& file : calibration_files(set.options))
    write_calibration(set.root / "calibration" / file, set.cameras);
  fs::create_directories(set.root / "background");
  for (std::size_t c = 0; c < set.cameras.size(); ++c) {
    const fs::path path = set.root / "background" / (three_digits(static_cast<int>(c)) + ".png");
    write_image(path, Studio(set.actor, {set.cameras[c]}, {.seed = set.options.seed}).background(0));
  }
  write_atomically(set.root / "capture.yaml", capture_yaml(set.options, sequences, name));
  write_atomically(set.root / "README.txt", readme_text(set.options, sequences));
}

}  // namespace

std::optional<SynthReport> write_synthetic_capture(const fs::path& folder, const SynthOptions& options) {
  check_options(options);
  const Actor actor = actor_of(options);
  const std::vector<SequencePlan> sequences = plan_sequences(options, actor.character);
  const std::vector<Camera> cameras =
      make_cameras(options.cameras, options.size, options.seed, options.lens, options.room);
  std::optional<MakingFolder> making;
  std::optional<FolderLock> lock;
  if (options.shard)
    lock.emplace(folder);
  else
    making.emplace(folder, work_text(options), options.force);
  const CaptureSet set{actor, cameras, options, making ? making->path() : folder};
  const bool complete = CaptureJob(set, sequences).run([&] {
    if (making) making->keep();
  });
  if (!complete) return std::nullopt;
  SynthReport report;
  if (making) {
    write_still_files(set, sequences, making->name());
    if (options.shards.empty()) report = measure_capture(set, sequences[1].name);
    making->publish();
  }
  report.frames = sequences[0].frames();
  report.test_frames = sequences[1].frames();
  report.takes = static_cast<int>(sequences[0].takes.size());
  return report;
}

}  // namespace doppel::synth
