#include "doppel/calibration/estimation/audio_sync.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <random>

#include "doppel/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel {
namespace {

using support::message_of;
using ::testing::HasSubstr;

/// Steps and claps in a room, as one microphone hears them: bursts of noise with an echo, and noise of its own.
AudioTrack room(double rate, double seconds, double offset, double echo, double noise, unsigned seed) {
  AudioTrack track;
  track.rate = rate;
  track.samples.assign(static_cast<std::size_t>(rate * seconds), 0.0F);
  std::mt19937 events(99), own(seed);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::normal_distribution<float> normal(0.0F, 1.0F);
  for (double t = 0.3; t < seconds + 20.0; t += 0.2 + share(events)) {
    const double pitch = 300.0 + 2500.0 * share(events), loud = 0.2 + share(events);
    for (const double later : {0.0, echo}) {
      const double begin = t - 10.0 + offset + later;
      for (double s = 0.0; s < 0.08; s += 1.0 / rate) {
        const auto at = static_cast<long>(std::floor((begin + s) * rate));
        if (at < 0 || at >= static_cast<long>(track.samples.size())) continue;
        const double exact = static_cast<double>(at) / rate - begin;
        track.samples[static_cast<std::size_t>(at)] +=
            static_cast<float>((later > 0.0 ? 0.5 : 1.0) * loud * std::exp(-60.0 * exact) *
                               std::sin(2.0 * M_PI * pitch * exact * (1.0 + 4.0 * exact)));
      }
    }
  }
  for (float& sample : track.samples) sample += static_cast<float>(noise) * normal(own);
  return track;
}

TEST(AudioSync, FindsTheOffsetToAMillisecond) {
  for (const double offset : {0.0, 1.2345, -3.3}) {
    const AudioOffset found =
        audio_offset(room(16000, 12.0, 0.0, 0.031, 0.02, 1), room(16000, 15.0, offset, 0.023, 0.02, 2));
    EXPECT_TRUE(found.known) << found.reason;
    EXPECT_NEAR(found.seconds, offset, 0.001);
    EXPECT_GT(found.contrast, 1.5);
  }
}

TEST(AudioSync, RecordingsOfDifferentRates) {
  const AudioOffset found =
      audio_offset(room(16000, 12.0, 0.0, 0.031, 0.02, 1), room(11025, 12.0, 0.77, 0.023, 0.02, 2));
  EXPECT_TRUE(found.known) << found.reason;
  EXPECT_NEAR(found.seconds, 0.77, 0.002);
}

TEST(AudioSync, CannotTellWithoutACommonSound) {
  AudioTrack silence{16000.0, std::vector<float>(160000, 0.0F)};
  EXPECT_FALSE(audio_offset(silence, silence).known);
  AudioTrack noise_a = room(16000, 10.0, 1e6, 0.1, 0.1, 5), noise_b = room(16000, 10.0, 1e6, 0.1, 0.1, 6);
  const AudioOffset found = audio_offset(noise_a, noise_b);
  EXPECT_FALSE(found.known);
  EXPECT_THAT(found.reason, HasSubstr("stands out"));
}

TEST(AudioSync, RefusesHostileInput) {
  const AudioTrack good{16000.0, std::vector<float>(16000, 0.1F)};
  AudioTrack bad = good;
  bad.samples[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(message_of<Error>([&] { audio_offset(good, bad); }), HasSubstr("not finite"));
  EXPECT_THAT(message_of<Error>([&] { audio_offset({16000.0, {}}, good); }), HasSubstr("0.5 s"));
  EXPECT_THAT(message_of<Error>([&] { audio_offset(good, {0.0, good.samples}); }), HasSubstr("samples per second"));
}

/// Puts a program called ffmpeg first in PATH.
class FakeFfmpeg {
 public:
  FakeFfmpeg(const std::filesystem::path& folder, const std::string& script) : old_(std::getenv("PATH")) {
    const std::filesystem::path program = folder / "ffmpeg";
    std::ofstream(program) << "#!/bin/sh\n" << script;
    std::filesystem::permissions(program, std::filesystem::perms::owner_all);
    setenv("PATH", (folder.string() + ":" + old_).c_str(), 1);
  }
  ~FakeFfmpeg() { setenv("PATH", old_.c_str(), 1); }

 private:
  std::string old_;
};

TEST(AudioSync, ReadsWhatFfmpegWrites) {
  const support::TemporaryFolder folder;
  const std::filesystem::path film = folder.path() / "film with blanks.mp4";
  std::ofstream(film) << "film";
  {
    // 0x3f800000 is 1, 0xbf000000 is -0.5, both little endian; the program also notes its arguments.
    const FakeFfmpeg program(folder.path(),
                             "printf '\\000\\000\\200\\077\\000\\000\\000\\277' > sound.raw\necho \"$@\" > " +
                                 (folder.path() / "arguments").string() + "\n");
    const auto track = read_audio(film, 8000);
    ASSERT_TRUE(track);
    EXPECT_EQ(track->rate, 8000.0);
    EXPECT_THAT(track->samples, ::testing::ElementsAre(1.0F, -0.5F));
    std::ifstream file(folder.path() / "arguments");
    std::string arguments;
    std::getline(file, arguments);
    EXPECT_THAT(arguments, HasSubstr("film with blanks.mp4 -vn -ac 1 -ar 8000 -f f32le"));
  }
  {
    const FakeFfmpeg program(folder.path(), "echo 'Output file #0 does not contain any stream' >&2; exit 1\n");
    EXPECT_FALSE(read_audio(film));
  }
  const FakeFfmpeg program(folder.path(), "echo 'moov atom not found' >&2; exit 1\n");
  EXPECT_THAT(message_of<Error>([&] { read_audio(film); }), HasSubstr("moov atom not found"));
  EXPECT_THAT(message_of<Error>([&] { read_audio(folder.path() / "none.mp4"); }), HasSubstr("no such file"));
}

}  // namespace
}  // namespace doppel
