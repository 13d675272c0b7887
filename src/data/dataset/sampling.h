#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "doppel/data/dataset/dataset.h"

namespace doppel {

/// The random generator SplitMix64. It gives the same numbers on every platform, unlike the standard distributions.
class SplitMix {
 public:
  explicit SplitMix(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next();
  /// Uniform in [0, bound), without the bias of a remainder.
  std::uint64_t below(std::uint64_t bound);
  /// Uniform in [low, high).
  double uniform(double low, double high);

 private:
  std::uint64_t state_;
};

/// The order of samples and cameras: a pure function of a seed and a position, so a checkpoint stores only the
/// position.
class SamplePlan {
 public:
  /// @param draw number of cameras per sample, at most cameras.size()
  SamplePlan(std::vector<SampleId> samples, std::vector<int> cameras, int draw, std::uint64_t seed);

  struct Item {
    SampleId sample;
    std::vector<int> cameras;
    std::uint64_t seed = 0;  ///< for all other random choices of the item
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

/// The order of one epoch: a permutation of 0..count-1 that depends only on (seed, epoch), the same on every platform.
std::vector<std::int64_t> seeded_permutation(std::int64_t count, std::uint64_t seed, std::uint64_t epoch);

}  // namespace doppel
