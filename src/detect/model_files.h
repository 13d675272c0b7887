#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>

namespace doppel {

/// Which of BlazePose's landmark networks: larger ones are slower and more accurate.
enum class BlazePoseModel { lite, full, heavy };
std::string to_string(BlazePoseModel model);
/// @throws UsageError for a word that `to_string` does not return
BlazePoseModel parse_blazepose_model(const std::string& word);

/// One file of trained weights.
struct ModelFile {
  const char* name;    ///< in the models folder and in the package
  const char* sha256;  ///< 64 hexadecimal digits, lower case
};
/// The package that holds all files, as npm names it: MediaPipe's, under the Apache License 2.0.
inline constexpr char kModelPackage[] = "@mediapipe/pose@0.5.1675469404";
inline constexpr ModelFile kDetectorFile = {"pose_solution_packed_assets.data",
                                            "a63c614bef30d35947f13be361820b1e4e3bec9cfeebf4d11216a18373108e85"};
inline constexpr std::array<ModelFile, 3> kLandmarkFiles = {{
    {"pose_landmark_lite.tflite", "f17bfbecadb61c3be1baa8b8d851cc6619c870a87167b32848ad20db306b9d61"},
    {"pose_landmark_full.tflite", "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f"},
    {"pose_landmark_heavy.tflite", "59e42d71bcd44cbdbabc419f0ff76686595fd265419566bd4009ef703ea8e1fe"},
}};
/// The file of a landmark network.
const ModelFile& landmark_file(BlazePoseModel model);

/// Where model files are kept: $DOPPEL_MODELS, else $XDG_CACHE_HOME/doppel/models, else ~/.cache/doppel/models.
/// @throws Error when none of these variables is set
std::filesystem::path models_folder();

/// The path of a model file. If `folder` does not have it, the package is fetched with `npm pack`, and all of its model
/// files are checked and moved into `folder`. Several processes may do so at the same time.
/// @throws FileError when the file has another hash; Error when npm or tar is missing or fails, or the package holds
/// another file than expected. Messages say how to install npm and where to copy the files by hand.
std::filesystem::path find_model(const ModelFile& file, const std::filesystem::path& folder = models_folder());

/// SHA-256 of a file, 64 hexadecimal digits in lower case. @throws FileError when it cannot be read
std::string sha256_of(const std::filesystem::path& path);

}  // namespace doppel
