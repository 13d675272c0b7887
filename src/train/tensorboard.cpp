#include "doppel/train/tensorboard.h"

#include <unistd.h>

#include <chrono>
#include <opencv2/imgcodecs.hpp>

#include "doppel/core/crc32c.h"
#include "doppel/core/process.h"
#include "tensorboard.pb.h"

namespace doppel {

namespace {

double now() { return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count(); }

/// TensorFlow's masked checksum: rotated and shifted, so that checksums of data that contain checksums remain useful.
std::uint32_t masked_crc(const void* data, std::size_t size) {
  const std::uint32_t crc = crc32c(data, size);
  return ((crc >> 15) | (crc << 17)) + 0xa282ead8u;
}

template <typename T>
void append_little_endian(std::string& out, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i) out.push_back(static_cast<char>((value >> (8 * i)) & 255u));
}

tensorboard::Event make_event(std::int64_t step) {
  tensorboard::Event event;
  event.set_wall_time(now());
  event.set_step(step);
  return event;
}

std::filesystem::path new_file(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  return folder / fmt::format("events.out.tfevents.{}.{}.{}", static_cast<long>(now()), host_name(), getpid());
}

}  // namespace

TensorBoardWriter::TensorBoardWriter(const std::filesystem::path& folder, std::int64_t first_step)
    : path_(new_file(folder)), file_(path_) {
  tensorboard::Event version = make_event(0);
  version.set_file_version("brain.Event:2");
  write_record(version.SerializeAsString());
  tensorboard::Event start = make_event(first_step);
  start.mutable_session_log()->set_status(tensorboard::SessionLog::START);
  write_record(start.SerializeAsString());
}

void TensorBoardWriter::write_record(const std::string& event) {
  std::string header, footer;
  append_little_endian<std::uint64_t>(header, event.size());
  append_little_endian<std::uint32_t>(header, masked_crc(header.data(), header.size()));
  append_little_endian<std::uint32_t>(footer, masked_crc(event.data(), event.size()));
  file_.append(header + event + footer);
}

void TensorBoardWriter::add_scalars(std::int64_t step, const std::vector<std::pair<std::string, double>>& scalars) {
  tensorboard::Event event = make_event(step);
  for (const auto& [tag, number] : scalars) {
    tensorboard::Summary::Value* value = event.mutable_summary()->add_value();
    value->set_tag(tag);
    value->set_simple_value(static_cast<float>(number));
  }
  write_record(event.SerializeAsString());
}

void TensorBoardWriter::add_image(std::int64_t step, const std::string& tag, const cv::Mat& image) {
  std::vector<unsigned char> png;
  cv::imencode(".png", image, png);
  tensorboard::Event event = make_event(step);
  tensorboard::Summary::Value* value = event.mutable_summary()->add_value();
  value->set_tag(tag);
  value->mutable_image()->set_height(image.rows);
  value->mutable_image()->set_width(image.cols);
  value->mutable_image()->set_colorspace(image.channels());
  value->mutable_image()->set_encoded_image_string(png.data(), png.size());
  write_record(event.SerializeAsString());
}

}  // namespace doppel
