#pragma once

#include <cstdint>
#include <random>

namespace doppel {

/// Random numbers that are the same with every standard library, unlike the standard distributions.
class Random {
 public:
  explicit Random(std::uint64_t seed) : generator_(seed) {}

  /// [0, 1)
  double uniform() { return static_cast<double>(generator_() >> 11) * 0x1.0p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// 0 .. count-1
  int index(int count) { return static_cast<int>(uniform() * count); }

 private:
  std::mt19937_64 generator_;
};

/// Mixes 64 bits so that neighbouring inputs give unrelated outputs (the finaliser of SplitMix64).
inline std::uint64_t hash_bits(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

/// Approximately normally distributed, mean 0, standard deviation 1: the sum of eight bytes of a hash.
inline float hash_normal(std::uint64_t key) {
  const std::uint64_t bits = hash_bits(key);
  int sum = 0;
  for (int byte = 0; byte < 8; ++byte) sum += static_cast<int>(bits >> (8 * byte) & 255);
  return static_cast<float>(sum - 1020) * (1.0f / 209.02f);
}

}  // namespace doppel
