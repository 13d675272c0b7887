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
    try {
      find_model(kDetectorFile);
      for (const PackageFile& file : kLandmarkFiles) find_model(file);
    } catch (const std::exception& error) {
      GTEST_SKIP() << "the weights of BlazePose are not here: " << error.what();
    }
  }
};

}  // namespace doppel::support
