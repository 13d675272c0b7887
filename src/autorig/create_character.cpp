#include "doppel/autorig/create_character.h"

#include <fmt/format.h>

#include "doppel/autorig/find_joints.h"
#include "doppel/autorig/pose_sheet.h"
#include "doppel/core/log.h"
#include "doppel/rigging/make_character.h"
#include "doppel/rigging/place_inside.h"
#include "doppel/scan/atlas.h"
#include "doppel/scan/repair.h"
#include "doppel/scan/simplify.h"
#include "doppel/scan/voxel_solid.h"

namespace doppel {

namespace {

void append(std::vector<std::string>& notes, const std::vector<std::string>& more) {
  notes.insert(notes.end(), more.begin(), more.end());
}

/// The joints of the file or those found in pictures, metres.
BodyJoints joints_of(const TriangleMesh& mesh, const Eigen::Affine3d& file_from_character,
                     const CreateCharacterOptions& options, CreatedCharacter& result) {
  if (options.joints) {
    BodyJoints joints = read_joints(*options.joints, file_from_character).joints;
    complete_joints(joints);
    append(result.notes, examine_joints(joints));
    return joints;
  }
  FoundJoints found = find_joints(mesh, options.points);
  result.notes.push_back(fmt::format("a person was found in {} of {} pictures of the scan",
                                     found.points.views_with_person(), found.points.views.size()));
  append(result.notes, found.doubts);
  result.joint_sheet = draw_joint_sheet(found.points.views, found.joints);
  return found.joints;
}

}  // namespace

CreatedCharacter create_character(const std::string& name, const ScanParts& scan,
                                  const CreateCharacterOptions& options) {
  CreatedCharacter result;
  const MergedScan merged = merge_parts(scan);
  append(result.notes, merged.notes);
  const ScanOrientation orientation = find_orientation(merged.mesh, options.orientation);
  append(result.notes, orientation.reasons);
  const RepairedMesh repaired = repair(transformed(merged.mesh, orientation.character_from_file));
  append(result.notes, repaired.report.sentences());

  result.joints.file_from_character = Eigen::Affine3d(orientation.character_from_file).inverse();
  BodyJoints joints = joints_of(repaired.mesh, result.joints.file_from_character, options, result);
  VoxelSolidOptions voxels;
  voxels.cell = options.cell;
  const SolidGrid solid = solid_grid(VoxelSolid(repaired.mesh, voxels));
  if (!options.joints) place_inside(joints, solid);
  result.joints.joints = joints;

  TriangleMesh mesh = repaired.mesh;
  if (options.vertices < mesh.num_vertices()) {
    SimplifyOptions simplification;
    simplification.target_vertices = options.vertices;
    SimplifyReport report;
    mesh = simplify(mesh, simplification, &report);
    result.notes.push_back(report.sentence);
  }
  RigOptions rig;
  rig.character.num_nodes = options.nodes;
  result.character = make_character(name, mesh, joints, solid, rig);
  result.bending = examine_bending(result.character);
  result.pose_sheet = draw_pose_sheet(result.character);
  return result;
}

}  // namespace doppel
