#pragma once

#include <exception>

#include "doppel/detect/blazepose/model_files.h"
#include "support/shared_folder.h"

namespace doppel::support {

/// Skips where neither the cache nor the network gives the weights of BlazePose.
class BlazePoseTest : public SharedFolderTest {
 protected:
  void SetUp() override {
    SharedFolderTest::SetUp();
    if (IsSkipped()) return;
    require_weights(kModelPackage, kDetectorFile);
    for (const PackageFile& file : kLandmarkFiles) require_weights(kModelPackage, file);
  }

  /// Skips the test where neither the cache nor the network gives a file.
  static void require_weights(const Package& package, const PackageFile& file) {
    if (IsSkipped()) return;
    try {
      find_package_file(package, file);
    } catch (const std::exception& error) {
      GTEST_SKIP() << "the weights of " << package.name << " are not here: " << error.what();
    }
  }
};

}  // namespace doppel::support
