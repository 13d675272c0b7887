#include "doppel/rigging/weights/bend_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "doppel/character/blend_skin.h"
#include "doppel/rigging/joints/hinges.h"
#include "doppel/rigging/joints/limb_piece.h"
#include "doppel/rigging/joints/sticking.h"
#include "doppel/rigging/weights/stretch.h"
#include "doppel/rigging/weights/test_poses.h"

namespace doppel {
namespace {

using Eigen::Vector3d;

/// A limb of which the middle joint is examined.
struct ExaminedLimb {
  LimbPiece piece;
  double rest_volume;
};

ExaminedLimb limb_of(const Character& character, const Hinge& hinge) {
  std::vector<bool> of_limb(character.skin.num_bones(), false);
  for (const int bone : hinge.limb) of_limb[bone] = true;
  std::vector<bool> member;
  for (int v = 0; v < character.num_vertices(); ++v) {
    const auto row = character.skin.vertex_bones.row(v);
    const auto weights = character.skin.vertex_bones.row_of(character.skin.weights, v);
    double sum = 0.0;
    for (std::size_t i = 0; i < row.size(); ++i) sum += of_limb[row[i]] ? weights[i] : 0.0;
    member.push_back(sum > 0.5);
  }
  const TriangleMesh& mesh = character.mesh;
  LimbPiece piece(mesh.vertices, mesh.faces, member, hinge.positions);
  const double volume = piece.volume(mesh.vertices);
  return {std::move(piece), volume};
}

/// The volume relative to the rest pose; of all limbs the one farthest from 1.
std::optional<double> worst_volume(const std::vector<ExaminedLimb>& limbs, const std::vector<Vector3d>& posed) {
  std::optional<double> worst;
  for (const ExaminedLimb& limb : limbs) {
    if (!(limb.rest_volume > 0.0)) continue;
    const double share = limb.piece.volume(posed) / limb.rest_volume;
    if (!worst || std::abs(share - 1.0) > std::abs(*worst - 1.0)) worst = share;
  }
  return worst;
}

std::string volume_fault(const PoseBend& bend, const char* joint, const std::optional<double>& volume) {
  constexpr double kLimit = 0.12;  // share of the volume that is lost or gained
  if (!volume || std::abs(*volume - 1.0) <= kLimit) return "";
  return fmt::format("in the pose '{}' {} {} {:.0f} % of its volume (limit {:.0f} %)", bend.pose, joint,
                     *volume < 1.0 ? "loses" : "gains", 100.0 * std::abs(*volume - 1.0), 100.0 * kLimit);
}

}  // namespace

BendReport examine_bending(const Character& character) {
  const TriangleMesh& mesh = character.mesh;
  const StickingVertices sticking(character);
  const IndexRows neighbours = face_neighbours(mesh.faces);
  std::vector<ExaminedLimb> elbows, knees;
  for (const Hinge& hinge : find_hinges(character)) (hinge.knee ? knees : elbows).push_back(limb_of(character, hinge));
  BendReport report{mesh.num_faces(), mesh.num_vertices(), {}};
  for (const TestPose& pose : test_poses(character.skeleton, character.rest_dofs)) {
    const SkinBlend blend(bone_motions(character, pose.dofs), character.skinning);
    const std::vector<Vector3d> posed = blend.vertices(mesh.vertices, character.skin);
    const StretchedTriangles stretched =
        count_stretched(triangle_stretches(mesh.faces, mesh.vertices, posed), neighbours, kStretchLimit);
    report.poses.push_back({pose.name, stretched.all, stretched.alone, stretched.largest,
                            static_cast<int>(sticking.find(blend, posed).size()), worst_volume(elbows, posed),
                            worst_volume(knees, posed)});
  }
  return report;
}

std::vector<std::string> BendReport::faults() const {
  std::vector<std::string> sentences;
  for (const PoseBend& bend : poses) {
    if (bend.stretched_alone > 0)
      sentences.push_back(
          fmt::format("in the pose '{}' {} of {} triangles stretch more than {:g} times without their neighbours",
                      bend.pose, bend.stretched_alone, triangles, kStretchLimit));
    if (bend.sticking > 0)
      sentences.push_back(
          fmt::format("in the pose '{}' {} of {} vertices stick to another limb", bend.pose, bend.sticking, vertices));
    for (const std::string& fault :
         {volume_fault(bend, "an elbow", bend.elbow_volume), volume_fault(bend, "a knee", bend.knee_volume)})
      if (!fault.empty()) sentences.push_back(fault);
  }
  return sentences;
}

std::string BendReport::summary() const {
  PoseBend worst;
  const auto farther = [](std::optional<double>& kept, const std::optional<double>& other) {
    if (other && (!kept || std::abs(*other - 1.0) > std::abs(*kept - 1.0))) kept = other;
  };
  for (const PoseBend& bend : poses) {
    worst.stretched = std::max(worst.stretched, bend.stretched);
    worst.stretched_alone = std::max(worst.stretched_alone, bend.stretched_alone);
    worst.sticking = std::max(worst.sticking, bend.sticking);
    farther(worst.elbow_volume, bend.elbow_volume);
    farther(worst.knee_volume, bend.knee_volume);
  }
  const auto percent = [](const std::optional<double>& share) {
    return share ? fmt::format("{:.0f} %", 100.0 * *share) : std::string("unknown");
  };
  return fmt::format(
      "at worst {} of {} triangles stretch more than {:g} times, {} alone; {} of {} vertices stick; volume kept at the "
      "elbow {}, at the knee {}",
      worst.stretched, triangles, kStretchLimit, worst.stretched_alone, worst.sticking, vertices,
      percent(worst.elbow_volume), percent(worst.knee_volume));
}

}  // namespace doppel
