// Files of Gaussians, read back by the few lines below, which share no code with the writer.
#include "doppel/actor/export/splat_file.h"

#include <gmock/gmock.h>
#include <torch/types.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::splat_file_test {
namespace {

using Json = nlohmann::json;
using Rows = std::vector<std::vector<double>>;
using support::message_of;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

Splats random_splats(std::int64_t batch, std::int64_t count, std::int64_t harmonics) {
  torch::manual_seed(7);
  return {
      torch::randn({batch, count, 3}),  torch::randn({batch, count, 4}) * 3,        torch::randn({batch, count, 3}) - 5,
      torch::randn({batch, count}) * 2, torch::randn({batch, count, harmonics, 3}), {}};
}

template <typename T>
T value_at(const std::string& bytes, std::size_t at) {
  T value;
  if (at + sizeof value > bytes.size()) throw std::out_of_range("beyond the end of the file");
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

struct PlyFile {
  std::string format;
  std::size_t count = 0;
  std::vector<std::string> names;
  std::vector<std::vector<float>> rows;

  explicit PlyFile(const std::filesystem::path& path) {
    const std::string bytes = read_file(path), last = "end_header\n";
    const std::size_t body = bytes.find(last) + last.size();
    std::istringstream header(bytes.substr(0, body));
    for (std::string line; std::getline(header, line);) {
      std::istringstream words(line);
      std::string first, second, third;
      words >> first >> second >> third;
      if (first == "format") format = second + " " + third;
      if (first == "element") count = second == "vertex" ? std::stoul(third) : 0;
      if (first == "property") names.push_back(second == "float" ? third : "not a float");
    }
    EXPECT_EQ(bytes.substr(0, 4), "ply\n");
    EXPECT_EQ(bytes.size(), body + 4 * count * names.size());
    for (std::size_t i = 0; i < count; ++i) {
      rows.emplace_back();
      for (std::size_t k = 0; k < names.size(); ++k)
        rows.back().push_back(value_at<float>(bytes, body + 4 * (i * names.size() + k)));
    }
  }

  float at(std::size_t row, const std::string& name) const {
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) throw std::out_of_range(name);
    return rows.at(row).at(static_cast<std::size_t>(found - names.begin()));
  }
};

/// A .glb whose chunks fill the file.
struct GlbFile {
  Json json;
  std::string binary;

  explicit GlbFile(const std::filesystem::path& path) {
    const std::string bytes = read_file(path);
    EXPECT_EQ(bytes.substr(0, 4), "glTF");
    EXPECT_EQ(value_at<std::uint32_t>(bytes, 4), 2U);
    EXPECT_EQ(value_at<std::uint32_t>(bytes, 8), bytes.size());
    const std::size_t text = value_at<std::uint32_t>(bytes, 12);
    EXPECT_EQ(text % 4, 0U);
    EXPECT_EQ(bytes.substr(16, 4), "JSON");
    json = Json::parse(bytes.substr(20, text));
    const std::size_t size = value_at<std::uint32_t>(bytes, 20 + text);
    EXPECT_EQ(size % 4, 0U);
    EXPECT_EQ(bytes.substr(24 + text, 4), std::string("BIN\0", 4));
    EXPECT_EQ(bytes.size(), 28 + text + size);
    binary = bytes.substr(28 + text);
  }

  const Json& primitive() const { return json.at("meshes").at(0).at("primitives").at(0); }
  const Json& accessor(const std::string& attribute) const {
    return json.at("accessors").at(primitive().at("attributes").at(attribute).get<std::size_t>());
  }
  Rows rows(const std::string& attribute) const {
    const Json& from = accessor(attribute);
    const Json& view = json.at("bufferViews").at(from.at("bufferView").get<std::size_t>());
    const std::size_t first = view.value("byteOffset", 0U) + from.value("byteOffset", 0U), width = width_of(from);
    Rows rows(from.at("count").get<std::size_t>(), std::vector<double>(width));
    for (std::size_t i = 0; i < rows.size() * width; ++i)
      rows[i / width][i % width] = static_cast<double>(value_at<float>(binary, first + 4 * i));
    return rows;
  }
  static std::size_t width_of(const Json& accessor) {
    return std::map<std::string, std::size_t>{{"SCALAR", 1}, {"VEC3", 3}, {"VEC4", 4}}.at(accessor.at("type"));
  }
};

std::vector<std::string> ply_names(int rest) {
  std::vector<std::string> names{"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"};
  for (int i = 0; i < rest; ++i) names.push_back("f_rest_" + std::to_string(i));
  for (const char* name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    names.emplace_back(name);
  return names;
}

/// The elements of a tensor as one list.
std::vector<float> values_of(const torch::Tensor& tensor) {
  const torch::Tensor flat = tensor.detach().contiguous();
  return {flat.data_ptr<float>(), flat.data_ptr<float>() + flat.numel()};
}

/// A quaternion of length 1. @param row of four
std::vector<double> unit(const std::vector<float>& row) {
  double squares = 0;
  for (const float value : row) squares += static_cast<double>(value) * static_cast<double>(value);
  std::vector<double> result;
  for (const float value : row) result.push_back(static_cast<double>(value) / std::sqrt(squares));
  return result;
}

double sigmoid(float x) { return 1.0 / (1.0 + std::exp(-static_cast<double>(x))); }

void expect_ply_rows(const PlyFile& file, const Splats& splats, std::int64_t item) {
  for (std::size_t i = 0; i < file.count; ++i) {
    const auto row = [&](const torch::Tensor& tensor) { return values_of(tensor[item][static_cast<std::int64_t>(i)]); };
    const auto positions = row(splats.positions), scales = row(splats.log_scales), harmonics = row(splats.harmonics);
    const auto turn = unit(row(splats.rotations));
    const std::size_t rest = harmonics.size() / 3 - 1;
    EXPECT_EQ(file.at(i, "opacity"), row(splats.opacities)[0]);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(file.at(i, "rot_" + std::to_string(k)), turn[k], 1e-6);
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(file.at(i, std::string(1, "xyz"[c])), positions[c]);
      EXPECT_EQ(file.at(i, "scale_" + std::to_string(c)), scales[c]);
      EXPECT_EQ(file.at(i, "f_dc_" + std::to_string(c)), harmonics[c]);
      for (std::size_t k = 0; k < rest; ++k)
        EXPECT_EQ(file.at(i, "f_rest_" + std::to_string(c * rest + k)), harmonics[3 * (k + 1) + c]);
    }
  }
}

TEST(SplatPly, HoldsTheRawValuesOfOneItemForEachDegree) {
  const TemporaryFolder folder;
  for (const int degree : {0, 1, 2, 3}) {
    SCOPED_TRACE(degree);
    const int harmonics = (degree + 1) * (degree + 1);
    const Splats splats = random_splats(2, 5, harmonics);
    write_splat_ply(folder / "a.ply", splats, 1);
    const PlyFile file(folder / "a.ply");
    EXPECT_EQ(file.format, "binary_little_endian 1.0");
    EXPECT_EQ(file.names, ply_names(3 * (harmonics - 1)));
    ASSERT_EQ(file.count, 5U);
    expect_ply_rows(file, splats, 1);
  }
}

TEST(SplatPly, CoefficientsOfAChannelStandTogether) {
  const TemporaryFolder folder;
  Splats splats = random_splats(1, 1, 4);
  // Coefficient k of channel c is 10 k + c.
  splats.harmonics = (10 * torch::arange(4).view({4, 1}) + torch::arange(3)).view({1, 1, 4, 3}).to(torch::kFloat32);
  write_splat_ply(folder / "a.ply", splats);
  const PlyFile file(folder / "a.ply");
  const std::vector<float>& row = file.rows[0];
  EXPECT_THAT(std::vector<float>(row.begin() + 6, row.begin() + 18),
              ElementsAre(0, 1, 2, 10, 20, 30, 11, 21, 31, 12, 22, 32));
}

TEST(SplatPly, NormalsAreZeroUnlessTheGaussiansHaveSome) {
  const TemporaryFolder folder;
  Splats splats = random_splats(1, 2, 1);
  write_splat_ply(folder / "a.ply", splats);
  EXPECT_EQ(PlyFile(folder / "a.ply").at(1, "ny"), 0.0f);
  splats.normals = torch::tensor({0.0f, 1.0f, 0.0f, 0.0f, 0.0f, -1.0f}).view({1, 2, 3});
  write_splat_ply(folder / "a.ply", splats);
  const PlyFile file(folder / "a.ply");
  EXPECT_EQ(file.at(0, "ny"), 1.0f);
  EXPECT_EQ(file.at(1, "nz"), -1.0f);
}

TEST(SplatPly, TensorsMayBeViewsWithGradients) {
  const TemporaryFolder folder;
  Splats splats = random_splats(2, 4, 4);
  splats.positions = torch::randn({2, 3, 4}).requires_grad_().transpose(1, 2);
  splats.harmonics = torch::randn({2, 4, 3, 4}).transpose(2, 3);
  write_splat_ply(folder / "a.ply", splats, 0);
  expect_ply_rows(PlyFile(folder / "a.ply"), splats, 0);
}

TEST(SplatGlb, HoldsTheValuesOfTheExtensionForEachDegree) {
  const TemporaryFolder folder;
  const std::string prefix = "KHR_gaussian_splatting:";
  for (const int degree : {0, 1, 2, 3}) {
    SCOPED_TRACE(degree);
    const Splats splats = random_splats(2, 5, (degree + 1) * (degree + 1));
    write_splat_glb(folder / "a.glb", splats, 1);
    const GlbFile file(folder / "a.glb");
    const Rows positions = file.rows("POSITION"), turns = file.rows(prefix + "ROTATION"),
               scales = file.rows(prefix + "SCALE"), opacities = file.rows(prefix + "OPACITY");
    ASSERT_EQ(positions.size(), 5U);
    for (std::size_t i = 0; i < 5; ++i) {
      const auto row = [&](const torch::Tensor& tensor) { return values_of(tensor[1][static_cast<std::int64_t>(i)]); };
      const auto turn = unit(row(splats.rotations));
      EXPECT_NEAR(opacities[i][0], sigmoid(row(splats.opacities)[0]), 1e-6);
      for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(turns[i][k], turn[(k + 1) % 4], 1e-6);
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_EQ(positions[i][c], static_cast<double>(row(splats.positions)[c]));
        EXPECT_NEAR(scales[i][c] / std::exp(static_cast<double>(row(splats.log_scales)[c])), 1.0, 1e-5);
      }
    }
    std::int64_t k = 0;
    for (int l = 0; l <= degree; ++l)
      for (int n = 0; n <= 2 * l; ++n, ++k) {
        const Rows found = file.rows(prefix + "SH_DEGREE_" + std::to_string(l) + "_COEF_" + std::to_string(n));
        for (std::size_t i = 0; i < 5; ++i)
          for (std::size_t c = 0; c < 3; ++c)
            EXPECT_EQ(found[i][c],
                      static_cast<double>(values_of(splats.harmonics[1][static_cast<std::int64_t>(i)][k])[c]));
      }
    EXPECT_EQ(file.primitive()["attributes"].size(), 5U + static_cast<std::size_t>(k));
  }
}

TEST(SplatGlb, AccessorsFillTheBufferWithoutOverlap) {
  const TemporaryFolder folder;
  write_splat_glb(folder / "a.glb", random_splats(1, 7, 9));
  const GlbFile file(folder / "a.glb");
  ASSERT_EQ(file.json["buffers"].size(), 1U);
  EXPECT_EQ(file.json["buffers"][0]["byteLength"], file.binary.size());
  EXPECT_FALSE(file.json["buffers"][0].contains("uri"));
  std::size_t end = 0;
  ASSERT_EQ(file.json["accessors"].size(), file.json["bufferViews"].size());
  for (std::size_t i = 0; i < file.json["accessors"].size(); ++i) {
    const Json& accessor = file.json["accessors"][i];
    const Json& view = file.json["bufferViews"][i];
    EXPECT_EQ(accessor["bufferView"], i);
    EXPECT_EQ(accessor["componentType"], 5126);
    EXPECT_EQ(accessor["count"], 7);
    EXPECT_EQ(view["buffer"], 0);
    EXPECT_EQ(view.value("byteOffset", std::size_t{0}), end);
    EXPECT_EQ(view["byteLength"], 4 * 7 * GlbFile::width_of(accessor));
    EXPECT_EQ(end % 4, 0U);
    end += view["byteLength"].get<std::size_t>();
  }
  EXPECT_EQ(end, file.binary.size());
}

TEST(SplatGlb, OnePrimitiveOfPointsNamesTheExtension) {
  const TemporaryFolder folder;
  write_splat_glb(folder / "a.glb", random_splats(1, 3, 1));
  const GlbFile file(folder / "a.glb");
  EXPECT_EQ(file.json["asset"]["version"], "2.0");
  EXPECT_EQ(file.json["extensionsUsed"], Json({"KHR_gaussian_splatting"}));
  EXPECT_FALSE(file.json.contains("extensionsRequired"));
  EXPECT_EQ(file.json["scenes"][file.json["scene"].get<std::size_t>()]["nodes"], Json({0}));
  EXPECT_EQ(file.json["nodes"][0]["mesh"], 0);
  for (const char* key : {"rotation", "matrix", "scale", "translation"})
    EXPECT_FALSE(file.json["nodes"][0].contains(key)) << key;
  EXPECT_EQ(file.json["meshes"].size(), 1U);
  EXPECT_EQ(file.json["meshes"][0]["primitives"].size(), 1U);
  EXPECT_EQ(file.primitive()["mode"], 0);
  EXPECT_FALSE(file.primitive().contains("indices"));
  EXPECT_EQ(file.primitive()["extensions"]["KHR_gaussian_splatting"], Json({{"kernel", "ellipse"},
                                                                            {"colorSpace", "srgb_rec709_display"},
                                                                            {"projection", "perspective"},
                                                                            {"sortingMethod", "cameraDistance"}}));
}

TEST(SplatGlb, PositionsHaveTheirBounds) {
  const TemporaryFolder folder;
  Splats splats = random_splats(1, 3, 1);
  splats.positions = torch::tensor({1.5f, -2.0f, 0.1f, -0.5f, 7.0f, 0.1f, 0.0f, 0.0f, 0.1f}).view({1, 3, 3});
  write_splat_glb(folder / "a.glb", splats);
  const GlbFile file(folder / "a.glb");
  EXPECT_EQ(file.accessor("POSITION")["min"], Json({-0.5, -2.0, static_cast<double>(0.1f)}));
  EXPECT_EQ(file.accessor("POSITION")["max"], Json({1.5, 7.0, static_cast<double>(0.1f)}));
}

TEST(SplatGlb, PointsHaveLinearColoursForOtherPrograms) {
  const TemporaryFolder folder;
  Splats splats = random_splats(1, 2, 4);
  // Encoded colours 0.5 + 0.2821 x: 0.5, 1.35, -0.35 and 0.0205, 0.7821, 0.2179.
  splats.harmonics.select(2, 0).copy_(torch::tensor({0.0f, 3.0f, -3.0f, -1.7f, 1.0f, -1.0f}).view({1, 2, 3}));
  splats.opacities = torch::tensor({0.0f, 2.0f}).view({1, 2});
  write_splat_glb(folder / "a.glb", splats);
  const Rows found = GlbFile(folder / "a.glb").rows("COLOR_0");
  const Rows expected{{0.214041, 1.0, 0.0, 0.5}, {0.001584, 0.573923, 0.038963, 0.880797}};
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t c = 0; c < 4; ++c) EXPECT_NEAR(found.at(i).at(c), expected[i][c], 2e-5) << i << " " << c;
}

/// Seven Gaussians of which only the last can be written.
Splats damaged_splats() {
  Splats splats = random_splats(1, 7, 4);
  splats.positions[0][0][1] = kNan;
  splats.rotations[0][1].zero_();
  splats.log_scales[0][2][0] = -kInfinity;
  splats.log_scales[0][3][2] = 89.0f;  // its exponential is beyond float32
  splats.opacities[0][4] = kInfinity;
  splats.harmonics[0][5][3][2] = kNan;
  splats.rotations[0][6] = torch::tensor({0.0f, 3e-30f, 0.0f, 4e-30f});  // the squares are 0 in float32
  return splats;
}

TEST(SplatFile, LeavesOutWhatIsNotFiniteOrHasNoDirection) {
  const TemporaryFolder folder;
  const Splats splats = damaged_splats();
  write_splat_ply(folder / "a.ply", splats);
  const PlyFile ply(folder / "a.ply");
  ASSERT_EQ(ply.count, 1U);
  EXPECT_EQ(ply.at(0, "x"), splats.positions[0][6][0].item<float>());
  EXPECT_FLOAT_EQ(ply.at(0, "rot_1"), 0.6f);
  EXPECT_FLOAT_EQ(ply.at(0, "rot_3"), 0.8f);
  write_splat_glb(folder / "a.glb", splats);
  const GlbFile glb(folder / "a.glb");
  ASSERT_EQ(glb.rows("POSITION").size(), 1U);
  EXPECT_EQ(glb.accessor("POSITION")["min"], glb.accessor("POSITION")["max"]);
  EXPECT_EQ(glb.rows("POSITION")[0][0], splats.positions[0][6][0].item<double>());
}

using Write = void (*)(const std::filesystem::path&, const Splats&, std::int64_t);
constexpr Write kWriters[] = {write_splat_ply, write_splat_glb};

TEST(SplatFile, RefusesAnEmptySetAndSaysWhatWasFound) {
  const TemporaryFolder folder;
  const auto path = folder / "a.bin";
  Splats damaged = damaged_splats();
  damaged.rotations[0][6].zero_();
  for (const Write write : kWriters) {
    EXPECT_THAT(message_of<Error>([&] { write(path, damaged, 0); }),
                AllOf(HasSubstr(path.string()), HasSubstr("Of 7 in batch item 0, 5 have a value that is not finite and "
                                                          "2 have a quaternion of length 0")));
    EXPECT_THAT(message_of<Error>([&] { write(path, random_splats(1, 0, 4), 0); }),
                AllOf(HasSubstr(path.string()), HasSubstr("Of 0")));
    EXPECT_FALSE(std::filesystem::exists(path));
  }
}

TEST(SplatFile, RefusesWrongShapesTypesAndItems) {
  const TemporaryFolder folder;
  const auto path = folder / "a.bin";
  const auto refused = [&](const std::function<void(Splats&)>& damage, std::int64_t item, const std::string& part) {
    for (const Write write : kWriters) {
      Splats splats = random_splats(2, 4, 4);
      damage(splats);
      EXPECT_THAT(message_of<UsageError>([&] { write(path, splats, item); }),
                  AllOf(HasSubstr(path.string()), HasSubstr(part)));
    }
  };
  refused([](Splats& s) { s.positions = s.positions[0]; }, 0, "positions must be float32 [B,N,3]");
  refused([](Splats& s) { s.positions = s.positions.to(torch::kFloat64); }, 0, "found float64");
  refused([](Splats& s) { s.rotations = s.rotations.slice(2, 1); }, 0, "rotations must be");
  refused([](Splats& s) { s.log_scales = s.log_scales.slice(1, 1); }, 0, "log_scales must be");
  refused([](Splats& s) { s.opacities = s.opacities.unsqueeze(2); }, 0, "opacities must be");
  refused([](Splats& s) { s.harmonics = torch::Tensor(); }, 0, "harmonics must be");
  refused([](Splats& s) { s.harmonics = s.harmonics.slice(2, 0, 3); }, 0, "found 3 spherical harmonics");
  refused([](Splats& s) { s.normals = torch::zeros({2, 3, 3}); }, 0, "normals must be");
  refused([](Splats&) {}, 2, "batch item 2 was asked for, and the Gaussians have 2 items");
  refused([](Splats&) {}, -1, "batch item -1");
}

TEST(SplatFile, CreatesFoldersAndNamesThePathWhereItCannot) {
  const TemporaryFolder folder;
  const Splats splats = random_splats(1, 2, 1);
  write_atomically(folder / "file", "no folder");
  for (const Write write : kWriters) {
    write(folder / "new" / "folder" / "a.bin", splats, 0);
    EXPECT_TRUE(std::filesystem::exists(folder / "new" / "folder" / "a.bin"));
    const auto path = folder / "file" / "a.bin";
    EXPECT_THAT(message_of<Error>([&] { write(path, splats, 0); }),
                AllOf(HasSubstr(path.string()), HasSubstr("cannot create its folder")));
  }
}

TEST(SplatFile, RefusesGlbFilesBeyondFourGigabytes) {
  const TemporaryFolder folder;
  Splats splats = random_splats(1, 1, 16);
  const std::int64_t count = 20'000'000;
  splats = {splats.positions.expand({1, count, 3}),     splats.rotations.expand({1, count, 4}),
            splats.log_scales.expand({1, count, 3}),    splats.opacities.expand({1, count}),
            splats.harmonics.expand({1, count, 16, 3}), {}};
  EXPECT_THAT(message_of<Error>([&] { write_splat_glb(folder / "a.glb", splats); }),
              AllOf(HasSubstr("a.glb"), HasSubstr("20000000 Gaussians of 252 bytes need 5.0 GB")));
}

}  // namespace
}  // namespace doppel::splat_file_test
