#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "doppel/core/npy.h"

namespace doppel::support {

/// The base of every suite named Real*: finds the folder of published example data, or skips loudly without it.
class SharedFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* shared = std::getenv("DOPPEL_SHARED");
    if (!shared) GTEST_SKIP() << "DOPPEL_SHARED is not set: it names the folder with captures/s22 and oracle";
    shared_ = shared;
  }

  std::filesystem::path capture_folder() const { return shared_ / "captures" / "s22"; }
  std::filesystem::path character_file() const { return capture_folder() / "character" / "ddc.character"; }
  /// An array of the independent implementation: `oracle/<name>.npy`.
  NpyArray oracle(const std::string& name) const { return read_npy(shared_ / "oracle" / (name + ".npy")); }

  std::filesystem::path shared_;
};

}  // namespace doppel::support
