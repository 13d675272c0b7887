#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <tuple>

#include "doppel/core/error.h"
#include "doppel/rigging/autorig/create_character.h"
#include "rigging/scan/figures.h"
#include "support/blazepose_weights.h"
#include "support/message_of.h"

namespace doppel::real_refusals_test {
namespace {

using support::append;
using support::make_box;
using support::make_limb;
using support::message_of;

/// Scans that are no standing person, as BlazePose sees them.
class RealRefusals : public support::BlazePoseTest {
 protected:
  TriangleMesh body(const std::string& name) const { return read_obj(shared_ / "bodies" / name / "body.obj", 1.0); }
  static std::string refusal_of(const TriangleMesh& mesh) {
    CreateCharacterOptions options;
    options.orientation.unit = "m";
    options.orientation.up = "y";
    return message_of<Error>([&] { create_character("actor", {{{"body", mesh}}}, options); });
  }
};

TriangleMesh moved(TriangleMesh mesh, const Eigen::Vector3d& shift) {
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex += shift;
  return mesh;
}

TriangleMesh chair() {
  TriangleMesh mesh = make_box({-0.25, 0.42, -0.25}, {0.25, 0.48, 0.25});
  append(mesh, make_box({-0.25, 0.48, -0.25}, {0.25, 1.1, -0.2}));
  for (const double x : {-0.22, 0.22})
    for (const double z : {-0.22, 0.22}) append(mesh, make_limb({x, 0.03, z}, {x, 0.42, z}, 0.025));
  return mesh;
}

/// Bends a standing body onto a chair: what lies below the hips follows a line that turns forwards there and down again
/// at the knees. @param hip, knee heights
TriangleMesh seated(TriangleMesh mesh, double hip, double knee) {
  constexpr double kRadius = 0.12;
  const double quarter = 0.5 * M_PI * kRadius, thigh = std::max(hip - knee - quarter, 0.1);
  for (Eigen::Vector3d& vertex : mesh.vertices) {
    const double depth = hip - vertex.y();
    if (depth <= 0) continue;
    // Along the line: an arc, the thigh, the arc back, the shank.
    const double first = std::min(depth, quarter), second = std::clamp(depth - quarter - thigh, 0.0, quarter);
    const double angle = (first - second) / kRadius, straight = std::clamp(depth - quarter, 0.0, thigh);
    const double below = std::max(depth - 2 * quarter - thigh, 0.0);
    const double a = first / kRadius, b = second / kRadius;
    const double z = kRadius * (1 - std::cos(a)) + straight + kRadius * std::sin(b);
    const double y = -kRadius * std::sin(a) - kRadius * (1 - std::cos(b)) - below;
    const double offset = vertex.z();
    vertex.y() = hip + y + offset * std::sin(angle);
    vertex.z() = z + offset * std::cos(angle);
  }
  return mesh;
}

TEST_F(RealRefusals, WhatIsNoPerson) {
  const TriangleMesh ball = make_limb({0, 0.85, 0}, {0, 0.851, 0}, 0.85);
  for (const TriangleMesh& thing : {make_box({-0.25, 0, -0.15}, {0.25, 1.75, 0.15}), ball, chair()})
    EXPECT_EQ(refusal_of(thing),
              "finding joints: a person was found in 0 of 32 images of the scan; expected is one standing person. If "
              "the scan lies on its side or stands on its head, say which axis points up (--up); if it is no whole "
              "person, give the joints yourself (--joints)");
}

TEST_F(RealRefusals, TwoPersonsSideBySide) {
  for (const double apart : {1.3, 2.0}) {
    TriangleMesh two = body("mh_woman_slim");
    append(two, moved(body("mh_woman_slim"), {apart, 0, 0}));
    EXPECT_THAT(refusal_of(two),
                ::testing::MatchesRegex("the scan holds several bodies that do not touch; the largest has 5[0-9] % of "
                                        "their surface. Cut the scan so that one person is left"))
        << apart;
  }
}

/// Two persons whose scans touch are one surface: only the images tell.
TEST_F(RealRefusals, TwoPersonsHandInHand) {
  TriangleMesh two = body("mh_woman_slim");
  append(two, moved(body("mh_woman_slim"), {0.98, 0, 0}));
  append(two, make_limb({0.4, 0.98, 0.16}, {0.58, 0.98, 0.16}, 0.04));
  EXPECT_THAT(refusal_of(two),
              ::testing::MatchesRegex("finding joints: [0-9]+ of 32 images of the scan show more than one person; cut "
                                      "the scan so that one person is left"));
}

TEST_F(RealRefusals, ABust) {
  TriangleMesh bust = body("mh_woman_slim");
  for (Eigen::Vector3d& vertex : bust.vertices) vertex.y() = std::max(vertex.y() - 1.2, 0.0);
  EXPECT_THAT(refusal_of(bust),
              ::testing::MatchesRegex(
                  "finding joints: [a-z]+_[a-z]+ is not in the scan .seen with a probability of 0.[0-9]+.; a whole "
                  "person from head to feet is needed, a bust cannot be rigged"));
}

TEST_F(RealRefusals, APersonWhoSits) {
  for (const auto& [name, hip, knee] : {std::tuple{"mh_woman_slim", 0.84, 0.45}, {"m2m_male_apose", 0.92, 0.5}})
    EXPECT_EQ(refusal_of(seated(body(name), hip, knee)),
              "finding joints: the person sits; scan the person standing, with the arms away from the trunk");
}

/// No criterion above may refuse a body that stands.
TEST_F(RealRefusals, EveryBodyIsOneBody) {
  for (const auto& folder : std::filesystem::directory_iterator(shared_ / "bodies"))
    for (const char* file : {"body.obj", "scan.obj"}) {
      if (!std::filesystem::exists(folder.path() / file)) continue;
      const ScanOrientation orientation = find_orientation(read_obj(folder.path() / file, 1.0));
      EXPECT_GT(orientation.shape.largest_share, 0.8) << folder.path();
    }
}

}  // namespace
}  // namespace doppel::real_refusals_test
