#include "doppel/actor/export/texture_writer.h"

#include <fmt/format.h>

#include "doppel/core/tensor/image_tensor.h"
#include "doppel/geometry/image_file.h"
#include "doppel/render/projection.h"

namespace doppel {
namespace {

class TextureWriter : public SequenceWriter {
 public:
  TextureWriter(const std::filesystem::path& folder, LookFunction texture, std::unique_ptr<CameraPath> path)
      : folder_(folder), texture_(std::move(texture)), path_(std::move(path)) {}

  void write(const PosedFrame& frame) override {
    torch::NoGradGuard no_grad;
    const torch::Tensor projection = projection_tensor({path_->at(frame_, frame.vertices)});
    const cv::Mat texture = image_of(texture_(frame.window.unsqueeze(0), projection, tensor_of(frame))[0]);
    write_image(folder_ / fmt::format("texture_{:06}.png", frame_++), texture);
  }
  void close() override {}

 private:
  std::filesystem::path folder_;
  LookFunction texture_;
  std::unique_ptr<CameraPath> path_;
  int frame_ = 0;
};

}  // namespace

std::unique_ptr<SequenceWriter> make_texture_writer(const std::filesystem::path& folder, LookFunction texture,
                                                    std::unique_ptr<CameraPath> path) {
  return std::make_unique<TextureWriter>(folder, std::move(texture), std::move(path));
}

}  // namespace doppel
