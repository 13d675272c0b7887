// Captures a person from one image with an exported Doppel pose file. Needs LibTorch and nothing else.
//   pose_host pose.pt image.ppm view.txt OUT
// image.ppm is what the camera saw without lens distortion, black where the person is not. view.txt holds lines of
// words and numbers, in any order:
//   intrinsics    9 numbers, row by row
//   rotation      9 numbers, row by row: camera from world
//   translation   3 numbers: camera from world, metres
//   keypoint NAME x y confidence       any number of these; names are the file's landmark_names
// Writes OUT.obj, the surface, and OUT.motion, the pose. With a camera and keypoints both are in the world, and OUT.ppm
// shows vertices and landmarks over the image; without, the person stands at the origin.
#include <torch/script.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <map>
#include <sstream>

#include "../host_files.h"

namespace {

struct View {
  torch::Tensor intrinsics, rotation, translation;      // [1,3,3], [1,3,3], [1,3]
  std::map<std::string, std::vector<float>> keypoints;  // x, y, confidence
  bool placed() const { return intrinsics.defined() && translation.defined() && !keypoints.empty(); }
};

View read_view(const std::string& path) {
  std::ifstream in(path);
  if (!in) throw std::runtime_error(path + " cannot be read");
  View view;
  view.rotation = torch::diag(torch::tensor({1.f, -1.f, -1.f})).unsqueeze(0);  // a level camera that looks along -z
  const auto tensor = [&](const std::vector<float>& values, std::vector<int64_t> shape, const std::string& line) {
    if (values.size() != (shape.size() == 3 ? 9u : 3u))
      throw std::runtime_error(path + ": too few or many numbers: " + line);
    return torch::tensor(values).view(shape);
  };
  for (std::string line, word, name; std::getline(in, line);) {
    std::istringstream row(line);
    if (!(row >> word)) continue;
    if (word == "keypoint") row >> name;
    const std::vector<float> values{std::istream_iterator<float>(row), {}};
    if (word == "intrinsics")
      view.intrinsics = tensor(values, {1, 3, 3}, line);
    else if (word == "rotation")
      view.rotation = tensor(values, {1, 3, 3}, line);
    else if (word == "translation")
      view.translation = tensor(values, {1, 3}, line);
    else if (word == "keypoint" && values.size() == 3)
      view.keypoints[name] = values;
    else
      throw std::runtime_error(path + ": not understood: " + line);
  }
  return view;
}

/// The square that the network sees: left, top, side.
struct Window {
  float left, top, side;
};

/// Around the keypoints that count, or, with fewer than four, around the pixels that are not black.
Window window_of(const host::Image& image, const View& view, float threshold, float margin) {
  constexpr float kFar = std::numeric_limits<float>::max();
  float low[2] = {kFar, kFar}, high[2] = {-kFar, -kFar};
  const auto include = [&](float x0, float y0, float x1, float y1) {
    low[0] = std::min(low[0], x0), low[1] = std::min(low[1], y0);
    high[0] = std::max(high[0], x1), high[1] = std::max(high[1], y1);
  };
  int count = 0;
  for (const auto& [name, point] : view.keypoints)
    if (point[2] >= threshold) include(point[0], point[1], point[0], point[1]), ++count;
  if (count < 4) {
    low[0] = low[1] = kFar, high[0] = high[1] = -kFar;
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x) {
        const uint8_t* pixel = image.at(x, y);
        if (pixel[0] || pixel[1] || pixel[2]) include(x, y, x + 1, y + 1);
      }
  }
  const float longer = std::max(high[0] - low[0], high[1] - low[1]);
  if (!(longer > 0)) throw std::runtime_error("the image is black: there is nobody to capture");
  const float side = (1 + 2 * margin) * longer;
  return {(low[0] + high[0] - side) / 2, (low[1] + high[1] - side) / 2, side};
}

/// The window as [1,3,size,size], 0..1: means of evenly spread points, bilinear, black beyond the image.
torch::Tensor crop(const host::Image& image, const Window& window, int size) {
  torch::Tensor result = torch::zeros({1, 3, size, size});
  auto out = result.accessor<float, 4>();
  const float step = window.side / size;
  const int n = std::max(1, int(std::ceil(step)));
  const auto sample = [&](float u, float v, float weight, int row, int column) {
    const int x = int(std::floor(u)), y = int(std::floor(v));
    for (int k = 0; k < 4; ++k) {
      const int px = x + k % 2, py = y + k / 2;
      if (px < 0 || py < 0 || px >= image.width || py >= image.height) continue;
      const float share = (k % 2 ? u - x : 1 - u + x) * (k / 2 ? v - y : 1 - v + y) * weight / 255;
      for (int c = 0; c < 3; ++c) out[0][c][row][column] += share * image.at(px, py)[c];
    }
  };
  for (int row = 0; row < size; ++row)
    for (int column = 0; column < size; ++column)
      for (int i = 0; i < n * n; ++i)
        sample(window.left + step * (column + (i % n + .5f) / n) - .5f,
               window.top + step * (row + (i / n + .5f) / n) - .5f, 1.f / (n * n), row, column);
  return result;
}

/// [1,M,3] in the order of `names`; what is not in the view has no confidence.
torch::Tensor keypoint_tensor(const View& view, const std::vector<std::string>& names) {
  torch::Tensor result = torch::zeros({1, int64_t(names.size()), 3});
  for (const auto& [name, point] : view.keypoints) {
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) throw std::runtime_error("the file knows no landmark '" + name + "'");
    result[0][found - names.begin()] = torch::tensor(point);
  }
  return result;
}

/// Mixes a colour into the pixels around the projections of points [n,3].
void draw_points(host::Image& image, const torch::Tensor& points, const View& view, int radius, float share,
                 const float (&colour)[3]) {
  const torch::Tensor in_camera = points.matmul(view.rotation[0].t()) + view.translation[0];
  const torch::Tensor pixels = in_camera.matmul(view.intrinsics[0].t()).contiguous();
  const auto p = pixels.accessor<float, 2>();
  for (int64_t i = 0; i < pixels.size(0); ++i) {
    const float u = p[i][0] / p[i][2], v = p[i][1] / p[i][2];
    if (!(p[i][2] > 0) || !(std::abs(u) < 1e6f) || !(std::abs(v) < 1e6f)) continue;
    for (int y = int(std::floor(v)) - radius; y <= int(std::floor(v)) + radius; ++y)
      for (int x = int(std::floor(u)) - radius; x <= int(std::floor(u)) + radius; ++x) {
        if (x < 0 || y < 0 || x >= image.width || y >= image.height) continue;
        for (int c = 0; c < 3; ++c) {
          uint8_t& value = image.at(x, y)[c];
          value = uint8_t(std::lround((1 - share) * value + share * colour[c]));
        }
      }
  }
}

void write_obj(const std::string& path, const torch::Tensor& vertices, const std::vector<int32_t>& faces) {
  std::ofstream out(path);
  out.precision(7);
  const auto v = vertices.accessor<float, 2>();
  for (int64_t i = 0; i < vertices.size(0); ++i) out << "v " << v[i][0] << " " << v[i][1] << " " << v[i][2] << "\n";
  for (size_t f = 0; f + 2 < faces.size(); f += 3)
    out << "f " << faces[f] + 1 << " " << faces[f + 1] + 1 << " " << faces[f + 2] + 1 << "\n";
  if (!out) throw std::runtime_error(path + " cannot be written");
}

void write_motion(const std::string& path, const torch::Tensor& dofs) {
  std::ofstream out(path);
  out.precision(9);
  out << "Skeletool Motion File V1.0\n0";
  for (int64_t d = 0; d < dofs.size(0); ++d) out << " " << dofs[d].item<float>();
  out << "\n";
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return std::cerr << "usage: pose_host POSE.pt PICTURE.ppm VIEW.txt OUT\n", 2;
  try {
    torch::NoGradGuard no_grad;
    torch::jit::FusionStrategy none;  // with the fuser of LibTorch 2.6, the second call does not return
    torch::jit::setFusionStrategy(none);
    torch::jit::ExtraFilesMap extra{{"metadata.json", ""}, {"faces.npy", ""}};
    torch::jit::Module pose = torch::jit::load(argv[1], c10::nullopt, extra);
    const std::string& about = extra["metadata.json"];
    if (about.find("\"doppel_pose\"") == std::string::npos)
      throw std::runtime_error(std::string(argv[1]) + " is not a pose file");
    host::Image image = host::read_ppm(argv[2]);
    const View view = read_view(argv[3]);
    const std::string out = argv[4];

    const Window window = window_of(image, view, float(host::number_in(about, "window_confidence")),
                                    float(host::number_in(about, "margin")));
    const torch::Tensor person = crop(image, window, int(host::number_in(about, "input_size")));
    std::vector<torch::jit::IValue> inputs{person, view.rotation};
    if (view.placed())
      inputs = {person, view.intrinsics, view.rotation, view.translation,
                keypoint_tensor(view, host::words_in(about, "landmark_names"))};
    const auto result = pose.get_method(view.placed() ? "placed" : "forward")(inputs).toTuple()->elements().vec();
    const torch::Tensor dofs = result[0].toTensor()[0].contiguous(), landmarks = result[1].toTensor()[0],
                        vertices = result[2].toTensor()[0].contiguous();
    write_obj(out + ".obj", vertices, host::numbers<int32_t>(extra["faces.npy"]));
    write_motion(out + ".motion", dofs);
    std::cout << vertices.size(0) << " vertices written to " << out << ".obj\n";
    if (!view.placed()) return 0;
    if (!result[3].toTensor().item<bool>()) std::cout << "the keypoints do not determine where the person is\n";
    draw_points(image, vertices, view, 0, .5f, {80, 160, 255});
    draw_points(image, landmarks, view, 1, 1.f, {255, 60, 40});
    host::write_ppm(out + ".ppm", image);
  } catch (const std::exception& e) {
    return std::cerr << "pose_host: " << e.what() << "\n", 1;
  }
}
