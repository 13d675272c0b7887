// Poses an exported Doppel actor, and draws it if it has a dynamic texture. Needs LibTorch and nothing else.
//   actor_host actor.pt poseAngles.motion vertices.f32 [image.ppm]
// writes the posed vertices of every frame as raw float32 [frames, vertices, 3] in metres, world space, and the last
// frame as an image.
#include <torch/script.h>

#include <fstream>
#include <iostream>
#include <sstream>

#include "draw.h"

namespace {

/// The rows of a motion file, [frames, dofs].
torch::Tensor read_motion(const char* path) {
  std::ifstream motion(path);
  std::string line;
  std::getline(motion, line);  // "Skeletool Motion File V1.0"; V0.1 has angles of the opposite sign
  const bool negated = line.find("V0.1") != std::string::npos;
  std::vector<torch::Tensor> frames;
  while (std::getline(motion, line)) {
    std::istringstream row(line);
    std::vector<float> numbers{std::istream_iterator<float>(row), {}};
    if (numbers.size() > 1)  // the first number is the frame's id
      frames.push_back(torch::tensor(std::vector<float>(numbers.begin() + 1, numbers.end())));
  }
  if (frames.empty()) throw std::runtime_error("no frames in the motion");
  torch::Tensor motion_rows = torch::stack(frames);
  if (negated) motion_rows.slice(1, 3).neg_();
  return motion_rows;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4 && argc != 5) return std::cerr << "usage: actor_host ACTOR.pt MOTION.motion OUT.f32 [PICTURE.ppm]\n", 2;
  try {
    torch::NoGradGuard no_grad;
    torch::jit::FusionStrategy none;  // with the fuser of LibTorch 2.6, the second call does not return
    torch::jit::setFusionStrategy(none);
    torch::jit::ExtraFilesMap extra{{"metadata.json", ""}, {"faces.npy", ""}, {"uvs.npy", ""}, {"face_uvs.npy", ""}};
    torch::jit::Module actor = torch::jit::load(argv[1], c10::nullopt, extra);
    const torch::Tensor motion = read_motion(argv[2]);
    const auto window = static_cast<int64_t>(host::number_in(extra["metadata.json"], "window"));

    std::ofstream out(argv[3], std::ios::binary);
    torch::Tensor rows, vertices;
    for (int64_t t = 0; t < motion.size(0); ++t) {
      // The last poses, oldest first; the first frame repeats where history is missing.
      rows = motion.index_select(0, torch::arange(t - window + 1, t + 1).clamp_min(0)).unsqueeze(0);
      vertices = actor.forward({rows}).toTensor().contiguous();
      out.write(reinterpret_cast<const char*>(vertices.data_ptr<float>()), vertices.nbytes());
    }
    std::cout << motion.size(0) << " frames written to " << argv[3] << "\n";
    if (argc == 4) return 0;
    if (!actor.find_method("textured")) {
      std::cout << argv[1] << " has no dynamic texture, so " << argv[4] << " is not drawn\n";
      return 0;
    }

    const torch::Tensor projection = draw::look_at(vertices[0]);
    const auto dressed = actor.get_method("textured")({rows, projection}).toTuple();
    draw::write_image(argv[4], dressed->elements()[0].toTensor()[0], dressed->elements()[1].toTensor()[0],
                      projection[0], extra);
    std::cout << "image written to " << argv[4] << "\n";
  } catch (const std::exception& e) {
    return std::cerr << "actor_host: " << e.what() << "\n", 1;
  }
}
