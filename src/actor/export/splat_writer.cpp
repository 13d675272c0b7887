#include "doppel/actor/export/splat_writer.h"

#include <fmt/format.h>

#include "doppel/actor/export/splat_file.h"
#include "doppel/render/projection.h"

namespace doppel {
namespace {

class SplatWriter : public SequenceWriter {
 public:
  SplatWriter(const std::filesystem::path& folder, SplatFunction splats, std::unique_ptr<CameraPath> path,
              const SplatFormats& formats)
      : folder_(folder), splats_(std::move(splats)), path_(std::move(path)), formats_(formats) {}

  void write(const PosedFrame& frame) override {
    torch::NoGradGuard no_grad;
    const torch::Tensor projection = projection_tensor({path_->at(frame_, frame.vertices)});
    const Splats splats = splats_(frame.window.unsqueeze(0), projection, tensor_of(frame));
    const auto file = folder_ / fmt::format("splats_{:06}", frame_++);
    if (formats_.ply) write_splat_ply(file.string() + ".ply", splats);
    if (formats_.glb) write_splat_glb(file.string() + ".glb", splats);
  }
  void close() override {}

 private:
  std::filesystem::path folder_;
  SplatFunction splats_;
  std::unique_ptr<CameraPath> path_;
  SplatFormats formats_;
  int frame_ = 0;
};

}  // namespace

std::unique_ptr<SequenceWriter> make_splat_writer(const std::filesystem::path& folder, SplatFunction splats,
                                                  std::unique_ptr<CameraPath> path, const SplatFormats& formats) {
  return std::make_unique<SplatWriter>(folder, std::move(splats), std::move(path), formats);
}

}  // namespace doppel
