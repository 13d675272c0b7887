#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "doppel/core/error.h"
#include "doppel/export/animation.h"
#include "doppel/render/rasterizer.h"

namespace doppel {
namespace {

constexpr int kSupersampling = 2;
constexpr double kPi = 3.14159265358979323846;
constexpr float kAmbient = 0.55f, kKey = 0.5f;  // shares of the light from everywhere and from the key
const Eigen::Vector3f kKeyDirection = Eigen::Vector3f(0.4f, 0.8f, 0.45f).normalized();  // in the camera's y-up frame
const cv::Vec3b kBackground(52, 46, 44);

/// A still image of the textured surface: nearest face per pixel, bilinear texture, Lambert under one light and the
/// sky.
class Shader {
 public:
  explicit Shader(const Character& character) : mesh_(character.mesh), rasterizer_(face_tensor(character.mesh)) {}

  cv::Mat render(const std::vector<Eigen::Vector3f>& vertices, const Eigen::Matrix3f& R, const Eigen::Vector3f& t,
                 int size) {
    const int pixels = size * kSupersampling;
    torch::Tensor in_camera = torch::empty({1, static_cast<std::int64_t>(vertices.size()), 3});
    float* out = in_camera.data_ptr<float>();
    for (const Eigen::Vector3f& v : vertices) {
      const Eigen::Vector3f x = R * v + t;
      out = std::copy(x.data(), x.data() + 3, out);
    }
    const float focal = 1.8f * static_cast<float>(pixels), centre = 0.5f * static_cast<float>(pixels);
    const RasterImage& raster =
        rasterizer_.rasterize(in_camera, torch::tensor({{focal, focal, centre, centre}}), pixels, pixels);
    return shade(raster, normals(vertices), R, pixels, size);
  }

 private:
  static torch::Tensor face_tensor(const TriangleMesh& mesh) {
    return torch::from_blob(const_cast<int*>(mesh.faces.front().data()), {mesh.num_faces(), 3}, torch::kInt32).clone();
  }

  std::vector<Eigen::Vector3f> normals(const std::vector<Eigen::Vector3f>& vertices) const {
    std::vector<Eigen::Vector3f> sums(vertices.size(), Eigen::Vector3f::Zero());
    for (const Triangle& face : mesh_.faces) {
      const auto corner = [&](int i) { return vertices[static_cast<std::size_t>(face[static_cast<std::size_t>(i)])]; };
      const Eigen::Vector3f area = (corner(1) - corner(0)).cross(corner(2) - corner(0));
      for (int i : face) sums[static_cast<std::size_t>(i)] += area;
    }
    return sums;
  }

  cv::Mat shade(const RasterImage& raster, const std::vector<Eigen::Vector3f>& vertex_normals, const Eigen::Matrix3f& R,
                int pixels, int size) const {
    cv::Mat image(pixels, pixels, CV_8UC3, cv::Scalar(kBackground[0], kBackground[1], kBackground[2]));
    const int* ids = raster.face_id.data_ptr<int>();
    const float* weights = raster.barycentrics.data_ptr<float>();
    const Eigen::Vector3f key =
        R.transpose() * Eigen::Vector3f(kKeyDirection.x(), -kKeyDirection.y(), -kKeyDirection.z());
    const Eigen::Vector3f towards_camera = -R.row(2).transpose();
    for (int pixel = 0; pixel < pixels * pixels; ++pixel) {
      if (ids[pixel] < 0) continue;
      const auto face = static_cast<std::size_t>(ids[pixel]);
      Eigen::Vector3f normal = Eigen::Vector3f::Zero();
      for (std::size_t i = 0; i < 3; ++i)
        normal +=
            weights[3 * pixel + static_cast<int>(i)] * vertex_normals[static_cast<std::size_t>(mesh_.faces[face][i])];
      normal.normalize();
      if (normal.dot(towards_camera) < 0) normal = -normal;
      const float light = kAmbient * (0.75f + 0.25f * normal.y()) + kKey * std::max(0.0f, normal.dot(key));
      const cv::Vec3f albedo = colour(face, weights + 3 * pixel);
      image.at<cv::Vec3b>(pixel / pixels, pixel % pixels) =
          cv::Vec3b(cv::saturate_cast<uchar>(albedo[0] * light), cv::saturate_cast<uchar>(albedo[1] * light),
                    cv::saturate_cast<uchar>(albedo[2] * light));
    }
    cv::resize(image, image, {size, size}, 0, 0, cv::INTER_AREA);
    return image;
  }

  /// BGR 0..255 of a point on a face: texture, else vertex colours, else grey.
  cv::Vec3f colour(std::size_t face, const float* weights) const {
    if (!mesh_.texture.empty() && !mesh_.face_uvs.empty()) {
      Eigen::Vector2d uv = Eigen::Vector2d::Zero();
      for (std::size_t i = 0; i < 3; ++i)
        uv += weights[i] * mesh_.uvs[static_cast<std::size_t>(mesh_.face_uvs[face][i])];
      cv::Mat texel;
      cv::getRectSubPix(mesh_.texture, {1, 1},
                        {static_cast<float>(uv.x() * mesh_.texture.cols - 0.5),
                         static_cast<float>((1 - uv.y()) * mesh_.texture.rows - 0.5)},
                        texel);
      return texel.at<cv::Vec3b>(0, 0);
    }
    if (mesh_.colours.empty()) return {190, 190, 190};
    Eigen::Vector3d rgb = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < 3; ++i)
      rgb += weights[i] * mesh_.colours[static_cast<std::size_t>(mesh_.faces[face][i])];
    return {static_cast<float>(255 * rgb.z()), static_cast<float>(255 * rgb.y()), static_cast<float>(255 * rgb.x())};
  }

  const TriangleMesh& mesh_;
  Rasterizer rasterizer_;
};

class VideoWriter : public SequenceWriter {
 public:
  VideoWriter(const std::filesystem::path& folder, const Character& character, const TurntableOptions& options)
      : options_(options),
        num_vertices_(character.num_vertices()),
        shader_(character),
        path_(folder / "turntable.mp4"),
        temporary_(folder / ".turntable.part.mp4") {
    double lowest = 1e9, highest = -1e9;
    for (const Eigen::Vector3d& v : character.mesh.vertices) {
      lowest = std::min(lowest, v.y());
      highest = std::max(highest, v.y());
    }
    height_ = static_cast<float>(highest - lowest);
    std::filesystem::create_directories(folder);
    video_.open(temporary_.string(), cv::VideoWriter::fourcc('m', 'p', '4', 'v'), options.frames_per_second,
                {options.size, options.size});
    if (!video_.isOpened())
      fail("opening {} for writing: this OpenCV build has no encoder for MPEG-4 video", path_.string());
  }
  ~VideoWriter() override {
    if (!video_.isOpened()) return;
    video_.release();
    std::error_code ignored;
    std::filesystem::remove(temporary_, ignored);
  }

  void write(const float* vertices) override {
    std::vector<Eigen::Vector3f> points;
    Eigen::Vector3f centre = Eigen::Vector3f::Zero();
    for (int i = 0; i < num_vertices_; ++i) {
      points.emplace_back(vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]);
      centre += points.back() / static_cast<float>(num_vertices_);
    }
    // The camera follows smoothly: a jitter of the mean would shake the picture.
    centre_ = frame_ == 0 ? centre : Eigen::Vector3f(0.85f * centre_ + 0.15f * centre);
    const double angle = 2 * kPi * options_.turns_per_second * frame_++ / options_.frames_per_second;
    const Eigen::Vector3f forward(-std::sin(static_cast<float>(angle)), 0, -std::cos(static_cast<float>(angle)));
    Eigen::Matrix3f R;
    R.row(1) = Eigen::Vector3f(0, -1, 0);
    R.row(2) = forward;
    R.row(0) = R.row(1).cross(R.row(2));
    const Eigen::Vector3f eye = centre_ - 2.2f * height_ * forward;
    video_.write(shader_.render(points, R, -R * eye, options_.size));
  }

  void close() override {
    video_.release();
    std::filesystem::rename(temporary_, path_);
  }

 private:
  TurntableOptions options_;
  int num_vertices_, frame_ = 0;
  float height_ = 1.7f;
  Eigen::Vector3f centre_ = Eigen::Vector3f::Zero();
  Shader shader_;
  std::filesystem::path path_, temporary_;
  cv::VideoWriter video_;
};

}  // namespace

std::unique_ptr<SequenceWriter> make_video_writer(const std::filesystem::path& folder, const Character& character,
                                                  const TurntableOptions& options) {
  return std::make_unique<VideoWriter>(folder, character, options);
}

}  // namespace doppel
