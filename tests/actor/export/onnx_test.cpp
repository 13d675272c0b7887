#include <gtest/gtest.h>

#include <cstdlib>

#include "actor/export/dressed_actor.h"
#include "actor/export/untrained_pose.h"
#include "doppel/actor/export/onnx_file.h"
#include "doppel/actor/export/pose_trace.h"
#include "doppel/actor/onnx/onnx_constants.h"
#include "doppel/core/npy.h"
#include "support/temporary_folder.h"

namespace doppel::onnx_test {
namespace {

using support::TemporaryFolder;
using torch::Tensor;

void write(const std::filesystem::path& path, const Tensor& values) {
  const Tensor plain = values.detach().contiguous().to(torch::kFloat32);
  write_npy(path, plain.data_ptr<float>(), plain.sizes().vec());
}

/// What `node check_onnx.mjs` says of the models of a folder; 77 where the packages cannot be installed.
int check(const TemporaryFolder& folder, const std::string& options = "") {
  const int installed = std::system(WEB_TESTS "/modules.sh");
  if (installed != 0) return WEXITSTATUS(installed);
  return WEXITSTATUS(
      std::system(("node " WEB_TESTS "/check_onnx.mjs " + options + " '" + (folder / "").string() + "'").c_str()));
}

/// An actor as three models, with values on windows and batch sizes that the export has not seen.
void write_dressed(const TemporaryFolder& folder, int bits = 0) {
  const torch::NoGradGuard no_grad;
  TrainedActor actor = support::dressed_actor();
  ActorDescription description = support::description_of(actor);
  const ActorFunction geometry = [&](const Tensor& window) { return actor.fine(window); };
  const LookFunction texture = [&](const Tensor& window, const Tensor& p, const Tensor& v) {
    return actor.texture(window, p, v);
  };
  const LookFunction gaussians = [&](const Tensor& window, const Tensor& p, const Tensor& v) {
    return actor.gaussian_rows(window, p, v);
  };
  const ScriptModules modules{{"egnet", actor.egnet.get()},
                              {"deltanet", actor.deltanet.get()},
                              {"texnet", actor.texnet.get()},
                              {"surface_gaussians", actor.gaussians.get()}};
  const QuantizedWeights quantized = bits > 0 ? QuantizedWeights(modules, bits) : QuantizedWeights();
  write_actor_onnx(folder / "complete.onnx", actor.character, description, {geometry, texture, gaussians}, modules,
                   quantized);
  description.num_gaussians = 0;
  write_actor_onnx(folder / "textured.onnx", actor.character, description, {geometry, texture}, modules, quantized);
  description.texture_size = 0;
  write_actor_onnx(folder / "geometry.onnx", actor.character, description, {geometry}, modules, quantized);
  for (const StoredWeight& weight : quantized.stored(read_onnx_constants(folder / "complete.onnx")))
    weight.parameter.copy_(weight.weight);  // the values below are those of the quantized actor
  for (const auto& [name, batch] : {std::pair{"complete", 2}, std::pair{"textured", 3}, std::pair{"geometry", 1}}) {
    const auto path = [&](const char* value) { return folder / (std::string(name) + "." + value + ".npy"); };
    const Tensor window = random_windows(description, batch, 21), projection = random_projections(batch, 22);
    write(path("window"), window);
    write(path("vertices"), geometry(window));
    write(path("projection"), projection);
    write(path("texture"), texture(window, projection, geometry(window)));
    write(path("gaussians"), gaussians(window, projection, geometry(window)));
  }
}

TEST(OnnxFileAgrees, GeometryTextureAndGaussiansInOnnxRuntime) {
  const TemporaryFolder folder;
  write_dressed(folder);
  const int code = check(folder);
  if (code == 77) GTEST_SKIP() << "node or its packages are missing: ONNX Runtime was not tried";
  EXPECT_EQ(code, 0);
}

// The operators of quantized weights compute the weights that the comparison of the export computes.
TEST(OnnxFileAgrees, QuantizedIn8And16BitsInOnnxRuntime) {
  for (const int bits : {8, 16}) {
    const TemporaryFolder folder;
    write_dressed(folder, bits);
    const int code = check(folder);
    if (code == 77) GTEST_SKIP() << "node or its packages are missing: ONNX Runtime was not tried";
    EXPECT_EQ(code, 0) << bits << " bits";
  }
}

TEST(OnnxFileAgrees, GeometryTextureAndGaussiansInABrowser) {
  if (std::system("command -v chromium >/dev/null") != 0) GTEST_SKIP() << "chromium is not installed";
  const TemporaryFolder folder;
  write_dressed(folder);
  const int code = check(folder, "--browser");
  if (code == 77) GTEST_SKIP() << "node or its packages are missing: the browser was not tried";
  EXPECT_EQ(code, 0);
}

void check_pose(int bits) {
  const TemporaryFolder folder;
  const torch::NoGradGuard no_grad;
  TrainedPose trained = support::untrained_pose(/*with_defnet=*/true);
  const QuantizedWeights quantized =
      bits > 0 ? QuantizedWeights({{"posenet", trained.posenet.get()}, {"defnet", trained.defnet.get()}}, bits)
               : QuantizedWeights();
  write_pose_onnx(folder / "pose.onnx", trained, quantized);
  const std::vector<StoredWeight> stored = quantized.stored(read_onnx_constants(folder / "pose.onnx"));
  EXPECT_EQ(stored.size(), quantized.all().size());
  for (const StoredWeight& weight : stored) weight.parameter.copy_(weight.weight);
  const auto traced = traced_pose(trained);
  const torch::jit::Stack inputs = sample_of_placed(traced.description, 4);
  write(folder / "pose.image.npy", inputs[0].toTensor());
  write(folder / "pose.rotation.npy", inputs[2].toTensor());
  const auto outputs = traced.file.module().get_method("forward")({inputs[0], inputs[2]}).toTuple();
  write(folder / "pose.dofs.npy", outputs->elements()[0].toTensor());
  write(folder / "pose.landmarks.npy", outputs->elements()[1].toTensor());
  write(folder / "pose.vertices.npy", outputs->elements()[2].toTensor());
  const int code = check(folder);
  if (code == 77) GTEST_SKIP() << "node or its packages are missing: ONNX Runtime was not tried";
  EXPECT_EQ(code, 0);
}

TEST(OnnxFileAgrees, PoseAndSurfaceFromImages) { check_pose(0); }
TEST(OnnxFileAgrees, PoseAndSurfaceFromImagesIn8Bits) { check_pose(8); }

}  // namespace
}  // namespace doppel::onnx_test
