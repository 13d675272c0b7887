#pragma once

#include <array>
#include <filesystem>
#include <string>

#include "doppel/core/fetch/package_files.h"

namespace doppel {

/// Which of BlazePose's landmark networks: larger ones are slower and more accurate.
enum class BlazePoseModel { lite, full, heavy };
std::string to_string(BlazePoseModel model);
/// @throws UsageError for a word that `to_string` does not return
BlazePoseModel parse_blazepose_model(const std::string& word);

/// The package of all networks: MediaPipe's, under the Apache License 2.0.
extern const Package kModelPackage;
inline constexpr PackageFile kDetectorFile = {"pose_solution_packed_assets.data",
                                              "a63c614bef30d35947f13be361820b1e4e3bec9cfeebf4d11216a18373108e85"};
inline constexpr std::array<PackageFile, 3> kLandmarkFiles = {{
    {"pose_landmark_lite.tflite", "f17bfbecadb61c3be1baa8b8d851cc6619c870a87167b32848ad20db306b9d61"},
    {"pose_landmark_full.tflite", "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f"},
    {"pose_landmark_heavy.tflite", "59e42d71bcd44cbdbabc419f0ff76686595fd265419566bd4009ef703ea8e1fe"},
}};
/// The file of a landmark network.
const PackageFile& landmark_file(BlazePoseModel model);

/// The path of a model file, which is fetched on first use (core/fetch/package_files.h).
inline std::filesystem::path find_model(const PackageFile& file,
                                        const std::filesystem::path& folder = models_folder()) {
  return find_package_file(kModelPackage, file, folder);
}

}  // namespace doppel
