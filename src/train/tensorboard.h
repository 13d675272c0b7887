#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

namespace doppel {

/// Appends to a TensorBoard event file `<folder>/events.out.tfevents.<time>.<host>.<process>`. A resumed run opens a
/// new file, whose first record tells TensorBoard to ignore later steps in older files.
class TensorBoardWriter {
 public:
  TensorBoardWriter(const std::filesystem::path& folder, std::int64_t first_step);
  ~TensorBoardWriter();
  TensorBoardWriter(const TensorBoardWriter&) = delete;
  TensorBoardWriter& operator=(const TensorBoardWriter&) = delete;

  void add_scalars(std::int64_t step, const std::vector<std::pair<std::string, double>>& scalars);
  /// @param image 8-bit BGR
  void add_image(std::int64_t step, const std::string& tag, const cv::Mat& image);
  const std::filesystem::path& path() const { return path_; }

 private:
  void write_record(const std::string& event);
  std::filesystem::path path_;
  std::FILE* file_ = nullptr;
};

/// The records of an event file: payloads whose length and content checksums were verified.
/// @throws FileError at the first record that is cut short or damaged
std::vector<std::string> read_event_records(const std::filesystem::path& path);

}  // namespace doppel
