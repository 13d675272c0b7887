#pragma once

#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "doppel/calibration/formats/read_calibration.h"
#include "doppel/character/motion.h"
#include "doppel/core/npy.h"
#include "doppel/data/prepare/prepare.h"
#include "doppel/layers/surface.h"
#include "doppel/render/lighting/sh_lighting.h"
#include "doppel/render/projection.h"
#include "doppel/render/raster/rasterizer.h"
#include "doppel/render/shading/shading.h"
#include "support/ring_of_cameras.h"
#include "support/test_character.h"

/// A capture of the test character, made in code in well under a second: a ring of cameras, masks drawn from a surface
/// that is thicker than the skinned template by a known amount, true vertices beside it, prepared for training.
namespace doppel {

struct SmallCaptureOptions {
  int cameras = 3;
  int size = 128;      ///< pixels of the images
  int mask_size = 96;  ///< pixels of the crops
  int train_frames = 12, test_frames = 5;
  double thickness = 0.02;  ///< metres along the normal between skinned template and ground truth
  bool textured = false;    ///< the template has a smooth texture, and images show it under `true_light`
};

namespace small_capture {

inline std::vector<PinholeCamera> make_cameras(const SmallCaptureOptions& o, const Eigen::Vector3d& target) {
  return ring_of_cameras(o.cameras, o.size, target);
}

inline Motion make_motion(const Character& character, int frames, double phase) {
  Motion motion;
  for (int f = 0; f < frames; ++f) {
    std::vector<double> dofs = character.rest_dofs;
    for (std::size_t d = 6; d < dofs.size(); ++d)
      dofs[d] += 0.12 * std::sin(0.5 * f + phase + 1.7 * static_cast<double>(d));
    dofs[3] += 0.1 * std::sin(0.3 * f + phase);
    motion.frames.push_back(dofs);
    motion.ids.push_back(f);
  }
  return motion;
}

/// [F,N,3]: the skinned template moved out along its normals.
inline torch::Tensor true_surface(const Character& character, const Motion& motion, double thickness) {
  torch::NoGradGuard no_grad;
  torch::Tensor dofs = torch::empty({motion.num_frames(), character.num_dofs()});
  for (int f = 0; f < motion.num_frames(); ++f)
    for (int d = 0; d < character.num_dofs(); ++d) dofs[f][d] = motion.frames[f][d];
  torch::Tensor vertices = CharacterSurface(character)->skinned(dofs).clone();
  TriangleMesh mesh = character.mesh;
  for (int f = 0; f < motion.num_frames(); ++f) {
    const torch::Tensor frame = vertices[f];
    auto rows = frame.accessor<float, 2>();
    for (int v = 0; v < mesh.num_vertices(); ++v)
      mesh.vertices[v] = Eigen::Vector3d(rows[v][0], rows[v][1], rows[v][2]);
    const auto normals = vertex_normals(mesh);
    for (int v = 0; v < mesh.num_vertices(); ++v)
      for (int k = 0; k < 3; ++k) rows[v][k] += static_cast<float>(thickness * normals[v][k]);
  }
  return vertices;
}

/// The light of textured captures: a little from above and from +x, the three channels not alike. [3,9]
inline torch::Tensor true_light() {
  torch::Tensor light = identity_lighting() * torch::tensor({0.8f, 0.75f, 0.7f}).unsqueeze(1);
  light.select(1, 1) += torch::tensor({0.15f, 0.12f, 0.1f});
  light.select(1, 3) += torch::tensor({0.05f, 0.08f, 0.1f});
  return light;
}

inline cv::Mat smooth_texture(int size) {
  cv::Mat texture(size, size, CV_8UC3);
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x)
      for (int c = 0; c < 3; ++c)
        texture.at<cv::Vec3b>(y, x)[c] = cv::saturate_cast<std::uint8_t>(
            140 + 60 * std::sin(2 * M_PI * (x * (1 + c) + y * (3 - c)) / static_cast<double>(size)));
  return texture;
}

/// What the cameras see of a textured mesh. @param vertices [1,N,3] @return [C,H,W,3] BGR bytes, green where nothing is
inline torch::Tensor textured_images(const Character& character, const std::vector<PinholeCamera>& cameras,
                                     const torch::Tensor& vertices) {
  torch::NoGradGuard no_grad;
  const RenderMesh mesh(character.mesh);
  const auto light = true_light().expand({1, static_cast<std::int64_t>(cameras.size()), 3, 9}).contiguous();
  const ShadedImage drawn = shade(vertices, texture_tensor(character.mesh), light,
                                  projection_tensor(cameras).unsqueeze(0), mesh, cameras[0].height, cameras[0].width);
  const torch::Tensor green = torch::tensor({60.0f, 140.0f, 60.0f});
  const torch::Tensor bgr = drawn.colour[0].flip({3}).clamp(0, 1) * 255;
  return torch::where(drawn.mask[0].unsqueeze(3), bgr, green).round().to(torch::kUInt8).contiguous();
}

inline void write_images(const std::filesystem::path& folder, const Character& character,
                         const std::vector<PinholeCamera>& cameras, const torch::Tensor& vertices) {
  torch::Tensor faces = torch::empty({character.mesh.num_faces(), 3}, torch::kInt32);
  for (int f = 0; f < character.mesh.num_faces(); ++f)
    for (int k = 0; k < 3; ++k) faces[f][k] = character.mesh.faces[f][k];
  Rasterizer rasterizer(faces);
  const auto projection = projection_tensor(cameras).unsqueeze(0);
  for (std::int64_t f = 0; f < vertices.size(0); ++f) {
    const auto covered = rasterizer
                             .coverage_projected(vertices.slice(0, f, f + 1).contiguous(), projection,
                                                 cameras[0].height, cameras[0].width)
                             .mul(255)
                             .contiguous();
    const bool textured = !character.mesh.texture.empty();
    const torch::Tensor images =
        textured ? textured_images(character, cameras, vertices.slice(0, f, f + 1).contiguous()) : torch::Tensor();
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      const cv::Mat mask(cameras[c].height, cameras[c].width, CV_8UC1,
                         covered[0][static_cast<std::int64_t>(c)].data_ptr<std::uint8_t>());
      cv::Mat image(mask.size(), CV_8UC3, cv::Scalar(60, 140, 60));
      if (textured)
        cv::Mat(mask.size(), CV_8UC3, images[static_cast<std::int64_t>(c)].data_ptr<std::uint8_t>()).copyTo(image);
      else
        image.setTo(cv::Scalar(150, 150, 170), mask);
      const std::string name = "c" + std::to_string(c) + "_" + std::to_string(f) + ".png";
      std::filesystem::create_directories(folder);
      cv::imwrite((folder / ("mask_" + name)).string(), mask);
      cv::imwrite((folder / ("image_" + name)).string(), image);
    }
  }
}

}  // namespace small_capture

/// @return the prepared folder, `folder/prepared`
inline std::filesystem::path make_small_capture(const std::filesystem::path& folder,
                                                const SmallCaptureOptions& o = {}) {
  namespace sc = small_capture;
  Character character = make_test_character(4, 8, 14);
  if (o.textured) character.mesh.texture = sc::smooth_texture(64);
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const auto& v : character.mesh.vertices) centre += v / character.num_vertices();
  const auto cameras = sc::make_cameras(o, centre);
  Capture capture;
  capture.name = "tube";
  capture.root = folder;
  capture.character = std::filesystem::relative(write_character(folder / "character", character), folder).string();
  capture.calibration = "cameras.yml";
  write_calibration(folder / capture.calibration, {cameras.begin(), cameras.end()});
  for (const Split split : {Split::train, Split::test}) {
    const std::string name = split == Split::train ? "walk" : "dance";
    const int frames = split == Split::train ? o.train_frames : o.test_frames;
    const Motion motion = sc::make_motion(character, frames, split == Split::train ? 0.0 : 0.9);
    const auto ground_truth = sc::true_surface(character, motion, o.thickness).contiguous();
    sc::write_images(folder / name, character, cameras, ground_truth);
    write_motion(folder / name / "poses.motion", motion, true);
    std::filesystem::create_directories(folder / "ground_truth" / name);
    write_npy(folder / "ground_truth" / name / "vertices.npy", ground_truth.data_ptr<float>(),
              ground_truth.sizes().vec());
    SequenceEntry entry;
    entry.name = name;
    entry.split = split;
    entry.videos = name + "/image_{name}_{frame}.png";
    entry.masks = name + "/mask_{name}_{frame}.png";
    entry.motion = name + "/poses.motion";
    capture.sequences.push_back(entry);
  }
  write_capture(folder / "capture.yaml", capture);
  PrepareOptions options;
  options.out = folder / "prepared";
  options.mask_size = o.mask_size;
  options.image_size = o.mask_size;
  prepare_capture(read_capture(folder), options);
  return options.out;
}

}  // namespace doppel
