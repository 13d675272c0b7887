#include "doppel/export/texture_writer.h"

#include <fmt/format.h>

#include "doppel/core/error.h"
#include "doppel/geometry/image_file.h"
#include "doppel/render/image_tensor.h"
#include "doppel/render/projection.h"

namespace doppel {
namespace {

class TextureWriter : public SequenceWriter {
 public:
  TextureWriter(const std::filesystem::path& folder, const ActorFile& actor, std::unique_ptr<CameraPath> path)
      : folder_(folder), actor_(actor), path_(std::move(path)) {}

  void write(const PosedFrame& frame) override {
    torch::NoGradGuard no_grad;
    const torch::Tensor projection = projection_tensor({path_->at(frame_, frame.vertices)});
    const cv::Mat texture = image_of(actor_.textured(frame.window.unsqueeze(0), projection).second[0]);
    write_image(folder_ / fmt::format("texture_{:06}.png", frame_++), texture);
  }
  void close() override {}

 private:
  std::filesystem::path folder_;
  const ActorFile& actor_;
  std::unique_ptr<CameraPath> path_;
  int frame_ = 0;
};

}  // namespace

std::unique_ptr<SequenceWriter> make_texture_writer(const std::filesystem::path& folder, const ActorFile& actor,
                                                    std::unique_ptr<CameraPath> path) {
  if (actor.description().texture_size == 0)
    fail<UsageError>(
        "the actor {} has no dynamic texture; `doppel export` a run whose TexNet is trained, without --geometry-only",
        actor.description().name);
  return std::make_unique<TextureWriter>(folder, actor, std::move(path));
}

}  // namespace doppel
