#include "doppel/data/prepare/prepare.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <sstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/folder_lock.h"
#include "doppel/core/log.h"
#include "doppel/core/path_pattern.h"
#include "doppel/core/process.h"
#include "doppel/core/progress.h"
#include "doppel/core/statistics.h"
#include "doppel/core/workers.h"
#include "doppel/data/capture/mask_source.h"
#include "doppel/data/capture/people_in_cameras.h"
#include "doppel/data/capture/pose_detector.h"
#include "doppel/data/capture/template_check.h"
#include "doppel/data/capture/video.h"
#include "doppel/data/prepare/prepare_plan.h"
#include "doppel/detect/keypoints/keypoint_source.h"
#include "doppel/detect/keypoints/keypoint_table.h"
#include "doppel/geometry/undistorter.h"

namespace doppel {

namespace fs = std::filesystem;

namespace {

constexpr int kMaxParallelCameras = 2;
constexpr double kMinTemplateIou = 0.3;  // median; a lower value means that camera and masks do not belong together
constexpr int kFramesChecked = 10;

/// One camera in one sequence: the unit of work.
struct Job {
  int sequence = 0, camera = 0;
  std::size_t number = 0;  ///< counted over all sequences and cameras
  long done = 0;           ///< frames already in the store when this run began
};

std::string encode_image(const cv::Mat& image, int jpeg_quality) {
  std::vector<unsigned char> bytes;
  if (jpeg_quality > 0)
    cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, jpeg_quality});
  else
    cv::imencode(".png", image, bytes);
  return std::string(bytes.begin(), bytes.end());
}

/// Makes records from the images and masks of a job.
class RecordMaker {
 public:
  RecordMaker(const PreparePlan& plan, const PrepareOptions& options, const Job& job)
      : options_(options),
        sequence_(plan.sequences[job.sequence].entry),
        undistort_(plan.cameras[job.camera]),
        clock_(plan.capture.clock(sequence_, plan.cameras[job.camera].name)),
        videos_(open_frames(plan.source(sequence_.videos, job.camera), PixelFormat::colour)),
        masks_(plan.capture, sequence_, plan.cameras[job.camera], plan.file_index[job.camera]) {}

  FrameRecord make(long row) {
    const long frame = clock_.frame(row);
    const cv::Mat raw = videos_->read(frame);
    const Camera& camera = undistort_.pinhole();
    if (raw.cols != camera.width || raw.rows != camera.height)
      fail("{}: frame {} is {}x{} pixels, the ones before {}x{}", videos_->source(), frame, raw.cols, raw.rows,
           camera.width, camera.height);
    const cv::Mat mask = masks_.read(frame, raw);
    FrameRecord record;
    record.width = mask.cols;
    record.height = mask.rows;
    record.mask_size = options_.mask_size;
    record.image_size = options_.image_size;
    record.facts = inspect_mask(mask);
    record.full_mask = encode_mask(mask);
    record.box = crop_of_mask(mask, options_.margin);
    if (record.box.empty()) return record;
    record.crop_mask = encode_mask(crop_mask(mask, record.box, options_.mask_size));
    record.crop_image =
        encode_image(crop_image(undistort_.apply(raw), record.box, options_.image_size), options_.jpeg_quality);
    return record;
  }

 private:
  const PrepareOptions& options_;
  const SequenceEntry& sequence_;
  Undistorter undistort_;
  FrameClock clock_;
  std::unique_ptr<FrameReader> videos_;
  MaskSource masks_;
};

/// One run of prepare over a plan.
class Preparation {
 public:
  Preparation(const PreparePlan& plan, const PrepareOptions& options)
      : plan_(plan), options_(options), store_(open_store()), checker_(plan.character), workers_(num_workers(options)) {
    for (const fs::path& folder : options.shards) shards_.emplace_back(folder / kStoreFolder, Store::Mode::read);
  }

  PrepareReport run() {
    const std::vector<Job> jobs = list_jobs();
    process(jobs);
    PrepareReport report;
    report.new_records = new_records_;
    long wanted = 0;
    for (const Job& job : jobs) {
      report.records += count_records(job);
      wanted += sequence(job).num_frames();
    }
    report.finished = report.records == wanted;
    for (const Job& job : jobs) report.finished = report.finished && detect(job);
    if (!report.finished) return report;
    for (const Job& job : jobs) {
      report.cameras.push_back(report_camera(job));
      if (!options_.shard && !plan_.evidence.landmarks.empty()) report.cameras.back().keypoints = store_keypoints(job);
    }
    if (!options_.shard) write_outputs(report);
    return report;
  }

 private:
  const PlannedSequence& sequence(const Job& job) const { return plan_.sequences[job.sequence]; }
  const Camera& camera(const Job& job) const { return plan_.layout.cameras[job.camera]; }
  std::string key(const Job& job, long row) const {
    return record_key(sequence(job).entry.name, camera(job).name, row);
  }
  std::string title(const Job& job) const {
    return fmt::format("sequence {}, camera {}", sequence(job).entry.name, camera(job).name);
  }

  /// The store of an earlier run with equal settings, or a new one.
  Store open_store() const {
    const fs::path folder = options_.out / kStoreFolder;
    if (options_.overwrite)
      for (const char* file : {"data.mdb", "lock.mdb"}) fs::remove(folder / file);
    const bool found = Store::exists(folder);
    Store store(folder, Store::Mode::write);
    // A run that was killed before its first transaction leaves an empty store.
    if (!found || store.keys("").empty()) {
      for (const PlannedSequence& sequence : plan_.sequences)
        for (const Camera& camera : plan_.cameras) fs::remove(detected_file(sequence, camera));
      write_store_layout(store, plan_.layout);
      return store;
    }
    check_same_settings(read_store_layout(store).settings);
    return store;
  }

  void check_same_settings(const std::string& before) const {
    const std::string& now = plan_.layout.settings;
    if (before == now) return;
    std::istringstream old_lines(before), new_lines(now);
    std::string old_line, new_line;
    do {
      old_line.clear();
      new_line.clear();
      std::getline(old_lines, old_line);
      std::getline(new_lines, new_line);
    } while (old_line == new_line && (old_lines || new_lines));
    fail(
        "{} was prepared with other settings: '{}' then, '{}' now; choose another --out, or throw the old one away "
        "with "
        "--overwrite",
        options_.out.string(), old_line, new_line);
  }

  long count_records(const Job& job) const {
    const std::string prefix = record_key(sequence(job).entry.name, camera(job).name, 0);
    return static_cast<long>(store_.keys(prefix.substr(0, prefix.rfind('/') + 1)).size());
  }

  std::vector<Job> list_jobs() const {
    std::vector<Job> jobs;
    for (std::size_t s = 0; s < plan_.sequences.size(); ++s)
      for (std::size_t c = 0; c < plan_.cameras.size(); ++c) {
        Job job{static_cast<int>(s), static_cast<int>(c), s * plan_.cameras.size() + c, 0};
        if (options_.shard && !options_.shard->owns(job.number)) continue;
        job.done = count_records(job);
        // Records are written in the order of frames, so their number is the position to continue from.
        if (job.done > 0 && !store_.has(key(job, sequence(job).first_frame + job.done - 1)))
          fail("{}: {} has gaps in the store; prepare it again with --overwrite", options_.out.string(), title(job));
        jobs.push_back(job);
      }
    return jobs;
  }

  void process(const std::vector<Job>& jobs) {
    long total = 0, done = 0;
    for (const Job& job : jobs) {
      total += sequence(job).num_frames();
      done += job.done;
    }
    if (done > 0) log::info("{} of {} records exist already", done, total);
    Progress progress("prepare", total, done);
    workers_.share(jobs.size(), [&](std::size_t, std::size_t i) { process_job(jobs[i], progress); });
  }

  /// Shards are copied by one thread: the order of transactions decides where the store puts its pages.
  static int num_workers(const PrepareOptions& options) {
    return options.shards.empty() ? std::clamp(options.threads, 1, kMaxParallelCameras) : 1;
  }

  /// The encoded records of a job, by their rows: made from its images, or copied from a shard.
  std::function<std::string(long row)> records_of(const Job& job) const {
    if (options_.shards.empty()) {
      const auto maker = std::make_shared<RecordMaker>(plan_, options_, job);
      return [maker](long row) { return encode_record(maker->make(row)); };
    }
    const Store& shard = shards_[job.number % shards_.size()];
    return [this, job, &shard](long row) {
      const std::string name = key(job, row);
      const std::optional<std::string> bytes = shard.get(name);
      if (!bytes) fail_at({shard.folder().string(), 0}, "the record {} is missing; prepare this shard again", name);
      decode_record(*bytes, fmt::format("{}: {}", shard.folder().string(), name));  // checks its checksum
      return *bytes;
    };
  }

  void process_job(const Job& job, Progress& progress) {
    const long end = sequence(job).last_frame + 1;
    long row = sequence(job).first_frame + job.done;
    if (row >= end) return;
    const auto record = records_of(job);
    while (row < end && workers_.wanted()) {
      const long chunk_end = std::min(end, row + options_.chunk_frames);
      std::vector<std::pair<std::string, std::string>> items;
      for (long at = row; at < chunk_end; ++at) items.emplace_back(key(job, at), record(at));
      store_.put(items);
      {
        std::lock_guard lock(mutex_);
        new_records_ += chunk_end - row;
        progress.advance(chunk_end - row, title(job));
      }
      // A wrong camera is visible in the first frames, so it is checked early.
      if (row == sequence(job).first_frame) check_template(job, measure_template(job, row, chunk_end, 4));
      row = chunk_end;
    }
  }

  /// IoU of template and mask on up to `count` frames spread over [first, end).
  std::vector<double> measure_template(const Job& job, long first, long end, long count) {
    std::lock_guard lock(checker_mutex_);
    std::vector<double> ious;
    count = sequence(job).has_motion() ? std::min(count, end - first) : 0;
    for (long i = 0; i < count; ++i) {
      const long row = first + i * (end - first) / count;
      const Eigen::Matrix3Xf vertices = checker_.skin(sequence(job).motion.frames.at(row));
      const std::optional<double> iou = checker_.iou(vertices, camera(job), stored_mask(job, row));
      if (iou) ious.push_back(*iou);
    }
    return ious;
  }

  cv::Mat stored_mask(const Job& job, long row) const {
    const FrameRecord record = decode_record(store_.get(key(job, row)).value_or(""), key(job, row));
    return decode_mask(record.full_mask, {record.width, record.height}, key(job, row));
  }

  void check_template(const Job& job, const std::vector<double>& ious) {
    if (ious.empty() || median(ious) >= kMinTemplateIou) return;
    std::lock_guard lock(checker_mutex_);
    const long row = sequence(job).first_frame;
    const std::string reason = explain_misfit(checker_, checker_.skin(sequence(job).motion.frames.at(row)), camera(job),
                                              stored_mask(job, row));
    stop_or_warn(options_,
                 fmt::format("{}: the skinned template does not cover the person (median IoU {:.2f}, at least {} is "
                             "expected): {}",
                             title(job), median(ious), kMinTemplateIou,
                             reason.empty() ? "this camera, its masks and the motion do not belong together, or "
                                              "video and motion are shifted in time (frame_offset)"
                                            : reason));
  }

  CameraReport report_camera(const Job& job) {
    const PlannedSequence& rows = sequence(job);
    CameraReport report;
    report.sequence = rows.entry.name;
    report.camera = camera(job).name;
    report.frames = rows.num_frames();
    for (long row = rows.first_frame; row <= rows.last_frame; ++row) {
      const std::string name = key(job, row);
      const FrameRecord head = decode_record_head(store_.get_head(name, kRecordHeadBytes).value_or(""), name);
      report.empty_frames += head.box.empty();
      report.coverage += static_cast<double>(head.facts.area) / (static_cast<double>(head.width) * head.height);
      report.border_touch += head.facts.touches_border;
    }
    report.coverage /= static_cast<double>(report.frames);
    report.border_touch /= static_cast<double>(report.frames);
    const std::vector<double> ious = measure_template(job, rows.first_frame, rows.last_frame + 1, kFramesChecked);
    report.template_iou = median(ious);
    report.checked_frames = static_cast<int>(ious.size());
    check_template(job, ious);
    if (report.empty_frames == report.frames)
      stop_or_warn(options_, fmt::format("{}: all masks are empty; check the mask files and mask_threshold ({})",
                                         title(job), rows.entry.mask_threshold));
    return report;
  }

  fs::path detected_file(const PlannedSequence& planned, const Camera& seen) const {
    return expand_camera(PreparePlan::detected_table(planned, options_.out), 0, seen.name);
  }

  /// The frames before and after each row, as far as the video has them.
  static std::set<long> frames_around(const PlannedSequence& rows, const FrameClock& clock, FrameReader& videos) {
    const auto after_last = static_cast<long>(std::ceil(clock.time(rows.last_frame))) + 1;
    const long end = clock.is_whole() ? after_last : videos.num_frames(after_last);
    std::set<long> frames;
    for (long row = rows.first_frame; row <= rows.last_frame; ++row)
      for (const double time : {std::floor(clock.time(row)), std::ceil(clock.time(row))})
        if (time >= 0 && time < static_cast<double>(end)) frames.insert(static_cast<long>(time));
    return frames;
  }

  /// Runs the capture's detector where no keypoints are given, and saves its points as a table. @return false: stopped
  bool detect(const Job& job) const {
    const PlannedSequence& rows = sequence(job);
    const fs::path table = detected_file(rows, camera(job));
    if (!plan_.detects(rows) || fs::exists(table)) return true;
    if (!options_.shards.empty()) {
      const fs::path& shard = options_.shards[job.number % options_.shards.size()];
      write_atomically(table, read_file(expand_camera(PreparePlan::detected_table(rows, shard), 0, camera(job).name)));
      return true;
    }
    PoseDetector detector = open_detector(plan_.capture, plan_.evidence.map.layout);
    const auto videos = open_frames(plan_.source(rows.entry.videos, job.camera), PixelFormat::colour);
    const std::set<long> needed = frames_around(rows, plan_.capture.clock(rows.entry, camera(job).name), *videos);
    std::map<long, People> frames;
    Progress progress("detect", static_cast<long>(needed.size()), 0);
    for (const long frame : needed) {
      if (stop_requested()) return false;
      frames[frame] = detector.detect(videos->read(frame));
      progress.advance(1, title(job));
    }
    write_keypoint_table(table, plan_.evidence.map.layout, frames);
    return true;
  }

  /// Reads the keypoints of one camera and stores one record per frame.
  KeypointFacts store_keypoints(const Job& job) {
    const PlannedSequence& rows = sequence(job);
    const Camera& filmed = plan_.cameras[job.camera];
    const FilmedRows filmed_rows{rows.first_frame, rows.last_frame, rows.entry.cuts,
                                 plan_.capture.clock(rows.entry, filmed.name)};
    const auto mask = [&](long row) { return stored_mask(job, row); };
    KeypointTrack track;
    try {
      track = follow_person(people_of(job), mask, LandmarkPicker(plan_.evidence.map, plan_.evidence.landmarks), filmed,
                            filmed_rows, plan_.capture.keypoint_filter, choice_of(job));
    } catch (const FileError&) {
      throw;
    } catch (const Error& e) {
      fail("{}: {}", title(job), e.what());
    }
    std::vector<std::pair<std::string, std::string>> items;
    for (std::size_t i = 0; i < track.frames.size(); ++i)
      items.emplace_back(keypoints_key(rows.entry.name, filmed.name, rows.first_frame + static_cast<long>(i)),
                         encode_keypoints(track.frames[i]));
    store_.put(items);
    tell_doubts(job, track.facts);
    return track.facts;
  }

  /// Who is followed in a camera. Made for all cameras of a sequence at once.
  ChoiceOfFrame choice_of(const Job& job) {
    auto [choice, is_new] = chosen_.try_emplace(job.sequence);
    if (!is_new) return choice->second[job.camera];
    const PlannedSequence& rows = sequence(job);
    PeopleInCameras seen{rows.entry.name, plan_.cameras, {}, {}, rows.first_frame, rows.last_frame};
    for (std::size_t c = 0; c < plan_.cameras.size(); ++c) {
      seen.clocks.push_back(plan_.capture.clock(rows.entry, plan_.cameras[c].name));
      seen.people.push_back(people_of({job.sequence, static_cast<int>(c)}));
    }
    const auto mask = [&](std::size_t camera, long row) {
      return stored_mask({job.sequence, static_cast<int>(camera)}, row);
    };
    choice->second = follow_if_several(seen, plan_.evidence.map.layout, plan_.capture.person_of(rows.entry), mask);
    return choice->second[job.camera];
  }

  void tell_doubts(const Job& job, const KeypointFacts& facts) const {
    const CameraPaths& written = sequence(job).entry.keypoints;
    if (written.empty() && !plan_.detects(sequence(job))) return;  // this sequence has no keypoints
    const std::vector<std::string> doubts = keypoint_doubts(facts);
    if (facts.missing_files == facts.frames)
      stop_or_warn(options_, fmt::format("{}: {} ({})", title(job), doubts.at(0), plan_.source(written, job.camera)));
    else
      for (const std::string& doubt : doubts) log::warn("{}: {}", title(job), doubt);
  }

  PeopleOfFrame people_of(const Job& job) const {
    CameraPaths written = sequence(job).entry.keypoints;
    if (plan_.detects(sequence(job))) written = PreparePlan::detected_table(sequence(job), options_.out);
    if (written.empty()) return [](long) { return std::optional<People>(); };
    const auto source =
        std::make_shared<KeypointSource>(plan_.source(written, job.camera), plan_.evidence.map.layout,
                                         keypoint_camera(plan_.cameras[job.camera], plan_.file_index[job.camera]),
                                         sequence(job).entry.keypoint_offset_of(plan_.cameras[job.camera].name));
    return [source](long frame) { return source->people(frame); };
  }

  void write_outputs(const PrepareReport& report) {
    Capture capture = plan_.capture;
    for (std::size_t i = 0; i < capture.sequences.size(); ++i) {
      capture.sequences[i].first_frame = plan_.sequences[i].first_frame;
      capture.sequences[i].last_frame = plan_.sequences[i].last_frame;
      if (plan_.detects(plan_.sequences[i]))
        capture.sequences[i].keypoints = PreparePlan::detected_table(plan_.sequences[i], options_.out);
    }
    // The detected keypoints are now files, in the layout of the detector.
    if (capture.detector) capture.keypoint_map = plan_.evidence.map_name;
    capture.detector.reset();
    capture.cameras.clear();
    for (const Camera& camera : plan_.cameras) capture.cameras.push_back(camera.name);
    write_capture(options_.out / "capture.yaml", capture, {"Written by `doppel prepare`: the prepared capture."});
    write_atomically(options_.out / "report.json", report.json() + "\n");
    mark_complete(store_);
  }

  const PreparePlan& plan_;
  const PrepareOptions& options_;
  Store store_;
  std::vector<Store> shards_;  ///< to merge
  TemplateChecker checker_;
  Workers workers_;
  std::mutex mutex_, checker_mutex_;
  std::map<int, std::vector<ChoiceOfFrame>> chosen_;  ///< [C] by sequence
  long new_records_ = 0;
};

void check_options(const PrepareOptions& options) {
  const auto require = [](bool good, const char* name, double value, const char* allowed) {
    if (!good) fail<UsageError>("the {} is {}; it must be {}", name, value, allowed);
  };
  require(options.mask_size >= 16 && options.mask_size <= 4096, "mask size", options.mask_size, "16 to 4096");
  require(options.image_size >= 16 && options.image_size <= 8192, "image size", options.image_size, "16 to 8192");
  require(options.margin >= 0.0 && options.margin <= 2.0, "margin", options.margin, "0 to 2");
  require(options.jpeg_quality >= 0 && options.jpeg_quality <= 100, "JPEG quality", options.jpeg_quality, "0 to 100");
  require(options.chunk_frames >= 1 && options.chunk_frames <= 10000, "number of frames per transaction",
          options.chunk_frames, "1 to 10000");
  require(options.limit_frames >= 0, "limit of frames", static_cast<double>(options.limit_frames), "0 (all) or more");
  if (options.out.empty()) fail<UsageError>("no output folder was given");
}

/// The prepared capture.yaml names the folder of the capture. In the same folder it would overwrite the capture's own
/// capture.yaml.
void check_out_folder(const Capture& capture, const fs::path& out) {
  if (!capture.file.empty() && fs::weakly_canonical(out / "capture.yaml") == fs::weakly_canonical(capture.file) &&
      !fs::exists(out / kStoreFolder))
    fail<UsageError>("{} is the capture itself; choose another folder with --out", out.string());
  if (!fs::exists(out / kStoreFolder)) check_capture_out(out / "capture.yaml");
}

}  // namespace

PrepareReport prepare_capture(const Capture& capture, const PrepareOptions& options) {
  check_options(options);
  check_out_folder(capture, options.out);
  const PreparePlan plan = plan_preparation(capture, options);
  const FolderLock lock(options.out);
  return Preparation(plan, options).run();
}

namespace {

nlohmann::ordered_json to_json(const KeypointFacts& facts) {
  return {{"missing_files", facts.missing_files},
          {"nobody", facts.nobody},
          {"several_people", facts.several},
          {"unsure_frames", facts.unsure},
          {"seen", facts.seen}};
}

}  // namespace

std::string PrepareReport::table() const {
  std::string text = fmt::format("{:<16} {:<10} {:>7} {:>6} {:>9} {:>7} {:>12}\n", "sequence", "camera", "frames",
                                 "empty", "coverage", "border", "template IoU");
  const bool keypoints =
      std::any_of(cameras.begin(), cameras.end(), [](const auto& c) { return c.keypoints.has_value(); });
  if (keypoints) text.insert(text.size() - 1, fmt::format(" {:>10} {:>7} {:>7}", "landmarks", "no file", "nobody"));
  for (const CameraReport& camera : cameras) {
    const std::string iou = camera.checked_frames > 0 ? fmt::format("{:.3f}", camera.template_iou) : "-";
    text += fmt::format("{:<16} {:<10} {:>7} {:>6} {:>8.2f}% {:>6.1f}% {:>12}\n", camera.sequence, camera.camera,
                        camera.frames, camera.empty_frames, 100.0 * camera.coverage, 100.0 * camera.border_touch, iou);
    if (const auto& facts = camera.keypoints)
      text.insert(text.size() - 1,
                  fmt::format(" {:>9.1f}% {:>7} {:>7}", 100.0 * facts->seen, facts->missing_files, facts->nobody));
  }
  return text;
}

std::string PrepareReport::json() const {
  nlohmann::ordered_json document{
      {"finished", finished}, {"records", records}, {"cameras", nlohmann::ordered_json::array()}};
  for (const CameraReport& camera : cameras) {
    document["cameras"].push_back(
        {{"sequence", camera.sequence},
         {"camera", camera.camera},
         {"frames", camera.frames},
         {"empty_frames", camera.empty_frames},
         {"mask_coverage", camera.coverage},
         {"border_touch", camera.border_touch},
         {"template_iou",
          camera.checked_frames > 0 ? nlohmann::ordered_json(camera.template_iou) : nlohmann::ordered_json()},
         {"checked_frames", camera.checked_frames}});
    if (camera.keypoints) document["cameras"].back()["keypoints"] = to_json(*camera.keypoints);
  }
  return document.dump(2);
}

}  // namespace doppel
