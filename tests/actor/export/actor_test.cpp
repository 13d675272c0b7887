#include <gtest/gtest.h>
#include <torch/script.h>

#include <cstdlib>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "actor/export/dressed_actor.h"
#include "doppel/actor/export/actor_file.h"
#include "doppel/actor/export/animation.h"
#include "doppel/actor/trained_actor.h"
#include "doppel/character/character.h"
#include "doppel/character/resample_motion.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/npy.h"
#include "doppel/layers/surface.h"
#include "doppel/nets/egnet.h"
#include "doppel/render/splats/splat_rows.h"
#include "doppel/render/splats/splats.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::actor_test {
namespace {

using support::TemporaryFolder;

/// A character, an untrained network with outputs large enough to see, and the actor made of both.
struct Actor {
  Character character = make_test_character();
  EgNet net;
  CharacterSurface surface;
  ActorDescription description;

  Actor() : net(character, EgNetConfig::preset("paper")), surface(character) {
    torch::NoGradGuard no_grad;
    auto generator = at::detail::createCPUGenerator(5);
    for (torch::Tensor& p : net->parameters()) p.copy_(0.2 * torch::randn(p.sizes(), generator));
    net->eval();
    description.name = character.name;
    description.past_frames = net->config().past_frames;
    for (const Dof& dof : character.skeleton.dofs) description.dof_names.push_back(dof.name);
    for (const Joint& joint : character.skeleton.joints) description.joint_names.push_back(joint.name);
    description.num_vertices = character.num_vertices();
    description.fingerprint = character.fingerprint();
  }

  torch::Tensor forward(const torch::Tensor& window) {
    const auto [rotation, translation] = net->forward(window);
    return surface->deformed(window.select(1, window.size(1) - 1), rotation, translation, {});
  }

  void write(const std::filesystem::path& path) {
    write_actor(path, character, description,
                {[this](const torch::Tensor& window) { return forward(window); }, nullptr}, {{"egnet", net.get()}});
  }
};

Motion test_motion(int num_dofs, int frames) {
  Motion motion;
  for (int f = 0; f < frames; ++f) {
    std::vector<double> row;
    for (int d = 0; d < num_dofs; ++d) row.push_back(0.2 * std::sin(0.3 * f + d));
    motion.frames.push_back(row);
    motion.ids.push_back(f);
  }
  return motion;
}

double largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
  if (a.size() != b.size()) return 1e9;
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::abs(double(a[i]) - double(b[i])));
  return worst;
}

TEST(ActorFileRejects, ResultsOfAnotherShape) {
  const TemporaryFolder folder;
  Actor actor;
  actor.write(folder / "actor.pt");
  torch::jit::ExtraFilesMap parts{{"metadata.json", ""}, {"faces.npy", ""}};
  torch::jit::load((folder / "actor.pt").string(), c10::nullopt, parts);
  torch::jit::Module other("__torch__.doppel.Actor");
  other.define("def forward(self, window):\n  return window\n");
  other.save((folder / "other.pt").string(), parts);
  const ActorFile file = ActorFile::load(folder / "other.pt");
  const int dofs = actor.character.num_dofs();
  EXPECT_THROW(file.forward(torch::zeros({1, actor.description.past_frames + 1, dofs})), Error);
}

TEST(ActorFileAgrees, WithTheModelOnUnseenWindowsAndBatches) {
  const TemporaryFolder folder;
  Actor actor;
  actor.write(folder / "actor.pt");
  const ActorFile file = ActorFile::load(folder / "actor.pt");
  EXPECT_EQ(file.description().dof_names, actor.description.dof_names);
  EXPECT_EQ(file.description().fingerprint, actor.character.fingerprint());
  torch::NoGradGuard no_grad;
  for (int batch : {1, 2, 5}) {
    const torch::Tensor window = 0.4 * torch::randn({batch, 3, actor.character.num_dofs()});
    const torch::Tensor expected = actor.forward(window), found = file.forward(window);
    ASSERT_EQ(found.sizes(), expected.sizes());
    EXPECT_LT((found - expected).abs().max().item<double>(), 1e-5) << "batch " << batch;
  }
}

TEST(ActorFileAgrees, ParametersStayParameters) {
  const TemporaryFolder folder;
  Actor actor;
  actor.write(folder / "actor.pt");
  torch::jit::Module module = torch::jit::load((folder / "actor.pt").string());
  EXPECT_EQ(module.parameters().size(), actor.net->parameters().size());
  // Changing a parameter of the loaded file changes what it computes: nothing was baked in as a constant.
  torch::NoGradGuard no_grad;
  const torch::Tensor window = 0.4 * torch::randn({1, 3, actor.character.num_dofs()});
  const torch::Tensor before = module.forward({window}).toTensor();
  for (const torch::Tensor& p : module.parameters()) p.zero_();
  EXPECT_GT((module.forward({window}).toTensor() - before).abs().max().item<double>(), 1e-4);
}

TEST(ActorFileAgrees, TheGradientOfThePosesIsThatOfCentralDifferences) {
  const TemporaryFolder folder;
  Actor actor;
  actor.write(folder / "actor.pt");
  torch::jit::Module module = torch::jit::load((folder / "actor.pt").string());
  for (torch::Tensor p : module.parameters()) p.requires_grad_(true);
  auto generator = at::detail::createCPUGenerator(8);
  const torch::Tensor given = 0.4 * torch::randn({1, 3, actor.character.num_dofs()}, generator),
                      direction = torch::randn(given.sizes(), generator);
  const torch::Tensor weights = torch::randn({actor.character.num_vertices(), 3}, generator);
  const auto value = [&](const torch::Tensor& window) {
    return (module.forward({window}).toTensor()[0] * weights).sum();
  };
  for (int call = 0; call < 3; ++call) {  // TorchScript runs other code after the first calls
    const torch::Tensor window = given.clone().requires_grad_(true);
    value(window).backward();
    const torch::NoGradGuard no_grad;
    const double step = 2e-3, found = (window.grad() * direction).sum().item<double>(),
                 expected =
                     (value(given + step * direction) - value(given - step * direction)).item<double>() / (2 * step);
    EXPECT_GT(std::abs(expected), 0.1);
    EXPECT_NEAR(found, expected, 0.01 * std::abs(expected)) << "call " << call;
  }
}

/// Runs an example that should draw an actor which it cannot draw. @return what it prints
std::string undrawn_by(const std::string& host, const TemporaryFolder& folder) {
  const std::string command = host + " '" + (folder / "actor.pt").string() + "' '" + (folder / "m.motion").string() +
                              "' '" + (folder / "out").string() + "' '" + (folder / "image").string() + "' >'" +
                              (folder / "said").string() + "' 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0) << host;
  EXPECT_FALSE(std::filesystem::exists(folder / "image")) << host;
  return read_file(folder / "said");
}

TEST(ActorHostBehaves, WithoutATextureOneLineSaysThatNothingIsDrawn) {
  const TemporaryFolder folder;
  Actor actor;
  actor.write(folder / "actor.pt");
  write_motion(folder / "m.motion", test_motion(actor.character.num_dofs(), 3), true);
  EXPECT_NE(undrawn_by(ACTOR_HOST, folder).find("has no dynamic texture"), std::string::npos);
  EXPECT_GT(std::filesystem::file_size(folder / "out"), 0U);
  EXPECT_NE(undrawn_by(PLAY_ACTOR_C, folder).find("has no Gaussians"), std::string::npos);
  if (std::system("/usr/bin/python3 -c 'import torch' 2>/dev/null") != 0)
    GTEST_SKIP() << "Debian's python3-torch is not installed: the Python host was not tried";
  const std::string said = undrawn_by("/usr/bin/python3 " PLAY_ACTOR, folder);
  EXPECT_NE(said.find("has no dynamic texture"), std::string::npos) << said;
  EXPECT_TRUE(std::filesystem::exists(folder / "out.npy"));
}

TEST(ActorFileAgrees, WithThePythonAndTheCppHost) {
  const TemporaryFolder folder;
  Actor actor;
  actor.write(folder / "actor.pt");
  const Motion motion = test_motion(actor.character.num_dofs(), 7);
  write_motion(folder / "m.motion", motion, true);
  const ActorFile file = ActorFile::load(folder / "actor.pt");
  std::vector<std::unique_ptr<SequenceWriter>> writers;
  writers.push_back(make_npy_writer(folder / "ours", actor.character.num_vertices()));
  animate(actor.character, motion, &file, writers);
  const std::vector<float> ours = read_npy(folder / "ours" / "vertices.npy").as<float>();

  const std::string arguments = " '" + (folder / "actor.pt").string() + "' '" + (folder / "m.motion").string() + "' '";
  ASSERT_EQ(
      std::system((std::string(ACTOR_HOST) + arguments + (folder / "host.f32").string() + "' >/dev/null").c_str()), 0);
  const std::string raw = read_file(folder / "host.f32");
  std::vector<float> host(raw.size() / sizeof(float));
  std::memcpy(host.data(), raw.data(), raw.size());
  EXPECT_LT(largest_difference(ours, host), 1e-5);

  if (std::system("/usr/bin/python3 -c 'import torch' 2>/dev/null") != 0)
    GTEST_SKIP() << "Debian's python3-torch is not installed: the Python host was not tried";
  ASSERT_EQ(
      std::system(
          ("/usr/bin/python3 " PLAY_ACTOR + arguments + (folder / "python.npy").string() + "' >/dev/null").c_str()),
      0);
  EXPECT_LT(largest_difference(ours, read_npy(folder / "python.npy").as<float>()), 1e-5);
}

/// An actor file with all functions of a dressed actor.
void write_dressed(TrainedActor& actor, const std::filesystem::path& path) {
  write_actor(path, actor.character, support::description_of(actor),
              {[&](const torch::Tensor& window) { return actor.fine(window); },
               [&](const auto& window, const auto& p, const auto& v) { return actor.texture(window, p, v); },
               [&](const auto& window, const auto& p, const auto& v) { return actor.gaussian_rows(window, p, v); }},
              {{"egnet", actor.egnet.get()},
               {"deltanet", actor.deltanet.get()},
               {"texnet", actor.texnet.get()},
               {"surface_gaussians", actor.gaussians.get()}});
}

/// Runs a host of the C API on an actor and a motion. @return the vertices that it wrote
std::vector<float> played_by(const std::string& host, const TemporaryFolder& folder) {
  const std::string command = host + " '" + (folder / "actor.pt").string() + "' '" + (folder / "m.motion").string() +
                              "' '" + (folder / "host.f32").string() + "' >/dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  const std::string raw = read_file(folder / "host.f32");
  std::vector<float> vertices(raw.size() / sizeof(float));
  std::memcpy(vertices.data(), raw.data(), raw.size());
  return vertices;
}

TEST(ActorHostAgrees, InCAndInPythonWithoutPyTorch) {
  const TemporaryFolder folder;
  Actor actor;
  actor.write(folder / "actor.pt");
  const Motion motion = test_motion(actor.character.num_dofs(), 9);
  write_motion(folder / "m.motion", motion, true);
  std::vector<float> ours;
  const torch::NoGradGuard no_grad;
  for (int f = 0; f < motion.num_frames(); ++f) {
    const torch::Tensor frame = actor.forward(motion_window(motion, f, actor.description.past_frames).unsqueeze(0));
    ours.insert(ours.end(), frame.data_ptr<float>(), frame.data_ptr<float>() + frame.numel());
  }
  EXPECT_LT(largest_difference(ours, played_by(PLAY_ACTOR_C, folder)), 1e-5);
  EXPECT_LT(largest_difference(ours, played_by("/usr/bin/python3 " ACTOR_CTYPES " " DOPPEL_LIBRARY, folder)), 1e-5);
}

TEST(ActorHostBehaves, NormalsWindowErrorsAndMemory) {
  const TemporaryFolder folder;
  Actor actor;
  actor.write(folder / "actor.pt");
  EXPECT_EQ(std::system((std::string(HOST_CHECK) + " '" + (folder / "actor.pt").string() + "'").c_str()), 0);
}

TEST(ActorHostBehaves, WithGaussians) {
  const TemporaryFolder folder;
  TrainedActor actor = support::dressed_actor();
  write_dressed(actor, folder / "actor.pt");
  EXPECT_EQ(std::system((std::string(HOST_CHECK) + " '" + (folder / "actor.pt").string() + "'").c_str()), 0);
}

TEST(TextureInputReference, SeesTheFinishedSurfaceOnDemandInTheLastFrameAlone) {
  TrainedActor actor = support::dressed_actor();
  TexNetConfig config = actor.texnet->config();
  ASSERT_TRUE(config.surface_normals);
  const torch::Tensor window =
      0.3 * torch::randn({2, 3, actor.character.num_dofs()}, at::detail::createCPUGenerator(4));
  const torch::Tensor projection = torch::eye(4).slice(0, 0, 3).unsqueeze(0).repeat({2, 1, 1});
  const torch::Tensor surface = actor.fine(window);
  const auto input = [&] { return texture_input(actor, *actor.texture_space, config, window, projection, surface); };
  const TexNetInput finished = input();
  config.surface_normals = false;
  const TexNetInput skinned = input();
  EXPECT_TRUE(torch::equal(finished.normals.narrow(1, 6, 3), actor.texture_space->normals(surface)));
  EXPECT_GT((finished.normals.narrow(1, 6, 3) - skinned.normals.narrow(1, 6, 3)).abs().max().item<float>(), 0.01f);
  EXPECT_TRUE(torch::equal(finished.normals.narrow(1, 0, 6), skinned.normals.narrow(1, 0, 6)));
  EXPECT_TRUE(torch::equal(finished.camera, skinned.camera));
}

TEST(ActorFileAgrees, GeometryAndTextureOfAWholeActorInAllHosts) {
  const TemporaryFolder folder;
  TrainedActor actor = support::dressed_actor();
  const auto path = folder / "actor.pt";
  write_dressed(actor, path);

  const ActorFile file = ActorFile::load(path);
  EXPECT_EQ(file.description().texture_size, 512);
  const torch::Tensor window = 0.3 * torch::randn({2, 3, actor.character.num_dofs()});
  const torch::Tensor projection =
      torch::tensor({600.f, 0.f, 200.f, 900.f, 0.f, 600.f, 200.f, 500.f, 0.f, 0.f, 1.f, 2.5f})
          .view({1, 3, 4})
          .repeat({2, 1, 1});
  const auto [vertices, texture] = file.textured(window, projection);
  EXPECT_LT((vertices - actor.fine(window)).abs().max().item<float>(), 1e-5f);
  EXPECT_LT((texture - actor.texture(window, projection)).abs().max().item<float>(), 1e-4f);
  EXPECT_LT((vertices - file.forward(window)).abs().max().item<float>(), 1e-6f);
  EXPECT_LT((texture - file.texture(window, projection, vertices)).abs().max().item<float>(), 1e-6f);
  EXPECT_THROW(file.textured(window, projection.slice(0, 0, 1)), Error);

  write_motion(folder / "m.motion", test_motion(actor.character.num_dofs(), 3), true);
  const std::string arguments = " '" + path.string() + "' '" + (folder / "m.motion").string() + "' '";
  ASSERT_EQ(std::system((std::string(ACTOR_HOST) + arguments + (folder / "host.f32").string() + "' '" +
                         (folder / "host.ppm").string() + "' >/dev/null")
                            .c_str()),
            0);
  const cv::Mat host = cv::imread((folder / "host.ppm").string());
  ASSERT_EQ(host.size(), cv::Size(512, 512));
  const int drawn = cv::countNonZero(host.reshape(1) != 230) / 3;
  EXPECT_GT(drawn, 2000);
  if (std::system("/usr/bin/python3 -c 'import torch' 2>/dev/null") != 0)
    GTEST_SKIP() << "Debian's python3-torch is not installed: the Python host was not tried";
  ASSERT_EQ(std::system(("/usr/bin/python3 " PLAY_ACTOR + arguments + (folder / "python.npy").string() + "' '" +
                         (folder / "python.ppm").string() + "' >/dev/null")
                            .c_str()),
            0);
  const cv::Mat python = cv::imread((folder / "python.ppm").string());
  ASSERT_EQ(python.size(), host.size());
  // Two rasterizers: pixels on edges may differ.
  cv::Mat difference;
  cv::absdiff(host, python, difference);
  EXPECT_LT(cv::countNonZero(difference.reshape(1) > 2) / 3, drawn / 50);
}

/// The camera of examples/c/play_actor.c. @param vertices [1,N,3] @return [1,3,4]
torch::Tensor facing_camera(const torch::Tensor& vertices, float side) {
  const torch::Tensor low = vertices[0].amin(0), high = vertices[0].amax(0), middle = (low + high) / 2;
  const float x = middle[0].item<float>(), y = middle[1].item<float>(),
              z = middle[2].item<float>() + 3 * (high[1] - low[1]).item<float>(), focal = 2.5f * side;
  return torch::tensor({focal, 0.f, -side / 2, side / 2 * z - focal * x, 0.f, -focal, -side / 2,
                        side / 2 * z + focal * y, 0.f, 0.f, -1.f, z})
      .view({1, 3, 4});
}

TEST(ActorFileAgrees, GaussiansOfAWholeActorAndTheirDrawingByTheCApi) {
  const TemporaryFolder folder;
  TrainedActor actor = support::dressed_actor();
  write_dressed(actor, folder / "actor.pt");
  const ActorFile file = ActorFile::load(folder / "actor.pt");
  const Motion motion = test_motion(actor.character.num_dofs(), 3);
  const torch::Tensor window = motion_window(motion, 2, actor.past_frames()).unsqueeze(0).repeat({2, 1, 1});
  const torch::Tensor vertices = file.forward(window);
  const torch::Tensor camera = facing_camera(vertices, 512), cameras = camera.repeat({2, 1, 1});
  const torch::Tensor rows = file.gaussians(window, cameras, vertices),
                      expected = actor.gaussian_rows(window, cameras, actor.fine(window));
  ASSERT_EQ(rows.size(1), file.description().num_gaussians);
  EXPECT_LT((comparable_gaussians(rows) - comparable_gaussians(expected)).abs().max().item<float>(), 1e-3f);
  EXPECT_THROW(file.gaussians(window, camera, vertices), Error);

  write_motion(folder / "m.motion", motion, true);
  const std::string command = std::string(PLAY_ACTOR_C) + " '" + (folder / "actor.pt").string() + "' '" +
                              (folder / "m.motion").string() + "' '" + (folder / "out.f32").string() + "' '" +
                              (folder / "last.pam").string() + "' >/dev/null";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const std::string pam = read_file(folder / "last.pam"), end = "ENDHDR\n";
  const std::size_t header = pam.find(end) + end.size();
  ASSERT_EQ(pam.size() - header, 512U * 512U * 4U);
  const torch::Tensor found =
      torch::tensor(std::vector<std::uint8_t>(pam.begin() + static_cast<std::ptrdiff_t>(header), pam.end()))
          .view({512, 512, 4})
          .to(torch::kFloat32);
  const SplatImage image = draw_splats(splats_of_rows(rows.narrow(0, 0, 1)), camera.unsqueeze(1), 512, 512);
  const torch::Tensor colour = image.colour[0][0] / image.alpha[0][0].clamp_min(1e-6).unsqueeze(2);
  const torch::Tensor rgba = torch::cat({colour.clamp_max(1.0), image.alpha[0][0].unsqueeze(2)}, 2) * 255;
  EXPECT_GT((found.select(2, 3) > 128).sum().item<int>(), 2000);
  // One of 255 beside the rounding: the file holds the motion with fewer digits than the test.
  EXPECT_LE(((found - rgba).abs() * (found.narrow(2, 3, 1) > 25)).max().item<float>(), 2.0f);
}

TEST(ActorFileRejects, ATextureAndGaussiansWhereThereAreNone) {
  const TemporaryFolder folder;
  Actor actor;
  actor.write(folder / "actor.pt");
  const ActorFile file = ActorFile::load(folder / "actor.pt");
  const torch::Tensor window = torch::zeros({1, 3, actor.character.num_dofs()}), camera = torch::zeros({1, 3, 4});
  EXPECT_THROW(file.textured(window, camera), Error);
  EXPECT_THROW(file.gaussians(window, camera, file.forward(window)), Error);
}

TEST(ActorFileRejects, WhatIsNotAnActor) {
  const TemporaryFolder folder;
  EXPECT_THROW(ActorFile::load(folder / "missing.pt"), FileError);
  write_atomically(folder / "text.pt", "hello");
  EXPECT_THROW(ActorFile::load(folder / "text.pt"), FileError);
  torch::jit::Module other("other");
  other.define("def forward(self, x):\n  return x\n");
  other.save((folder / "other.pt").string());
  EXPECT_THROW(ActorFile::load(folder / "other.pt"), FileError);

  Actor actor;
  actor.write(folder / "actor.pt");
  const std::string whole = read_file(folder / "actor.pt");
  for (std::size_t length : {whole.size() / 10, whole.size() / 2, whole.size() - 20}) {
    write_atomically(folder / "cut.pt", whole.substr(0, length));
    EXPECT_THROW(ActorFile::load(folder / "cut.pt"), FileError) << length;
  }
  EXPECT_THROW(ActorFile::load(folder / "actor.pt").forward(torch::zeros({1, 3, 1})), Error);
}

TEST(AnimationReference, WithoutAModelItIsPureSkinning) {
  const TemporaryFolder folder;
  const Character character = make_test_character();
  const Motion motion = test_motion(character.num_dofs(), 20);
  std::vector<std::unique_ptr<SequenceWriter>> writers;
  writers.push_back(make_npy_writer(folder.path(), character.num_vertices()));
  writers.push_back(make_obj_writer(folder.path(), character));
  animate(character, motion, nullptr, writers);
  const NpyArray array = read_npy(folder / "vertices.npy");
  EXPECT_EQ(array.shape, (std::vector<std::int64_t>{20, character.num_vertices(), 3}));

  CharacterSurface surface(character);
  const torch::Tensor last = surface->skinned(motion_window(motion, 19, 0));
  const std::vector<float> all = array.as<float>();
  const std::vector<float> expected(last.data_ptr<float>(), last.data_ptr<float>() + last.numel());
  EXPECT_LT(largest_difference({all.end() - last.numel(), all.end()}, expected), 1e-7);

  const TriangleMesh mesh = read_obj(folder / "frame_000019.obj", 1.0);
  EXPECT_EQ(mesh.faces, character.mesh.faces);
  EXPECT_NEAR(mesh.vertices.back().x(), expected[expected.size() - 3], 1e-6);
}

TEST(AnimationReference, ObjFilesHaveTheGivenUnitAndVerticalAxis) {
  const TemporaryFolder metres, centimetres;
  const Character character = make_test_character();
  std::vector<std::unique_ptr<SequenceWriter>> writers;
  writers.push_back(make_obj_writer(metres.path(), character));
  writers.push_back(make_obj_writer(centimetres.path(), character, {0.01, true}));
  animate(character, test_motion(character.num_dofs(), 20), nullptr, writers);
  const TriangleMesh mesh = read_obj(metres / "frame_000019.obj", 1.0);
  const TriangleMesh turned = read_obj(centimetres / "frame_000019.obj", 0.01);
  ASSERT_EQ(turned.vertices.size(), mesh.vertices.size());
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3d& v = mesh.vertices[i];
    EXPECT_LT((turned.vertices[i] - Eigen::Vector3d(v.x(), -v.z(), v.y())).norm(), 2e-6);
  }
}

TEST(AnimationReference, ATexturedObjSequenceKeepsItsTexture) {
  const TemporaryFolder folder;
  Character character = make_test_character();
  character.mesh.uvs = {{0, 0}, {1, 0}, {0, 1}};
  character.mesh.face_uvs.assign(character.mesh.faces.size(), {0, 1, 2});
  character.mesh.texture = cv::Mat(4, 4, CV_8UC3, cv::Scalar(10, 20, 200));
  std::vector<std::unique_ptr<SequenceWriter>> writers;
  writers.push_back(make_obj_writer(folder.path(), character));
  animate(character, test_motion(character.num_dofs(), 2), nullptr, writers);
  const TriangleMesh mesh = read_obj(folder / "frame_000001.obj", 1.0);
  ASSERT_FALSE(mesh.texture.empty());
  EXPECT_EQ(mesh.texture.at<cv::Vec3b>(0, 0), cv::Vec3b(10, 20, 200));
  EXPECT_EQ(mesh.face_uvs, character.mesh.face_uvs);
}

TEST(AnimationReference, TheFirstFrameRepeatsBeforeTheStart) {
  const Motion motion = test_motion(4, 5);
  const torch::Tensor window = motion_window(motion, 1, 2);
  EXPECT_TRUE(torch::equal(window[0], window[1]));
  EXPECT_FLOAT_EQ(window[2][2].item<float>(), static_cast<float>(motion.frames[1][2]));
  const std::vector<long> cuts{2, 4};
  const torch::Tensor after = motion_window(motion, 3, 2, cuts);
  EXPECT_TRUE(torch::equal(after[0], after[1]));
  EXPECT_FLOAT_EQ(after[0][2].item<float>(), static_cast<float>(motion.frames[2][2]));
  EXPECT_TRUE(torch::equal(motion_window(motion, 4, 1, cuts)[0], motion_window(motion, 4, 0)[0]));
}

TEST(AnimationReference, WindowsHoldPosesAtTheRateOfTheTraining) {
  const TemporaryFolder folder;
  Actor actor;
  const Motion coarse = test_motion(actor.character.num_dofs(), 6);
  const Motion fine = resample(coarse, actor.character.skeleton, 0.25);
  const auto forward = [&](const torch::Tensor& window) { return actor.forward(window); };
  const auto vertices = [&](const char* name, const Motion& motion, const FrameSteps& steps) {
    std::vector<std::unique_ptr<SequenceWriter>> writers;
    writers.push_back(make_npy_writer(folder / name, actor.character.num_vertices()));
    animate(actor.character, motion, actor.description.past_frames, forward, writers, nullptr, steps);
    return read_npy(folder / name / "vertices.npy");
  };
  const NpyArray expected = vertices("coarse", coarse, {}), fast = vertices("fast", fine, {1.0, 4.0}),
                 slow = vertices("slow", fine, {4.0, 4.0});
  ASSERT_EQ(fast.shape[0], 21);
  ASSERT_EQ(slow.shape, expected.shape);
  EXPECT_LT(largest_difference(slow.as<float>(), expected.as<float>()), 1e-6);
  const std::vector<float> all = fast.as<float>(), wanted = expected.as<float>();
  const std::size_t row = 3 * static_cast<std::size_t>(expected.shape[1]);
  for (std::size_t t = 0; t < 6; ++t)
    for (std::size_t i = 0; i < row; ++i) ASSERT_NEAR(all[4 * t * row + i], wanted[t * row + i], 1e-6) << t;
  EXPECT_THROW(vertices("none", fine, {0.0, 1.0}), Error);
}

TEST(AnimationReference, MotionsOneAfterTheOtherKnowNothingOfEachOther) {
  const TemporaryFolder folder;
  Actor actor;
  const Motion walk = test_motion(actor.character.num_dofs(), 20), run = test_motion(actor.character.num_dofs(), 6);
  const auto forward = [&](const torch::Tensor& window) { return actor.forward(window); };
  const auto vertices = [&](const char* name, const std::vector<MotionPart>& parts) {
    std::vector<std::unique_ptr<SequenceWriter>> writers;
    writers.push_back(make_npy_writer(folder / name, actor.character.num_vertices()));
    animate(actor.character, parts, actor.description.past_frames, forward, writers);
    return read_npy(folder / name / "vertices.npy").as<float>();
  };
  const std::vector<float> both = vertices("both", {{walk, {}}, {run, {0.5, 1.0}}}),
                           first = vertices("a", {{walk, {}}}), second = vertices("b", {{run, {0.5, 1.0}}});
  ASSERT_EQ(both.size(), first.size() + second.size());
  EXPECT_TRUE(std::equal(first.begin(), first.end(), both.begin()));
  EXPECT_TRUE(std::equal(second.begin(), second.end(), both.end() - static_cast<std::ptrdiff_t>(second.size())));
}

TEST(AnimationReference, InPlaceTheGeometryIsMovedAlongTheGroundAlone) {
  const TemporaryFolder folder;
  Actor actor;
  const Motion motion = test_motion(actor.character.num_dofs(), 20);
  const auto forward = [&](const torch::Tensor& window) { return actor.forward(window); };
  const auto vertices = [&](const char* name, bool in_place) {
    std::vector<std::unique_ptr<SequenceWriter>> writers;
    writers.push_back(make_npy_writer(folder / name, actor.character.num_vertices()));
    animate(actor.character, std::vector<MotionPart>{{motion, {}, in_place}}, actor.description.past_frames, forward,
            writers);
    return read_npy(folder / name / "vertices.npy").as<float>();
  };
  const std::vector<float> travels = vertices("travels", false), stays = vertices("stays", true);
  ASSERT_EQ(stays.size(), travels.size());
  const Skeleton::Root root = actor.character.skeleton.root();
  const std::size_t row = travels.size() / 20;
  for (std::size_t t = 0; t < 20; ++t)
    for (std::size_t i = 0; i < row; ++i) {
      const std::size_t axis = i % 3;
      const auto dof = static_cast<std::size_t>(root.translation[axis]);
      const double way =
          axis == 1 ? 0.0 : root.translation_weight[axis] * (motion.frames[t][dof] - motion.frames[0][dof]);
      ASSERT_NEAR(stays[t * row + i], travels[t * row + i] - way, 1e-5) << t;
    }
}

TEST(AnimationRejects, AMotionOfAnotherSkeleton) {
  const TemporaryFolder folder;
  const Character character = make_test_character();
  EXPECT_THROW(animate(character, test_motion(character.num_dofs() + 1, 2), nullptr, {}), Error);
  EXPECT_THROW(animate(character, Motion{}, nullptr, {}), Error);
}

}  // namespace
}  // namespace doppel::actor_test
