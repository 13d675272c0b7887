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

/// The joints of a file, which lie in the coordinates of the scan. The file's own matrix may be that of another unit
/// or of another way up, so it does not count.
BodyJoints given_joints(const std::filesystem::path& path, const Eigen::Affine3d& file_from_character) {
  JointsFile file = read_joints(path, file_from_character);
  const Eigen::Affine3d change = file_from_character.inverse() * file.file_from_character;
  for (auto& [name, position] : file.joints.positions) position = change * position;
  return std::move(file.joints);
}

/// What is implausible about given joints: the faults of examine_joints, joints of the limbs outside of the body, and a
/// person who faces backwards. @param faces_z whether the scan is known to face +z
std::vector<std::string> examine_given(const BodyJoints& joints, const SolidGrid& solid, bool faces_z) {
  std::vector<std::string> doubts = examine_joints(joints), outside;
  for (const std::string& name : limb_joint_names())
    if (joints.has(name) && !solid.is_inside(joints.at(name))) outside.push_back(name);
  if (!outside.empty())
    doubts.push_back(fmt::format("{} of the {} joints of the limbs lie outside of the body: {}", outside.size(),
                                 limb_joint_names().size(), fmt::join(outside, ", ")));
  if (faces_z && pelvis_frame(joints).forward.z() < 0.0)
    doubts.emplace_back("the joints face backwards, against the toes of the scan: left and right are swapped");
  return doubts;
}

/// The joints found in images, metres.
BodyJoints found_joints(const TriangleMesh& mesh, const CreateCharacterOptions& options, CreatedCharacter& result) {
  FoundJoints found = find_joints(mesh, options.points);
  result.notes.push_back(fmt::format("a person was found in {} of {} images of the scan",
                                     found.points.views_with_person(), found.points.views.size()));
  append(result.doubts, found.doubts);
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

struct PreparedScan {
  TriangleMesh mesh;
  bool faces_z;  ///< whether the person is known to look along +z
};

/// The scan as one mended mesh in the character frame. What leads there is freed again, because a scan may be large.
PreparedScan prepare_scan(const ScanParts& scan, const CreateCharacterOptions& options, CreatedCharacter& result) {
  MergedScan merged = merge_parts(scan);
  append(result.notes, merged.notes);
  const ScanOrientation orientation = find_orientation(merged.mesh, options.orientation);
  append(result.notes, orientation.reasons);
  if (!options.joints) refuse_several_bodies(orientation);
  result.joints.file_from_character = Eigen::Affine3d(orientation.character_from_file).inverse();
  merged.mesh = transformed(merged.mesh, orientation.character_from_file);
  RepairedMesh repaired = repair(merged.mesh);
  append(result.notes, repaired.report.sentences());
  return {std::move(repaired.mesh), orientation.facing.has_value()};
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
  auto [mesh, faces_z] = prepare_scan(scan, options, result);
  BodyJoints given;
  if (options.joints) given = given_joints(*options.joints, result.joints.file_from_character);
  BodyJoints joints = options.joints ? given : found_joints(mesh, options, result);
  complete_joints(joints);
  VoxelSolidOptions voxels;
  voxels.cell = options.cell;
  const SolidGrid solid = solid_grid(VoxelSolid(mesh, voxels));
  if (options.joints)
    append(result.doubts, examine_given(given, solid, faces_z));
  else
    move_inside(joints, solid);
  append(result.notes, find_fingers(mesh, joints));
  for (const auto& [point, position] : given.positions) joints.positions[point] = position;
  append(result.notes, touching_arms(joints, solid));
  result.joints.joints = joints;
  result.joint_sheet = draw_joint_sheet(mesh, joints);

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
