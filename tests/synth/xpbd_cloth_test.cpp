#include "doppel/synth/xpbd_cloth.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "doppel/core/error.h"
#include "doppel/geometry/topology.h"
#include "doppel/synth/capture_writer.h"
#include "doppel/synth/performance.h"
#include "doppel/synth/posed_body.h"
#include "doppel/synth/synth.h"
#include "support/message_of.h"

namespace doppel::xpbd_cloth_test {
namespace {

using namespace synth;
using Eigen::Vector3d;

/// A square of cloth in the plane y = 0 with `cells` x `cells` squares of two triangles. All vertices are free.
Cloth square(int cells, double edge) {
  Cloth cloth;
  for (int i = 0; i <= cells; ++i)
    for (int k = 0; k <= cells; ++k) cloth.rest.emplace_back(k * edge, 0, i * edge);
  const auto at = [&](int i, int k) { return i * (cells + 1) + k; };
  for (int i = 0; i < cells; ++i)
    for (int k = 0; k < cells; ++k) {
      cloth.faces.push_back({at(i, k), at(i + 1, k), at(i, k + 1)});
      cloth.faces.push_back({at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)});
    }
  cloth.held.assign(cloth.rest.size(), 0);
  cloth.knitted = cloth.held;
  return cloth;
}

/// No air and no losses, so that closed forms hold.
XpbdOptions vacuum() {
  XpbdOptions options;
  options.drag = options.loss = options.damping = 0;
  return options;
}

void run(ClothSolver& solver, const Cloth& cloth, double seconds, double dt, const Obstacle* obstacle = nullptr) {
  const int steps = static_cast<int>(std::lround(seconds / dt));
  for (int k = 0; k < steps; ++k) solver.step(dt, cloth.rest, obstacle);
}

Vector3d mean(const Points& points) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& p : points) sum += p;
  return sum / static_cast<double>(points.size());
}

double fastest(const ClothSolver& solver) {
  double speed = 0;
  for (const Vector3d& v : solver.velocities()) speed = std::max(speed, v.norm());
  return speed;
}

/// The half-space below a plane through the origin that moves along itself.
class Plane : public Obstacle {
 public:
  explicit Plane(const Vector3d& normal, const Vector3d& motion = Vector3d::Zero())
      : normal_(normal.normalized()), motion_(motion) {}
  std::optional<Touch> touch(int, const Vector3d& p) const override {
    const double depth = -normal_.dot(p);
    if (depth <= 0) return std::nullopt;
    return Touch{depth, normal_, motion_};
  }

 private:
  Vector3d normal_, motion_;
};

TEST(XpbdSolver, FallsLikeAFreeBody) {
  const Cloth cloth = square(3, 0.05);
  ClothSolver solver(cloth, vacuum());
  const double dt = 1e-3;
  const int steps = 400;
  run(solver, cloth, steps * dt, dt);
  for (std::size_t v = 0; v < cloth.rest.size(); ++v) {
    EXPECT_NEAR(solver.velocities()[v].y(), -9.81 * steps * dt, 1e-9);
    // The sum of the steps, which tends to g t² / 2.
    EXPECT_NEAR((solver.positions()[v] - cloth.rest[v]).y(), -0.5 * 9.81 * dt * dt * steps * (steps + 1), 1e-9);
  }
}

TEST(XpbdSolver, ReachesTheTerminalSpeedOfItsDrag) {
  for (const double drag : {1.0, 4.0}) {
    Cloth cloth = square(3, 0.05);
    XpbdOptions options = vacuum();
    options.drag = drag;
    ClothSolver flat(cloth, options);
    run(flat, cloth, 3, 1e-3);
    EXPECT_NEAR(-mean(flat.velocities()).y(), std::sqrt(9.81 / drag), 0.01 * std::sqrt(9.81 / drag)) << drag;
    // On edge, the air does not act.
    for (Vector3d& p : cloth.rest) p = Vector3d(p.x(), p.z(), 0);
    ClothSolver upright(cloth, options);
    run(upright, cloth, 0.5, 1e-3);
    EXPECT_NEAR(-mean(upright.velocities()).y(), 9.81 * 0.5, 1e-6);
  }
}

TEST(XpbdSolver, LosesSpeedAtTheRateOfTheLoss) {
  const Cloth cloth = square(2, 0.05);
  XpbdOptions options = vacuum();
  options.loss = 2;
  ClothSolver solver(cloth, options);
  run(solver, cloth, 5, 1e-3);
  EXPECT_NEAR(-mean(solver.velocities()).y(), 9.81 / 2, 0.02);
}

TEST(XpbdSolver, NeverExceedsTheLargestSpeed) {
  const Cloth cloth = square(2, 0.05);
  XpbdOptions options = vacuum();
  options.speed = 3;
  ClothSolver solver(cloth, options);
  run(solver, cloth, 1, 1e-3);
  EXPECT_NEAR(fastest(solver), 3, 1e-6);
}

/// A vertex that hangs on two held ones by two edges, each at 30 degrees to the vertical.
TEST(XpbdSolver, StretchesByComplianceTimesForce) {
  for (const double compliance : {0.05, 0.2}) {
    Cloth cloth;
    cloth.rest = {{-0.05, 0, 0}, {0.05, 0, 0}, {0, -0.05 * std::sqrt(3.0), 0}};
    cloth.faces = {{0, 2, 1}};
    cloth.held = {1, 1, 0};
    cloth.knitted = {0, 0, 0};
    XpbdOptions options = vacuum();
    options.stretch = compliance;
    options.loss = 20;
    ClothSolver solver(cloth, options);
    run(solver, cloth, 3, 2.5e-4);
    const double area = 0.05 * 0.05 * std::sqrt(3.0), weight = options.density * area / 3 * options.gravity;
    const double expected = compliance * weight / (2 * std::cos(M_PI / 6));
    EXPECT_NEAR((solver.positions()[2] - cloth.rest[0]).norm() - 0.1, expected, 0.02 * expected);
  }
}

/// A held triangle and a free one beside it, both horizontal: a shelf that bends along one edge.
TEST(XpbdSolver, SagsUntilTheMomentOfTheFoldCarriesTheWeight) {
  for (const double compliance : {20.0, 60.0}) {
    Cloth cloth;
    const double edge = 0.04, height = 0.06;
    cloth.rest = {{0, 0, 0}, {0, 0, edge}, {height, 0, 0.5 * edge}, {-height, 0, 0.5 * edge}};
    cloth.faces = {{0, 1, 2}, {1, 0, 3}};
    cloth.held = {1, 1, 0, 1};
    cloth.knitted = {0, 0, 0, 0};
    XpbdOptions options = vacuum();
    options.bending = compliance * 100;
    options.stretch = 1e-7;
    options.loss = 20;
    ClothSolver solver(cloth, options);
    run(solver, cloth, 4, 5e-4);
    const double angle = std::asin(-solver.positions()[2].y() / height);
    // Rigidity length² / area of both faces is the moment per angle; it equals weight times lever.
    const double moment = edge * edge / (edge * height) / options.bending * angle;
    const double weight = options.density * 0.5 * edge * height / 3 * options.gravity;
    EXPECT_GT(angle, 0.02);
    EXPECT_NEAR(moment, weight * height * std::cos(angle), 0.02 * moment);
    EXPECT_LT(fastest(solver), 1e-6);
  }
}

TEST(XpbdSolver, KeepsTheMomentumOfAFreeCloth) {
  const Cloth cloth = square(4, 0.05);
  XpbdOptions options = vacuum();
  options.gravity = 0;
  ClothSolver solver(cloth, options);
  Points start = cloth.rest;
  for (std::size_t v = 0; v < start.size(); ++v) start[v] += 0.01 * Vector3d(std::sin(3.0 * v), std::cos(5.0 * v), 0);
  solver.move_to(start);
  std::vector<double> mass(start.size(), 0.0);
  for (const Triangle& f : cloth.faces)
    for (const int v : f) mass[v] += options.density * 0.5 * 0.05 * 0.05 / 3;
  run(solver, cloth, 0.2, 1e-3);
  Vector3d momentum = Vector3d::Zero();
  double size = 0;
  for (std::size_t v = 0; v < start.size(); ++v) {
    momentum += mass[v] * solver.velocities()[v];
    size += mass[v] * solver.velocities()[v].norm();
  }
  EXPECT_GT(size, 1e-5) << "nothing moves";
  EXPECT_LT(momentum.norm(), 1e-9 * size);
}

TEST(XpbdSolver, SlidesDownASlopeAsCoulombSays) {
  const double slope = M_PI / 6;
  const Vector3d normal(std::sin(slope), std::cos(slope), 0), down(std::cos(slope), -std::sin(slope), 0);
  Cloth cloth = square(3, 0.05);
  for (Vector3d& p : cloth.rest) p = p.x() * down + Vector3d(0, 0, p.z());
  for (const double friction : {0.0, 0.3, 0.5, 0.65, 5.0}) {  // tan 30° = 0.577
    XpbdOptions options = vacuum();
    options.friction = friction;
    ClothSolver solver(cloth, options);
    const Plane plane(normal);
    run(solver, cloth, 0.5, 1e-3, &plane);
    const double slid = (mean(solver.positions()) - mean(cloth.rest)).dot(down);
    const double acceleration = 9.81 * std::max(0.0, std::sin(slope) - friction * std::cos(slope));
    EXPECT_NEAR(slid, 0.5 * acceleration * 0.25, 0.01 * 0.5 * acceleration * 0.25 + 1e-6) << friction;
  }
}

TEST(XpbdSolver, IsCarriedByAMovingBodyThroughFrictionOnly) {
  const Cloth cloth = square(2, 0.05);
  for (const double friction : {0.0, 0.5}) {
    XpbdOptions options = vacuum();
    options.friction = friction;
    ClothSolver solver(cloth, options);
    const double dt = 1e-3, speed = 0.4;
    const Plane plane(Vector3d::UnitY(), Vector3d(dt * speed, 0, 0));
    run(solver, cloth, 1, dt, &plane);
    EXPECT_NEAR(mean(solver.velocities()).x(), friction > 0 ? speed : 0, 1e-6);
  }
}

TEST(XpbdSolver, LeavesABodyWithoutBeingThrownOff) {
  Cloth cloth = square(3, 0.05);
  for (Vector3d& p : cloth.rest) p.y() = -0.05;
  ClothSolver solver(cloth, vacuum());
  const Plane plane(Vector3d::UnitY());
  for (int k = 0; k < 200; ++k) {
    solver.step(1e-3, cloth.rest, &plane);
    for (const Vector3d& p : solver.positions()) ASSERT_NEAR(p.y(), 0, 1e-4);
  }
  EXPECT_LT(fastest(solver), 0.02);
}

TEST(XpbdSolver, HangsInEquilibriumWithEdgesOfTheirLength) {
  Cloth cloth = square(12, 0.03);
  for (int k = 0; k <= 12; ++k) cloth.held[k] = 1;
  ClothSolver solver(cloth, XpbdOptions{});
  run(solver, cloth, 0.2, 1e-3);
  EXPECT_GT(fastest(solver), 0.5) << "it falls at first";
  run(solver, cloth, 12, 1e-3);
  EXPECT_LT(fastest(solver), 0.01);
  EXPECT_LT(mean(solver.positions()).y(), -0.12) << "it hangs down";
  for (const Triangle& f : cloth.faces)
    for (int k = 0; k < 3; ++k) {
      const int a = f[k], b = f[(k + 1) % 3];
      EXPECT_NEAR((solver.positions()[a] - solver.positions()[b]).norm() / (cloth.rest[a] - cloth.rest[b]).norm(), 1,
                  0.02);
    }
}

const Actor& actor() {
  static const Actor made = make_actor(SynthOptions::preset("tiny").actor);
  return made;
}

/// A motion that begins in the rest pose. @param pose changes the DoFs of a frame; called with a lookup by name
template <typename Pose>
Motion acted(int frames, const Pose& pose) {
  Motion motion;
  for (int f = 0; f < frames; ++f) {
    std::vector<double> dofs = actor().character.rest_dofs;
    pose(f, [&](const std::string& name) -> double& { return dofs[*actor().character.skeleton.find_dof(name)]; });
    motion.frames.push_back(dofs);
    motion.ids.push_back(f);
  }
  return motion;
}

/// 0 before `begin`, 1 after `end`, linear in between.
double ramp(int f, double begin, double end) { return std::clamp((f - begin) / (end - begin), 0.0, 1.0); }

/// A second of rest, a kick of 85 degrees within a sixth of a second, a squat with bent knees, and a fast half turn.
const Motion& fast_motion() {
  static const Motion motion = acted(56, [](int f, const auto& dof) {
    const double kick = ramp(f, 20, 24) - ramp(f, 26, 30), squat = ramp(f, 32, 38) - ramp(f, 46, 52);
    dof("LeftUpLeg_rx") = 1.5 * kick + 1.1 * squat;
    dof("RightUpLeg_rx") = 1.1 * squat;
    dof("LeftLeg_rx") = dof("RightLeg_rx") = 1.5 * squat;
    dof("Root_ty") += 0.25 * kick - 0.2 * squat;
    dof("Root_ry") = 3.0 * (ramp(f, 36, 44) - ramp(f, 44, 50));
    dof("LeftArm_rz") = dof("RightArm_rz") = -0.6 * ramp(f, 10, 14) + 1.2 * ramp(f, 30, 36);
  });
  return motion;
}

const std::vector<Points>& worn_fast() {
  static const std::vector<Points> worn = skin_motion(actor().character, fast_motion(), actor().hang);
  return worn;
}

const std::vector<Points>& draped_fast() {
  static const std::vector<Points> surfaces = drape_clothes(actor(), worn_fast(), fast_motion(), 25);
  return surfaces;
}

std::vector<ClothRole> roles() { return cloth_roles(actor(), XpbdOptions{}.pinned); }

/// Relative changes of the lengths of the skirt's edges, absolute values in ascending order.
std::vector<double> strains(const Points& surface) {
  const std::vector<ClothRole> role = roles();
  const TriangleMesh& mesh = actor().character.mesh;
  const MeshTopology topology(mesh);
  std::vector<double> result;
  for (const auto& [a, b] : topology.edges()) {
    const bool woven = role[a] == ClothRole::woven || role[b] == ClothRole::woven;
    if (!woven || role[a] == ClothRole::lining || role[b] == ClothRole::lining) continue;
    const double length = (mesh.vertices[a] + actor().hang[a] - mesh.vertices[b] - actor().hang[b]).norm();
    result.push_back(std::abs((surface[a] - surface[b]).norm() / length - 1));
  }
  std::sort(result.begin(), result.end());
  return result;
}

TEST(XpbdCloth, GivesEachVertexARole) {
  const std::vector<ClothRole> role = roles();
  const auto count = [&](ClothRole r) { return std::count(role.begin(), role.end(), r); };
  EXPECT_GT(count(ClothRole::woven), 250);
  EXPECT_GT(count(ClothRole::knitted), 150);
  EXPECT_GT(count(ClothRole::lining), 100);
  for (std::size_t v = 0; v < role.size(); ++v) {
    const Vector3d& p = actor().character.mesh.vertices[v];
    if (role[v] != ClothRole::skin) {
      EXPECT_GE(actor().looseness[v], XpbdOptions{}.pinned);
      EXPECT_FALSE(p.y() > 1.42 || p.y() < 0.45) << "the clothes end at " << p.y();
    }
    if (role[v] == ClothRole::lining) {
      EXPECT_LT(p.y(), 0.72) << "the lining begins at the ceiling of the skirt";
    }
  }
}

TEST(XpbdCloth, KeepsItsLengthsInFastMotion) {
  std::vector<double> all;
  for (const Points& surface : draped_fast()) {
    const std::vector<double> some = strains(surface);
    all.insert(all.end(), some.begin(), some.end());
  }
  std::sort(all.begin(), all.end());
  double sum = 0;
  for (const double strain : all) sum += strain;
  EXPECT_LT(sum / static_cast<double>(all.size()), 0.01);
  EXPECT_LT(all[all.size() * 9 / 10], 0.02);
  EXPECT_LT(all.back(), 1.0);
  // The skinned clothes do stretch.
  const std::vector<double> skinned = strains(worn_fast()[42]);
  EXPECT_GT(skinned[skinned.size() / 2], 0.02);
}

TEST(XpbdCloth, StaysOutOfTheBodyInFastMotion) {
  const std::vector<ClothRole> role = roles();
  PosedBody body(actor());
  SkinPatch skin(actor());
  double cloth = 0, lining = 0, skinned = 0;
  for (std::size_t f = 0; f < draped_fast().size(); ++f) {
    body.move(fast_motion().frames[f]);
    skin.move(worn_fast()[f]);
    const auto depth = [&](const Vector3d& p) {
      const auto touch = skin.touch(p, 0);
      return std::max(-body.distance(p), touch ? touch->depth : 0.0);
    };
    for (std::size_t v = 0; v < role.size(); ++v) {
      if (role[v] == ClothRole::woven) cloth = std::max(cloth, depth(draped_fast()[f][v]));
      if (role[v] == ClothRole::woven) skinned = std::max(skinned, depth(worn_fast()[f][v]));
      if (role[v] == ClothRole::lining) lining = std::max(lining, depth(draped_fast()[f][v]));
    }
  }
  EXPECT_LT(cloth, 0.003);
  EXPECT_LT(lining, 0.005);
  EXPECT_GT(skinned, 0.02) << "the motion does not test the contact";
}

TEST(XpbdCloth, LeavesTheSkinToTheBodyAndStaysWithinReach) {
  const std::vector<ClothRole> role = roles();
  double largest = 0;
  for (std::size_t f = 0; f < draped_fast().size(); ++f)
    for (std::size_t v = 0; v < role.size(); ++v) {
      const Vector3d off = draped_fast()[f][v] - worn_fast()[f][v];
      ASSERT_TRUE(off.allFinite());
      if (role[v] == ClothRole::skin) {
        ASSERT_EQ(off, Vector3d(0, 0, 0));
      }
      largest = std::max(largest, off.norm());
    }
  EXPECT_GT(largest, 0.13) << "more than the springs allow";
  EXPECT_LT(largest, XpbdOptions{}.reach + 0.05);
}

TEST(XpbdCloth, GivesTheSameTwice) {
  const std::size_t frames = 24;  // into the kick
  Motion motion;
  motion.frames.assign(fast_motion().frames.begin(), fast_motion().frames.begin() + frames);
  motion.ids.assign(fast_motion().ids.begin(), fast_motion().ids.begin() + frames);
  const std::vector<Points> worn(worn_fast().begin(), worn_fast().begin() + frames);
  const auto again = drape_clothes(actor(), worn, motion, 25);
  // The last frame depends on the next one, which the shorter motion does not have.
  for (std::size_t f = 0; f + 1 < frames; ++f) EXPECT_EQ(again[f], draped_fast()[f]) << "frame " << f;
  EXPECT_NE(again.back(), draped_fast()[frames - 1]);
}

TEST(XpbdCloth, ComesToRestOnAStillBody) {
  const Motion motion = acted(150, [](int, const auto&) {});
  const auto surfaces = drape_clothes(actor(), skin_motion(actor().character, motion, actor().hang), motion, 25);
  const auto speed = [&](std::size_t f) {
    double sum = 0;
    int count = 0;
    for (std::size_t v = 0; v < surfaces[f].size(); ++v) {
      if (actor().looseness[v] < 0.5) continue;
      sum += 25 * (surfaces[f][v] - surfaces[f - 1][v]).norm();
      ++count;
    }
    return sum / count;
  };
  EXPECT_GT(speed(5), 0.05) << "it drops at first";
  EXPECT_LT(speed(149), 0.006);
  EXPECT_LT(speed(149), 0.3 * speed(70));
  const std::vector<double> at_rest = strains(surfaces.back());
  EXPECT_LT(at_rest[at_rest.size() * 95 / 100], 0.015);
  EXPECT_LT(at_rest.back(), 0.05);
}

TEST(XpbdCloth, DependsOnTheHistoryNotOnThePoseAlone) {
  std::array<Points, 3> last;
  for (int way = 0; way < 3; ++way) {
    const Motion motion = acted(26, [&](int f, const auto& dof) { dof("Root_ry") = (way - 1) * 0.12 * (f - 25); });
    last[way] = drape_clothes(actor(), skin_motion(actor().character, motion, actor().hang), motion, 25).back();
  }
  double still = 0, sides = 0;
  for (std::size_t v = 0; v < last[0].size(); ++v) {
    still = std::max(still, (last[0][v] - last[1][v]).norm());
    sides = std::max(sides, (last[0][v] - last[2][v]).norm());
  }
  EXPECT_GT(still, 0.02);
  EXPECT_GT(sides, 0.025);
}

TEST(XpbdCloth, NamesTheFrameThatIsNotFinite) {
  Motion motion = acted(5, [](int, const auto&) {});
  std::vector<Points> worn = skin_motion(actor().character, motion, actor().hang);
  const auto message = [&](const XpbdOptions& options = {}) -> std::string {
    return support::message_of<Error>([&] { drape_clothes(actor(), worn, motion, 25, options); });
  };
  XpbdOptions wild;
  wild.gravity = std::numeric_limits<double>::infinity();
  EXPECT_NE(message(wild).find("frame 1 has a position that is not finite"), std::string::npos) << message(wild);
  worn[3][7].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(message().find("frame 3 is not finite"), std::string::npos) << message();
  worn[3][7].x() = 0;
  motion.frames[2][8] = std::numeric_limits<double>::infinity();
  EXPECT_NE(message().find("frame 2 is not finite"), std::string::npos) << message();
  worn.pop_back();
  EXPECT_NE(message().find("4 frames of skinned clothes, but 5 poses"), std::string::npos) << message();
}

TEST(PosedBody, HasTheDistancesOfTheBodyFieldInTheRestPose) {
  const PosedBody body(actor());
  const BodyField field;
  for (const Vector3d& p : {Vector3d(0.1, 0.4, 0.09), Vector3d(0.1, 0.48, 0.075), Vector3d(-0.2, 0.75, 0.02),
                            Vector3d(0, 0.95, 0.13), Vector3d(-0.1, 0.2, -0.1)}) {
    auto part = field.part_distances(p);
    for (const Part other :
         {kSkirt, kHead, kHair, kLeftArm, kLeftForearm, kLeftHand, kRightArm, kRightForearm, kRightHand})
      part[other] = 10;
    EXPECT_NEAR(body.distance(p), BodyField::joined(part), 1e-12) << p.transpose();
  }
  EXPECT_LT(body.distance(BodyPlan::fingertip() - 0.05 * BodyPlan::arm_direction()), 0) << "inside the hand";
  EXPECT_GT(body.distance({0, 1.2, 3}), 1);
}

TEST(PosedBody, PushesAPointToItsSurfaceAndMovesWithItsBone) {
  PosedBody body(actor());
  std::vector<double> dofs = actor().character.rest_dofs;
  const Skeleton& skeleton = actor().character.skeleton;
  dofs[*skeleton.find_dof("LeftUpLeg_rx")] = 0.9;
  body.move(dofs);
  dofs[*skeleton.find_dof("Root_tx")] = 0.02;
  body.move(dofs);
  // In the middle of the raised thigh, 5 mm below its upper side.
  const auto world_from_joint = skeleton.pose(dofs), rest_from_joint = skeleton.pose(actor().character.rest_dofs);
  const int joint = *skeleton.find_joint("LeftUpLeg_ry");
  const Vector3d middle = 0.5 * (BodyPlan::hip() + BodyPlan::knee());
  const Vector3d p = world_from_joint[joint] * rest_from_joint[joint].inverse() * (middle + Vector3d(0, 0, 0.07));
  const auto touch = body.touch(p, 0.004);
  ASSERT_TRUE(touch);
  EXPECT_NEAR(body.distance(p + touch->depth * touch->normal), 0.004, 1e-4);
  EXPECT_LT((touch->motion - Vector3d(0.02, 0, 0)).norm(), 1e-9);
  EXPECT_GT(touch->normal.y(), 0.5) << "up, because the thigh is raised";
  EXPECT_FALSE(body.touch(p + 0.1 * touch->normal, 0.004));
}

TEST(ClothModel, IsChosenByName) {
  EXPECT_EQ(cloth_model("springs"), ClothModel::springs);
  EXPECT_EQ(cloth_model("xpbd"), ClothModel::xpbd);
  EXPECT_THROW(cloth_model("silk"), UsageError);
  SynthOptions options = SynthOptions::preset("tiny");
  EXPECT_EQ(options.cloth.model, ClothModel::springs) << "the default";
  EXPECT_EQ(SynthOptions::preset("studio").cloth.model, ClothModel::xpbd);
  const std::vector<SequencePlan> plans{{"training", true, {{24, 1, {}}}}, {"testing", false, {{12, 2, {}}}}};
  EXPECT_NE(readme_text(options, plans).find("with inertia, drag and\nsprings, and hang wider"), std::string::npos);
  options.cloth.model = ClothModel::xpbd;
  EXPECT_NE(readme_text(options, plans).find("The clothes (xpbd) hardly stretch"), std::string::npos);
}

TEST(ClothModel, SpringsAreTheDefaultAndUnchanged) {
  const int frames = 4, lead = 30;
  SynthOptions xpbd;
  xpbd.cloth.model = ClothModel::xpbd;
  const TakePlan plan{frames, 5, {}};
  const Take take = perform(actor(), plan, {}), other = perform(actor(), plan, xpbd);
  const Motion motion = make_motion(actor().character.skeleton, lead + frames, 25, 5);
  const auto springs = move_clothes(actor(), skin_motion(actor().character, motion, actor().hang), 25);
  for (int f = 0; f < frames; ++f) {
    EXPECT_EQ(take.ground_truth[f], springs[lead + f]);
    EXPECT_NE(take.ground_truth[f], other.ground_truth[f]);
  }
  EXPECT_EQ(take.motion.frames, other.motion.frames);
}

}  // namespace
}  // namespace doppel::xpbd_cloth_test
