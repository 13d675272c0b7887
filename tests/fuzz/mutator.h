#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "fuzz/fuzz_target.h"

namespace doppel::fuzz {

/// Changes valid files: flipped bytes, edges of integers, numbers as text, truncations, repeated and moved parts, parts
/// of another seed, words of the dictionary; half of the files of a format that wraps its content are changed inside of
/// the wrapping. One seed of the generator always gives the same files.
class Mutator {
 public:
  /// @param target is kept by reference
  Mutator(const FuzzTarget& target, std::uint64_t seed) : target_(target), generator_(seed) {}

  /// The next damaged file. At most a megabyte.
  std::string next();

 private:
  std::size_t below(std::size_t count) { return count == 0 ? 0 : static_cast<std::size_t>(generator_() % count); }
  const std::string& any_seed() { return target_.seeds[below(target_.seeds.size())]; }
  void change(std::string& bytes);
  void change_inside(std::string& bytes);
  void change_bytes(std::string& bytes, std::size_t kind);
  void change_number(std::string& bytes);
  void change_part(std::string& bytes, std::size_t kind);

  const FuzzTarget& target_;
  std::mt19937_64 generator_;
};

}  // namespace doppel::fuzz
