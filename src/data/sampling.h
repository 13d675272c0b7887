#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "doppel/data/dataset.h"

namespace doppel {

/// SplitMix64: short, well mixed, and the same everywhere, which the standard distributions are not.
class SplitMix {
 public:
  explicit SplitMix(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next();
  /// Uniform in [0, bound), without the bias of a plain remainder.
  std::uint64_t below(std::uint64_t bound);
  /// Uniform in [low, high).
  double uniform(double low, double high);

 private:
  std::uint64_t state_;
};

/// Which samples and cameras come when: a pure function of a seed and a position, so that a checkpoint need hold no
/// more than the position.
class SamplePlan {
 public:
  /// @param draw cameras per sample, at most cameras.size()
  SamplePlan(std::vector<SampleId> samples, std::vector<int> cameras, int draw, std::uint64_t seed);

  struct Item {
    SampleId sample;
    std::vector<int> cameras;
    std::uint64_t seed = 0;  ///< of whatever else is random about the item
  };
  /// The items at positions start .. start+count-1 of the endless stream.
  std::vector<Item> items(std::int64_t start, int count) const;

  std::int64_t num_samples() const { return static_cast<std::int64_t>(samples_.size()); }
  std::uint64_t seed() const { return seed_; }
  void set_seed(std::uint64_t seed) { seed_ = seed; }
  /// A digest of samples, cameras and draw: 16 hex digits.
  std::string fingerprint() const;

 private:
  std::vector<SampleId> samples_;
  std::vector<int> cameras_;
  int draw_;
  std::uint64_t seed_;
};

/// One epoch's order: a permutation of 0..count-1 that depends on (seed, epoch) alone, the same on every platform.
std::vector<std::int64_t> seeded_permutation(std::int64_t count, std::uint64_t seed, std::uint64_t epoch);

}  // namespace doppel
