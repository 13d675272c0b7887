#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "doppel/core/appended_file.h"

namespace doppel {

/// Appends to a TensorBoard event file. Its name is `<folder>/events.out.tfevents.<time>.<host>.<process>`. A resumed
/// run opens a new file, whose first record tells TensorBoard to ignore later steps in older files.
class TensorBoardWriter {
 public:
  TensorBoardWriter(const std::filesystem::path& folder, std::int64_t first_step);

  void add_scalars(std::int64_t step, const std::vector<std::pair<std::string, double>>& scalars);
  /// @param image 8-bit BGR
  void add_image(std::int64_t step, const std::string& tag, const cv::Mat& image);
  /// @throws Error when records cannot be written
  void finish() { file_.finish(); }
  const std::filesystem::path& path() const { return path_; }

 private:
  void write_record(const std::string& event);
  std::filesystem::path path_;
  AppendedFile file_;
};

}  // namespace doppel
