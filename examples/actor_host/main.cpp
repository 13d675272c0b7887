// Poses an exported Doppel actor. Needs LibTorch and nothing else.
//   actor_host actor.pt poseAngles.motion vertices.f32
// writes the posed vertices of every frame as raw float32 [frames, vertices, 3] in metres, world space.
#include <torch/script.h>

#include <fstream>
#include <iostream>
#include <sstream>

int main(int argc, char** argv) {
  if (argc != 4) return std::cerr << "usage: actor_host ACTOR.pt MOTION.motion OUT.f32\n", 2;
  try {
    torch::NoGradGuard no_grad;
    torch::jit::Module actor = torch::jit::load(argv[1]);

    std::ifstream motion(argv[2]);
    std::string line;
    std::getline(motion, line);  // "Skeletool Motion File V1.0"
    std::vector<torch::Tensor> frames;
    while (std::getline(motion, line)) {
      std::istringstream row(line);
      std::vector<float> numbers{std::istream_iterator<float>(row), {}};
      if (numbers.size() > 1)  // the first number is the frame's id
        frames.push_back(torch::tensor(std::vector<float>(numbers.begin() + 1, numbers.end())));
    }
    if (frames.empty()) throw std::runtime_error("no frames in the motion");

    std::ofstream out(argv[3], std::ios::binary);
    for (size_t t = 0; t < frames.size(); ++t) {
      // The window of the last three poses, oldest first; the first frame repeats where history is missing.
      const auto& past = frames[t < 2 ? 0 : t - 2];
      const auto window = torch::stack({past, frames[t < 1 ? 0 : t - 1], frames[t]}).unsqueeze(0);
      const torch::Tensor vertices = actor.forward({window}).toTensor().contiguous();
      out.write(reinterpret_cast<const char*>(vertices.data_ptr<float>()), vertices.nbytes());
    }
    std::cout << frames.size() << " frames written to " << argv[3] << "\n";
  } catch (const std::exception& e) {
    return std::cerr << "actor_host: " << e.what() << "\n", 1;
  }
}
