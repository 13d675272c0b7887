#include "doppel/calibration/estimation/audio_sync.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstring>
#include <opencv2/core.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/child_process.h"
#include "doppel/core/error.h"
#include "doppel/core/scratch_folder.h"

namespace doppel {
namespace {

constexpr double kMaxRate = 16000.0;        // samples per second that are compared
constexpr double kMaxOffset = 60.0;         // seconds
constexpr double kContrastOfLag = 1.5;      // that a known offset needs
constexpr double kSecondsOfPeak = 0.05;     // around the highest peak, where echoes make others
constexpr double kOnsetRate = 200.0;        // onsets per second
constexpr double kOnsetTolerance = 0.02;    // seconds by which onsets and phases may disagree
constexpr double kShareOfBestOnsets = 0.6;  // of the best lag's agreement that the lag of the phases needs
constexpr double kMinPower = 1e-3;          // of the mean power: weaker frequencies count less

void check_audio(const AudioTrack& track, const std::string& which) {
  if (!(track.rate >= 1000.0 && track.rate <= 1e6))
    fail("comparing sounds: the {} recording has {} samples per second; allowed are 1000 to 1000000", which,
         track.rate);
  if (static_cast<double>(track.samples.size()) < 0.5 * track.rate)
    fail("comparing sounds: the {} recording lasts {:.2f} s; at least 0.5 s are needed", which,
         static_cast<double>(track.samples.size()) / track.rate);
  if (!std::all_of(track.samples.begin(), track.samples.end(), [](float s) { return std::isfinite(s); }))
    fail("comparing sounds: the {} recording holds samples that are not finite", which);
}

/// The recording at a lower rate: means over the time of each new sample.
std::vector<double> at_rate(const AudioTrack& track, double rate) {
  std::vector<double> sums{0.0};
  for (const float sample : track.samples) sums.push_back(sums.back() + sample);
  const auto sum_until = [&](double position) {
    const double inside = std::clamp(position, 0.0, static_cast<double>(track.samples.size()));
    const auto whole = std::min(as_size(inside), track.samples.size() - 1);
    return sums[whole] + (inside - static_cast<double>(whole)) * track.samples[whole];
  };
  const double step = track.rate / rate;
  const auto count = as_size(static_cast<double>(track.samples.size()) / step);
  std::vector<double> result;
  for (std::size_t i = 0; i < count; ++i) {
    const double from = static_cast<double>(i) * step;
    result.push_back((sum_until(from + step) - sum_until(from)) / step);
  }
  return result;
}

cv::Mat spectrum_of(const std::vector<double>& samples, int size) {
  cv::Mat complex = cv::Mat::zeros(1, size, CV_64FC2);
  for (std::size_t i = 0; i < samples.size(); ++i) complex.at<cv::Vec2d>(static_cast<int>(i))[0] = samples[i];
  cv::dft(complex, complex);
  return complex;
}

/// The cross-correlation sum over t of a(t) b(t + lag), periodic. @param whiten only the phases count
cv::Mat correlation(const std::vector<double>& a, const std::vector<double>& b, bool whiten) {
  const int size = cv::getOptimalDFTSize(static_cast<int>(a.size() + b.size()));
  cv::Mat first = spectrum_of(a, size), product;
  cv::mulSpectrums(spectrum_of(b, size), first, product, 0, true);
  if (whiten) {
    double mean = 0.0;
    for (int i = 0; i < size; ++i) mean += cv::norm(product.at<cv::Vec2d>(i)) / size;
    for (int i = 0; i < size; ++i) {
      cv::Vec2d& value = product.at<cv::Vec2d>(i);
      value /= cv::norm(value) + kMinPower * mean + 1e-300;
    }
  }
  cv::dft(product, product, cv::DFT_INVERSE | cv::DFT_SCALE);
  cv::Mat parts[2];
  cv::split(product, parts);
  return parts[0];
}

/// The values of a correlation at the lags -reach ... reach.
std::vector<double> at_lags(const cv::Mat& correlation, int reach) {
  std::vector<double> values;
  for (int lag = -reach; lag <= reach; ++lag)
    values.push_back(correlation.at<double>(lag < 0 ? lag + correlation.cols : lag));
  return values;
}

/// How much the logarithm of the loudness rises from one part to the next; 0 where it falls.
std::vector<double> onsets_of(const std::vector<double>& samples, double rate) {
  const auto part = std::max<std::size_t>(1, as_size(rate / kOnsetRate));
  std::vector<double> levels;
  double all = 0.0;
  for (std::size_t i = 0; i + part <= samples.size(); i += part) {
    double power = 0.0;
    for (std::size_t j = i; j < i + part; ++j) power += samples[j] * samples[j] / static_cast<double>(part);
    levels.push_back(power);
    all += power;
  }
  const double floor = 1e-3 * all / static_cast<double>(std::max<std::size_t>(1, levels.size())) + 1e-30;
  std::vector<double> onsets;
  double mean = 0.0;
  for (std::size_t i = 1; i < levels.size(); ++i) {
    onsets.push_back(std::max(0.0, std::log((levels[i] + floor) / (levels[i - 1] + floor))));
    mean += onsets.back();
  }
  for (double& onset : onsets) onset -= mean / static_cast<double>(onsets.size());
  return onsets;
}

/// Whether the onsets agree at a lag nearly as well as at their best lag.
bool onsets_agree(const std::vector<double>& a, const std::vector<double>& b, double rate, double seconds,
                  double longest) {
  const std::vector<double> first = onsets_of(a, rate), second = onsets_of(b, rate);
  const double onset_rate = rate / std::max(1.0, std::floor(rate / kOnsetRate));
  const int reach =
      std::min(static_cast<int>(longest * onset_rate), static_cast<int>(std::min(first.size(), second.size())) - 1);
  if (reach < 1) return false;
  const std::vector<double> values = at_lags(correlation(first, second, false), reach);
  const double best = *std::max_element(values.begin(), values.end());
  double here = -1.0;
  for (int lag = -reach; lag <= reach; ++lag)
    if (std::abs(lag / onset_rate - seconds) <= kOnsetTolerance) here = std::max(here, values[lag + reach]);
  return best > 0.0 && here >= kShareOfBestOnsets * best;
}

/// The highest value between three by a parabola, as a shift of the middle one.
double parabola_shift(double before, double at, double after) {
  const double bend = before - 2.0 * at + after;
  return bend < 0.0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0.0;
}

}  // namespace

AudioOffset audio_offset(const AudioTrack& first, const AudioTrack& second) {
  check_audio(first, "first");
  check_audio(second, "second");
  const double rate = std::min({first.rate, second.rate, kMaxRate});
  const std::vector<double> a = at_rate(first, rate), b = at_rate(second, rate);
  const auto shorter = static_cast<double>(std::min(a.size(), b.size()));
  const int reach = static_cast<int>(std::min(kMaxOffset * rate, shorter - 1.0));
  const std::vector<double> values = at_lags(correlation(a, b, true), reach);
  const auto best = std::max_element(values.begin(), values.end());
  const int at = static_cast<int>(best - values.begin());
  AudioOffset result;
  double second_best = 0.0;
  for (int i = 0; i < static_cast<int>(values.size()); ++i)
    if (std::abs(i - at) > kSecondsOfPeak * rate) second_best = std::max(second_best, values[i]);
  result.contrast = second_best > 0.0 ? *best / second_best : 1.0;
  double lag = at - reach;
  if (at > 0 && at + 1 < static_cast<int>(values.size())) lag += parabola_shift(values[at - 1], *best, values[at + 1]);
  result.seconds = lag / rate;
  if (!(*best > 0.0) || result.contrast < kContrastOfLag)
    result.reason = fmt::format("no lag stands out (contrast {:.2f}, needed {:.2f}); the recordings may share no sound",
                                result.contrast, kContrastOfLag);
  else if (!onsets_agree(a, b, rate, result.seconds, kMaxOffset))
    result.reason = "the beginnings of the sounds agree better at another lag";
  result.known = result.reason.empty();
  return result;
}

std::optional<AudioTrack> read_audio(const std::filesystem::path& path, int rate) {
  if (!std::filesystem::exists(path)) fail("reading the sound of {}: there is no such file", path.string());
  const ScratchFolder folder;
  const ProgramResult run =
      run_program({"ffmpeg", "-nostdin", "-v", "error", "-y", "-i", std::filesystem::absolute(path).string(), "-vn",
                   "-ac", "1", "-ar", std::to_string(rate), "-f", "f32le", "sound.raw"},
                  folder.path());
  if (!run.found)
    fail(
        "reading the sound of {}: there is no program ffmpeg in PATH; install it, for instance with "
        "`apt install ffmpeg`",
        path.string());
  if (run.output.find("does not contain any stream") != std::string::npos) return std::nullopt;
  if (run.exit_code != 0)
    fail("reading the sound of {}: ffmpeg ended with {}: {}", path.string(), run.exit_code, run.output);
  const std::string bytes = read_file(folder.path() / "sound.raw");
  AudioTrack track;
  track.rate = rate;
  track.samples.resize(bytes.size() / sizeof(float));
  std::memcpy(track.samples.data(), bytes.data(), track.samples.size() * sizeof(float));
  if (track.samples.empty()) return std::nullopt;
  return track;
}

}  // namespace doppel
