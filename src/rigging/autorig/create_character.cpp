#include "doppel/rigging/autorig/create_character.h"

#include <fmt/format.h>

#include <algorithm>

#include "doppel/core/error.h"
#include "doppel/rigging/autorig/find_joints.h"
#include "doppel/rigging/autorig/pose_sheet.h"
#include "doppel/rigging/joints/find_fingers.h"
#include "doppel/rigging/joints/move_inside.h"
#include "doppel/rigging/make_character.h"
#include "doppel/rigging/scan/atlas.h"
#include "doppel/rigging/scan/repair.h"
#include "doppel/rigging/scan/simplify.h"
#include "doppel/rigging/scan/voxel_solid.h"

namespace doppel {

namespace {

constexpr double kOneBody = 0.65;  // least share of the largest body; two persons have 0.5 each
constexpr int kArmSteps = 20;      // points of a forearm that are looked at
constexpr double kArmpit = 0.8;    // share of the way from pelvis to neck

void append(std::vector<std::string>& notes, const std::vector<std::string>& more) {
  notes.insert(notes.end(), more.begin(), more.end());
}

/// The joints of the file or those found in images, metres.
BodyJoints joints_of(const TriangleMesh& mesh, const Eigen::Affine3d& file_from_character,
                     const CreateCharacterOptions& options, CreatedCharacter& result) {
  if (options.joints) {
    BodyJoints joints = read_joints(*options.joints, file_from_character).joints;
    complete_joints(joints);
    append(result.notes, examine_joints(joints));
    return joints;
  }
  FoundJoints found = find_joints(mesh, options.points);
  result.notes.push_back(fmt::format("a person was found in {} of {} images of the scan",
                                     found.points.views_with_person(), found.points.views.size()));
  append(result.notes, found.doubts);
  result.joint_sheet = draw_joint_sheet(found.points.views, found.joints);
  return found.joints;
}

/// Images of two persons far apart show each of them small, and the detector may find one of them only. Their shape
/// tells: between them is nothing.
void refuse_several_bodies(const ScanOrientation& orientation) {
  if (orientation.shape.largest_share < kOneBody)
    fail(
        "the scan holds several bodies that do not touch; the largest has {:.0f} % of their surface. Cut the scan so "
        "that one person is left",
        100 * orientation.shape.largest_share);
}

/// The scan as one mended mesh in the character frame. What leads there is freed again, because a scan may be large.
TriangleMesh prepared_mesh(const ScanParts& scan, const CreateCharacterOptions& options, CreatedCharacter& result) {
  MergedScan merged = merge_parts(scan);
  append(result.notes, merged.notes);
  const ScanOrientation orientation = find_orientation(merged.mesh, options.orientation);
  append(result.notes, orientation.reasons);
  if (!options.joints) refuse_several_bodies(orientation);
  result.joints.file_from_character = Eigen::Affine3d(orientation.character_from_file).inverse();
  merged.mesh = transformed(merged.mesh, orientation.character_from_file);
  RepairedMesh repaired = repair(merged.mesh);
  append(result.notes, repaired.report.sentences());
  return std::move(repaired.mesh);
}

}  // namespace

std::vector<std::string> touching_arms(const BodyJoints& joints, const SolidGrid& solid) {
  std::vector<std::string> notes;
  const Eigen::Vector3d pelvis = joints.at("pelvis"), neck = joints.at("neck");
  for (const std::string side : {"left", "right"}) {
    int below_chest = 0, touching = 0;
    for (int i = 0; i <= kArmSteps; ++i) {
      const double part = static_cast<double>(i) / kArmSteps;
      const Eigen::Vector3d arm = (1 - part) * joints.at(side + "_elbow") + part * joints.at(side + "_wrist");
      const double height = (arm.y() - pelvis.y()) / (neck.y() - pelvis.y());
      if (!(height > 0.0 && height < kArmpit)) continue;
      ++below_chest;
      const Eigen::Vector3d trunk = pelvis + height * (neck - pelvis);
      bool gap = false;
      for (double way = 0.0; way <= 1.0 && !gap; way += 0.5 * solid.cell / std::max((trunk - arm).norm(), solid.cell))
        gap = !solid.is_inside((1 - way) * arm + way * trunk);
      touching += !gap;
    }
    if (below_chest > 0 && touching >= 0.5 * below_chest)
      notes.push_back(fmt::format(
          "the {} arm touches the trunk, so both are one surface there and bend as one; scan the person again with the "
          "arms away from the trunk",
          side));
  }
  return notes;
}

CreatedCharacter create_character(const std::string& name, const ScanParts& scan,
                                  const CreateCharacterOptions& options) {
  CreatedCharacter result;
  TriangleMesh mesh = prepared_mesh(scan, options, result);
  BodyJoints joints = joints_of(mesh, result.joints.file_from_character, options, result);
  VoxelSolidOptions voxels;
  voxels.cell = options.cell;
  const SolidGrid solid = solid_grid(VoxelSolid(mesh, voxels));
  if (!options.joints) move_inside(joints, solid);
  append(result.notes, find_fingers(mesh, joints));
  append(result.notes, touching_arms(joints, solid));
  result.joints.joints = joints;

  if (options.vertices < mesh.num_vertices()) {
    SimplifyOptions simplification;
    simplification.target_vertices = options.vertices;
    SimplifyReport report;
    mesh = simplify(mesh, simplification, &report);
    result.notes.push_back(report.sentence);
  }
  CharacterOptions rig;
  rig.num_nodes = options.nodes;
  result.character = make_character(name, mesh, joints, solid, rig);
  result.bending = examine_bending(result.character);
  result.pose_sheet = draw_pose_sheet(result.character);
  return result;
}

}  // namespace doppel
