// Tracking that is stopped by signals or by a damaged image, and two processes on one folder.
#include <gmock/gmock.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <thread>

#include "doppel/actor/checkpoint.h"
#include "doppel/character/character.h"
#include "doppel/character/motion.h"
#include "doppel/core/atomic_file.h"
#include "faults/folder_state.h"
#include "faults/program_run.h"
#include "faults/tiny_work.h"

namespace doppel::faults {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using ::testing::HasSubstr;
using Words = std::vector<std::string>;

class Stops : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { work_ = new TinyWork; }
  static void TearDownTestSuite() {
    delete work_;
    work_ = nullptr;
  }
  void SetUp() override { fs::remove_all(out()); }

  static fs::path at(const std::string& name) { return work_->at(name); }
  static fs::path out() { return at("out"); }
  /// Whether a file of that name has a temporary one in out().
  static bool is_being_written(const std::string& file) {
    if (!fs::exists(out())) return false;
    for (const auto& entry : fs::directory_iterator(out()))
      if (entry.path().filename().string().ends_with("-" + file)) return true;
    return false;
  }

  /// Waits until the process has tracked a frame. @return false when it ended before
  static bool wait_until(Process& process, const std::function<bool()>& condition) {
    while (!condition()) {
      if (process.has_ended()) return false;
      std::this_thread::sleep_for(1ms);
    }
    return true;
  }
  static bool exists_in_out(const std::string& word) {
    if (!fs::exists(out())) return false;
    for (const auto& entry : fs::directory_iterator(out()))
      if (entry.path().filename().string().find(word) != std::string::npos && fs::file_size(entry.path()) > 4096)
        return true;
    return false;
  }
  static int frames_in(const fs::path& motion) {
    const Character character = load_character(at("capture/character/actor.character"));
    return read_motion(motion, character.num_dofs()).num_frames();
  }
  static void expect_no_leftovers() {
    for (const auto& [name, content] : state_of(out())) EXPECT_FALSE(is_leftover(name)) << name;
  }

  /// The images of a sequence as files, in a folder; the last one is cut in the middle.
  static fs::path cut_images(const std::string& name) {
    const fs::path folder = at(name);
    fs::create_directories(folder);
    cv::VideoCapture video(at("capture/training/videos/stream000.mp4").string());
    fs::path last;
    cv::Mat image;
    for (int i = 0; video.read(image); ++i) {
      last = folder / fmt::format("{:03}.png", i);
      cv::imwrite(last.string(), image);
    }
    fs::resize_file(last, fs::file_size(last) / 2);
    return folder;
  }
  /// A capture long enough for a signal to come before its end.
  static fs::path long_capture() {
    if (!fs::exists(at("long"))) {
      EXPECT_TRUE(faults::run(work_->synth(at("long"), 24)).succeeded());
    }
    return at("long");
  }
  static Words track_with(const std::string& method, const fs::path& capture, Words more) {
    Words words{"track", method, capture, "--camera", "0", "--out", out()};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  static TinyWork* work_;
};
TinyWork* Stops::work_ = nullptr;

TEST_F(Stops, BySignalsLeaveTheLiveFramesSoFar) {
  const Words words = track_with("live", at("capture"),
                                 {"--sequence", "training", "--source", at("capture/training/videos/stream000.mp4"),
                                  "--repeat", "100000", "--vertices"});
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    SCOPED_TRACE(signal);
    fs::remove_all(out());
    Process process(words);
    ASSERT_TRUE(wait_until(process, [] { return exists_in_out("live_vertices"); })) << process.err();
    process.send(signal);
    const Ending ending = process.wait();
    EXPECT_EQ(ending.code, 0) << ending.err;
    EXPECT_GT(frames_in(out() / "live.motion"), 0);
    EXPECT_TRUE(fs::exists(out() / "live_vertices.npy"));
    EXPECT_TRUE(fs::exists(out() / "track.json"));
    expect_no_leftovers();
  }
}

TEST_F(Stops, BySignalsLeaveTheFramesSoFarAndTheNextRunAll) {
  const Words words =
      track_with("livecap", long_capture(),
                 {"--sequences", "training", "--vertices", "--sheet-frames", "0", "--preview", out() / "film.mp4"});
  const Ending whole_run = faults::run(words);
  ASSERT_TRUE(whole_run.succeeded()) << whole_run.err;
  const Files whole = state_of(out());
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    SCOPED_TRACE(signal);
    fs::remove_all(out());
    Process process(words);
    ASSERT_TRUE(wait_until(process, [] { return exists_in_out("training_vertices"); })) << process.err();
    process.send(signal);
    const Ending ending = process.wait();
    EXPECT_EQ(ending.code, 1) << ending.err;
    EXPECT_THAT(ending.err, HasSubstr("the same command tracks all again"));
    expect_no_leftovers();
    const int frames = frames_in(out() / "training.motion");
    EXPECT_GT(frames, 0);
    EXPECT_LT(frames, 24);
    EXPECT_EQ(nlohmann::json::parse(read_file(out() / "track.json"))["sequences"]["training"]["frames"], frames);
    const Ending again = faults::run(words);
    ASSERT_TRUE(again.succeeded()) << again.err;
    EXPECT_EQ(difference(state_of(out()), whole), "");
  }
}

TEST_F(Stops, WhileSurfacesAreTrackedLeaveThePoses) {
  const Words words{"track", long_capture(),   "--surface", "--sequences", "training", "--limit-frames",
                    "12",    "--sheet-frames", "0",         "--out",       out()};
  Process process(words);
  ASSERT_TRUE(wait_until(process, [] { return is_being_written("training_graph.npy"); })) << process.err();
  process.send(SIGINT);
  const Ending ending = process.wait();
  EXPECT_EQ(ending.code, 1) << ending.err;
  EXPECT_THAT(ending.err, HasSubstr("the poses are complete"));
  EXPECT_EQ(frames_in(out() / "training.motion"), 12);
  EXPECT_TRUE(fs::exists(out() / "track.json"));
  EXPECT_TRUE(fs::exists(out() / "capture.yaml"));
  EXPECT_FALSE(fs::exists(out() / "training_graph.npy"));
  expect_no_leftovers();
}

TEST_F(Stops, AtADamagedImageLeaveTheFramesBefore) {
  const fs::path images = cut_images("cut");
  const Ending live =
      faults::run(track_with("live", at("capture"), {"--sequence", "training", "--source", images, "--vertices"}));
  EXPECT_EQ(live.code, 1) << live.err;
  EXPECT_THAT(live.err, HasSubstr("003.png"));
  EXPECT_EQ(frames_in(out() / "live.motion"), 3);
  expect_no_leftovers();

  std::string yaml = read_file(at("capture/capture.yaml"));
  for (const std::string old = "training/videos/stream{camera:03}.mp4"; yaml.find(old) != std::string::npos;)
    yaml.replace(yaml.find(old), old.size(), "../cut/{frame:03}.png");
  write_atomically(at("capture/cut.yaml"), yaml);
  fs::remove_all(out());
  const Ending ending = faults::run({"track", "livecap", at("capture/cut.yaml"), "--camera", "0", "--sequences",
                                     "training", "--vertices", "--preview", out() / "film.mp4", "--out", out()});
  EXPECT_EQ(ending.code, 1) << ending.err;
  EXPECT_THAT(ending.err, HasSubstr("only the frames 0 to 2 are tracked"));
  EXPECT_EQ(frames_in(out() / "training.motion"), 3);
  expect_no_leftovers();
}

/// Files of a run that cannot be written or read.
class RunFiles : public Stops {
 protected:
  static void expect_last_checkpoint() {
    const auto found = CheckpointFolder(out() / "checkpoints").load_latest();
    ASSERT_TRUE(found);
    EXPECT_EQ(found->first, 4);
  }
};

TEST_F(RunFiles, MetricsThatCannotBeWrittenLeaveTheCheckpoints) {
  fs::create_directories(out());
  write_atomically(out() / "metrics.jsonl", "");
  Fault fault(out() / "metrics.jsonl");
  fs::remove_all(out());
  fault.set(FAULT_FULL, 1);
  const Ending ending = faults::run(work_->train(out(), 4, 1), &fault);
  EXPECT_GE(fault.plan().failed, 4);
  EXPECT_EQ(ending.code, 1);
  EXPECT_THAT(ending.err, HasSubstr("metrics.jsonl"));
  expect_last_checkpoint();
  ASSERT_TRUE(faults::run(work_->train(out(), 4, 1)).succeeded());
}

TEST_F(RunFiles, AReportThatCannotBeWrittenLeaveTheCheckpoints) {
  fs::copy(at("broken"), out(), fs::copy_options::recursive);
  fs::remove(out() / "report.html");
  fs::create_directories(out() / "report.html/in the way");
  const Ending ending = faults::run(work_->train(out(), 4, 1));
  EXPECT_EQ(ending.code, 1);
  EXPECT_THAT(ending.err, HasSubstr("report.html"));
  expect_last_checkpoint();
}

TEST_F(RunFiles, TheNewestCheckpointIsNotReplacedWhenItCannotBeRead) {
  const fs::path newest = at("run/checkpoints/step-000004.pt");
  Fault fault(newest);
  for (const FaultKind kind : {FAULT_OPEN, FAULT_READ}) {
    fault.set(kind, 1);
    const Ending ending = faults::run({"export", "--run", at("run"), "--out", out() / "actor.pt"}, &fault);
    EXPECT_EQ(ending.code, 1);
    EXPECT_THAT(ending.err, HasSubstr(newest.string()));
    EXPECT_FALSE(fs::exists(out() / "actor.pt"));
  }
}

/// The second of two processes that write into one folder.
class TwoProcesses : public Stops {
 protected:
  void expect_the_second_is_refused(const Words& words) {
    Process first(words);
    // The file exists before it is locked; its owner is written into it afterwards.
    const auto locked = [] {
      std::error_code missing;
      const auto size = fs::file_size(out() / ".doppel-lock", missing);
      return !missing && size > 0;
    };
    ASSERT_TRUE(wait_until(first, locked)) << first.err();
    first.send(SIGSTOP);  // it holds the folder as long as the second one needs
    Process second(words);
    const Ending refused = second.wait();
    first.send(SIGCONT);
    const Ending ending = first.wait();
    EXPECT_EQ(refused.code, 1);
    EXPECT_THAT(refused.err, HasSubstr(fmt::format("process {} on ", first.id())));
    EXPECT_THAT(refused.err, HasSubstr(out().string()));
    EXPECT_TRUE(ending.succeeded()) << ending.err;
    const Files found = state_of(out());
    fs::remove_all(out());
    ASSERT_TRUE(faults::run(words).succeeded());
    EXPECT_EQ(difference(found, state_of(out())), "");
  }
};

TEST_F(TwoProcesses, OfATrainingAreRefused) { expect_the_second_is_refused(work_->train(out(), 20, 5)); }
TEST_F(TwoProcesses, OfAPreparationAreRefused) { expect_the_second_is_refused(work_->prepare(out())); }
TEST_F(TwoProcesses, OfATrackAreRefused) { expect_the_second_is_refused(work_->track(out())); }

}  // namespace
}  // namespace doppel::faults
