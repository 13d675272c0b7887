#include "doppel/data/dataset/sampling.h"

#include <algorithm>
#include <numeric>

namespace doppel {

namespace {

/// One seed out of three numbers.
std::uint64_t mix(std::uint64_t seed, std::uint64_t a, std::uint64_t b) {
  const std::uint64_t first = SplitMix(seed).next() ^ a;
  return SplitMix(SplitMix(first).next() ^ (b + 0x2545f4914f6cdd1d)).next();
}

template <typename T>
void shuffle(std::vector<T>& items, std::uint64_t seed) {
  SplitMix random(seed);
  for (std::size_t i = items.size(); i > 1; --i) std::swap(items[i - 1], items[random.below(i)]);
}

}  // namespace

std::uint64_t SplitMix::next() {
  std::uint64_t z = state_ += 0x9e3779b97f4a7c15;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
  z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
  return z ^ (z >> 31);
}

std::uint64_t SplitMix::below(std::uint64_t bound) {
  const std::uint64_t limit = bound * (~std::uint64_t{0} / bound);
  std::uint64_t value = next();
  while (value >= limit) value = next();
  return value % bound;
}

double SplitMix::uniform(double low, double high) {
  return low + (high - low) * 0x1p-53 * static_cast<double>(next() >> 11);
}

std::vector<std::int64_t> seeded_permutation(std::int64_t count, std::uint64_t seed, std::uint64_t epoch) {
  std::vector<std::int64_t> order(count);
  std::iota(order.begin(), order.end(), 0);
  shuffle(order, mix(seed, epoch, 0));
  return order;
}

SamplePlan::SamplePlan(std::vector<SampleId> samples, std::vector<int> cameras, int draw, std::uint64_t seed)
    : samples_(std::move(samples)), cameras_(std::move(cameras)), draw_(draw), seed_(seed) {}

std::vector<SamplePlan::Item> SamplePlan::items(std::int64_t start, int count) const {
  std::vector<Item> result;
  std::vector<std::int64_t> order;
  std::int64_t epoch = -1;
  for (std::int64_t at = start; at < start + count; ++at) {
    if (at / num_samples() != epoch) {
      epoch = at / num_samples();
      order = seeded_permutation(num_samples(), seed_, static_cast<std::uint64_t>(epoch));
    }
    Item item{samples_[order[at % num_samples()]], cameras_, mix(seed_, static_cast<std::uint64_t>(at), 3)};
    if (draw_ < static_cast<int>(cameras_.size())) {
      shuffle(item.cameras, mix(seed_, static_cast<std::uint64_t>(at), 1));
      item.cameras.resize(draw_);
    }
    result.push_back(std::move(item));
  }
  return result;
}

std::string SamplePlan::fingerprint() const {
  std::uint64_t digest = mix(samples_.size(), cameras_.size(), draw_);
  for (const SampleId& sample : samples_)
    digest = mix(digest, sample.sequence, static_cast<std::uint64_t>(sample.frame));
  for (const int camera : cameras_) digest = mix(digest, camera, 2);
  return fmt::format("{:016x}", digest);
}

}  // namespace doppel
