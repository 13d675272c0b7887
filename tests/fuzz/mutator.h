#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace doppel::fuzz {

/// Changes valid files: flipped bytes, edges of integers, numbers as text, truncations, repeated and moved parts, parts
/// of another seed, words of the dictionary. One seed of the generator always gives the same files.
class Mutator {
 public:
  Mutator(std::vector<std::string> seeds, std::vector<std::string> dictionary, std::uint64_t seed);

  /// The next damaged file. At most a megabyte.
  std::string next();

 private:
  std::size_t below(std::size_t count) { return count == 0 ? 0 : static_cast<std::size_t>(generator_() % count); }
  const std::string& any_seed() { return seeds_[below(seeds_.size())]; }
  void change(std::string& bytes);
  void change_bytes(std::string& bytes, std::size_t kind);
  void change_number(std::string& bytes);
  void change_part(std::string& bytes, std::size_t kind);

  std::vector<std::string> seeds_, dictionary_;
  std::mt19937_64 generator_;
};

}  // namespace doppel::fuzz
