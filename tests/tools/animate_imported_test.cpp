// An imported rig, played by the program, moves as its file.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/npy.h"
#include "run_program.h"
#include "support/rig_reference.h"
#include "support/temporary_folder.h"

namespace doppel::tools::animate_imported_test {
namespace {

using Json = nlohmann::json;

class RealAnimateImported : public support::RigReferenceTest {};

TEST_P(RealAnimateImported, VerticesAreThoseOfTheFile) {
  const support::TemporaryFolder out;
  const std::string rig = (out / "rig").string(), played = (out / "played").string();
  const Outcome imported = run("character import '" + (folder_ / reference_["file"].get<std::string>()).string() +
                               "' --out " + rig + " --animation '" + animation().name + "' --json");
  ASSERT_EQ(imported.code, 0) << imported.err;
  const Json motion = Json::parse(read_file(out / "rig/motions.json"))["motions"].at(0);
  const Outcome animated = run("animate --character " + rig + "/actor.character --motion '" + rig + "/" +
                               motion["file"].get<std::string>() + "' --format npy --out " + played);
  ASSERT_EQ(animated.code, 0) << animated.err;

  const NpyArray vertices = read_npy(out / "played/vertices.npy");
  const std::vector<float> values = vertices.as<float>();
  const std::vector<int> map = read_npy(out / "rig/vertex_map.npy").as<int>();
  const double at = (reference_["time_s"].get<double>() - motion["start_s"].get<double>()) *
                    motion["frames_per_second"].get<double>();
  const auto frame = as_size(std::min(at, static_cast<double>(vertices.shape[0] - 1)));
  const std::size_t next = std::min(frame + 1, as_size(vertices.shape[0]) - 1);
  std::vector<Eigen::Vector3d> posed;
  for (std::size_t v = 0; v < map.size(); ++v) {
    const Eigen::Vector3d low = Eigen::Map<const Eigen::Vector3f>(&values[3 * (frame * map.size() + v)]).cast<double>();
    const Eigen::Vector3d high = Eigen::Map<const Eigen::Vector3f>(&values[3 * (next * map.size() + v)]).cast<double>();
    posed.push_back(low + (at - std::floor(at)) * (high - low));
  }
  const Json joints = Json::parse(read_file(out / "rig/joints.json"));
  Eigen::Affine3d file_from_character;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      file_from_character(row, column) = joints["file_from_character"][row][column].get<double>();
  EXPECT_LT(largest_error(posed, map, file_from_character), 1e-4);
  EXPECT_EQ(found_, 200);
}

INSTANTIATE_TEST_SUITE_P(Real, RealAnimateImported, support::rig_references(),
                         [](const auto& body) { return std::string(body.param); });

}  // namespace
}  // namespace doppel::tools::animate_imported_test
