#include "doppel/synth/actor.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "doppel/geometry/isosurface.h"
#include "doppel/geometry/smooth_values.h"
#include "doppel/geometry/topology.h"
#include "doppel/geometry/unwrap.h"
#include "doppel/synth/body_field.h"
#include "doppel/synth/paint.h"

namespace doppel::synth {

namespace {

using Eigen::Vector3d;

constexpr int kMaximumInfluences = 5;

/// Adds joints with known rest positions, and DoFs of the same names that drive the joints one to one.
class SkeletonBuilder {
 public:
  /// @param position position of the joint in the zero pose, world metres
  int joint(const std::string& name, int parent, const Vector3d& position, const Vector3d& axis,
            Joint::Type type = Joint::Type::revolute) {
    const Vector3d offset = parent < 0 ? position : Vector3d(position - positions_[parent]);
    skeleton.joints.push_back({name, type, parent, offset, axis});
    positions_.push_back(position);
    return skeleton.num_joints() - 1;
  }

  int driven(const std::string& name, int parent, const Vector3d& position, const Vector3d& axis, double low,
             double high) {
    const int j = joint(name, parent, position, axis);
    skeleton.dofs.push_back({name, {{j, 1.0}}, std::array<double, 2>{low, high}});
    return j;
  }

  int free(const std::string& name, int parent, const Vector3d& axis, bool translation) {
    // A joint translation is in millimetres; the weight makes the unit of the DoF metres, as in Captury's skeletons.
    const int j = joint(name, parent, Vector3d::Zero(), translation ? Vector3d(0.001 * axis) : axis,
                        translation ? Joint::Type::prismatic : Joint::Type::revolute);
    skeleton.dofs.push_back({name, {{j, translation ? 1000.0 : 1.0}}, std::nullopt});
    return j;
  }

  void marker(const std::string& name, const std::string& joint_name, const Vector3d& position) {
    const int j = *skeleton.find_joint(joint_name);
    skeleton.markers.push_back({name, j, position - positions_[j], 20.0});
  }

  Skeleton skeleton;

 private:
  std::vector<Vector3d> positions_;
};

/// Positions are relative to the root. The rest pose moves the root to its height.
Vector3d placed(const Vector3d& rest) { return rest - BodyPlan::root(); }

int add_root(SkeletonBuilder& b) {
  int j = b.free("Root_tx", -1, Vector3d::UnitX(), true);
  j = b.free("Root_ty", j, Vector3d::UnitY(), true);
  j = b.free("Root_tz", j, Vector3d::UnitZ(), true);
  j = b.free("Root_ry", j, Vector3d::UnitY(), false);
  j = b.free("Root_rz", j, Vector3d::UnitZ(), false);
  return b.free("Root_rx", j, Vector3d::UnitX(), false);
}

void add_head(SkeletonBuilder& b, int root) {
  const Vector3d neck = placed(BodyPlan::neck());
  int j = b.driven("Head_ry", root, neck, Vector3d::UnitY(), -1.2, 1.2);
  j = b.driven("Head_rz", j, neck, Vector3d::UnitZ(), -0.5, 0.5);
  j = b.driven("Head_rx", j, neck, Vector3d::UnitX(), -0.6, 0.7);
  b.joint("HeadEE", j, placed(BodyPlan::head_top()), Vector3d::UnitX());
}

/// Rotations about y and z have the opposite sign on the right, so that a positive angle means the same on both sides.
void add_limbs(SkeletonBuilder& b, int root, bool left) {
  const std::string side = left ? "Left" : "Right";
  const double sign = left ? 1 : -1;
  const auto at = [&](const Vector3d& p) { return placed(left ? p : mirrored(p)); };
  const Vector3d arm = left ? BodyPlan::arm_direction() : mirrored(BodyPlan::arm_direction());
  const Vector3d forward = arm.cross(Vector3d::UnitZ()).normalized();  // turns the arm towards +z

  int j = b.driven(side + "Shoulder_ry", root, at(BodyPlan::clavicle()), -sign * Vector3d::UnitY(), -0.3, 0.3);
  j = b.driven(side + "Shoulder_rz", j, at(BodyPlan::clavicle()), sign * Vector3d::UnitZ(), -0.2, 0.5);
  j = b.driven(side + "Arm_rz", j, at(BodyPlan::shoulder()), sign * Vector3d::UnitZ(), -0.7, 1.9);
  j = b.driven(side + "Arm_rx", j, at(BodyPlan::shoulder()), forward, -0.8, 1.6);
  j = b.driven(side + "ForeArm_rx", j, at(BodyPlan::elbow()), forward, -0.05, 2.3);
  j = b.driven(side + "ForeArm_roll", j, at(BodyPlan::elbow()), sign * arm, -1.3, 1.3);
  b.joint(side + "ForeArmEE", j, at(BodyPlan::wrist()), Vector3d::UnitX());

  j = b.driven(side + "UpLeg_rx", root, at(BodyPlan::hip()), -Vector3d::UnitX(), -0.6, 1.7);
  j = b.driven(side + "UpLeg_rz", j, at(BodyPlan::hip()), sign * Vector3d::UnitZ(), -0.4, 0.9);
  j = b.driven(side + "UpLeg_ry", j, at(BodyPlan::hip()), sign * Vector3d::UnitY(), -0.6, 0.6);
  j = b.driven(side + "Leg_rx", j, at(BodyPlan::knee()), Vector3d::UnitX(), -0.05, 2.4);
  j = b.driven(side + "Foot_rx", j, at(BodyPlan::ankle()), -Vector3d::UnitX(), -0.9, 0.75);
  j = b.driven(side + "Foot_rz", j, at(BodyPlan::ankle()), sign * Vector3d::UnitZ(), -0.4, 0.4);
  b.joint(side + "FootEE", j, at(BodyPlan::toe()), Vector3d::UnitX());
}

/// 17 landmarks of the body, then four of the face.
void add_markers(SkeletonBuilder& b) {
  const auto pair = [&](const std::string& name, const std::string& joint, const Vector3d& position) {
    b.marker("right_" + name, "Right" + joint, placed(mirrored(position)));
    b.marker("left_" + name, "Left" + joint, placed(position));
  };
  b.marker("nose", "Head_rx", placed({0, 1.613, 0.131}));
  b.marker("neck", "Root_rx", placed({0, 1.42, -0.01}));
  b.marker("mid_hip", "Root_rx", placed({0, 0.91, 0}));
  pair("shoulder", "Arm_rx", BodyPlan::shoulder());
  pair("elbow", "ForeArm_roll", BodyPlan::elbow());
  pair("wrist", "ForeArm_roll", BodyPlan::wrist());
  pair("hip", "UpLeg_ry", BodyPlan::hip());
  pair("knee", "Leg_rx", BodyPlan::knee());
  pair("ankle", "Foot_rz", BodyPlan::ankle());
  pair("big_toe", "Foot_rz", {0.113, 0.03, 0.195});
  for (const bool left : {false, true}) {
    const Vector3d eye(0.031, 1.642, 0.094), ear(0.085, 1.625, 0.0);
    const std::string side = left ? "left_" : "right_";
    b.marker(side + "eye", "Head_rx", placed(left ? eye : mirrored(eye)));
    b.marker(side + "ear", "Head_rx", placed(left ? ear : mirrored(ear)));
  }
}

enum Bone : int {
  kRoot,
  kHeadBone,
  kClavicle,
  kArm,
  kForearm,
  kUpLeg,
  kLeg,
  kFoot,
  kSideBones = kFoot - kClavicle + 1
};
constexpr int kNumBones = kClavicle + 2 * kSideBones;
using BoneWeights = std::array<double, kNumBones>;

int of_side(int bone, bool left) { return left ? bone : bone + kSideBones; }

/// The weight of the collar bone on the surface of the trunk.
double clavicle_share(const Vector3d& q) { return smooth_step(0.04, 0.17, q.x()) * smooth_step(1.24, 1.38, q.y()); }

/// The weights of a vertex that belongs to `part` only.
BoneWeights part_weights(int part, const Vector3d& p) {
  BoneWeights w{};
  const bool left = part >= kRightArm ? false : part >= kLeftArm ? true : p.x() > 0;
  const Vector3d q = left ? p : mirrored(p);
  const int limb = part >= kRightArm ? part - kLimbParts : part;
  if (part == kTorso) {
    w[of_side(kClavicle, left)] = clavicle_share(q);
    w[kRoot] = 1 - clavicle_share(q);
  } else if (part == kSkirt) {
    // Both thighs move the hem; their weights are blended across the middle.
    const double thighs = 0.62 * smooth_step(BodyPlan::kWaist - 0.03, BodyPlan::kHem + 0.1, p.y());
    const double to_left = smooth_step(-0.2, 0.2, p.x());
    w[kRoot] = 1 - thighs;
    w[kUpLeg] = thighs * to_left;
    w[kUpLeg + kSideBones] = thighs * (1 - to_left);
  } else if (part == kHead) {
    w[kHeadBone] = smooth_step(1.44, 1.54, p.y());
    w[kRoot] = 1 - w[kHeadBone];
  } else if (part == kHair) {
    w[kHeadBone] = 1;
  } else if (limb == kLeftArm) {
    const double t = smooth_step(-0.04, 0.06, (q - BodyPlan::shoulder()).dot(BodyPlan::arm_direction()));
    w[of_side(kArm, left)] = t;
    w[of_side(kClavicle, left)] = 1 - t;
  } else {
    const int bone = limb == kLeftThigh ? kUpLeg : limb == kLeftShin ? kLeg : limb == kLeftFoot ? kFoot : kForearm;
    w[of_side(bone, left)] = 1;
  }
  return w;
}

/// Blends the weights of the parts near a point: all parts that are about as near as the nearest one.
BoneWeights point_weights(const BodyField& field, const Vector3d& p) {
  const auto distance = field.part_distances(p);
  const double nearest = *std::min_element(distance.begin(), distance.end());
  BoneWeights sum{};
  for (int part = 0; part < kNumParts; ++part) {
    constexpr double kReach = 0.03;
    const double away = (distance[part] - nearest) / kReach;
    double share = std::exp(-away * away);
    // A leg has no weight on the skin of the other leg.
    if (part >= kLeftThigh && part <= kLeftFoot) share *= smooth_step(-0.03, 0.03, p.x());
    if (part >= kRightThigh) share *= smooth_step(-0.03, 0.03, -p.x());
    if (share < 1e-4) continue;
    const BoneWeights w = part_weights(part, p);
    for (int b = 0; b < kNumBones; ++b) sum[b] += share * w[b];
  }
  double total = 0;
  for (const double w : sum) total += w;
  for (double& w : sum) w /= total;
  return sum;
}

using WeightVector = Eigen::Matrix<double, kNumBones, 1>;

void append_row(SkinningWeights& skin, const WeightVector& w) {
  std::vector<int> order(kNumBones);
  for (int b = 0; b < kNumBones; ++b) order[b] = b;
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return w[a] > w[b]; });
  int count = 1;
  while (count < kMaximumInfluences && w[order[count]] > 0.004) ++count;
  double total = 0;
  for (int k = 0; k < count; ++k) total += w[order[k]];
  for (int k = 0; k < count; ++k) {
    skin.vertex_bones.items.push_back(order[k]);
    skin.weights.push_back(w[order[k]] / total);
  }
  skin.vertex_bones.offsets.push_back(static_cast<int>(skin.vertex_bones.items.size()));
}

/// Edges are shorter where the shape has fine detail: face, head, hands, feet.
double relative_edge(const Vector3d& p) {
  if (p.y() > 1.5) return p.z() > 0.02 ? 0.5 : 0.75;
  if (std::abs(p.x()) > 0.5) return 0.65;
  return p.y() < 0.1 ? 0.8 : 1.0;
}

/// 0 at the waist .. 1 at the hem, and 0 on everything that is not the skirt's cloth.
double skirt_drop(const BodyField& field, const Vector3d& p) {
  if (material_at(field, p) != Material::skirt) return 0;
  const auto d = field.part_distances(p);
  const double leg = std::min(std::min(d[kLeftThigh], d[kRightThigh]), std::min(d[kLeftShin], d[kRightShin]));
  // The lining that touches the legs follows the legs.
  return smooth_step(BodyPlan::kWaist - 0.04, BodyPlan::kHem, p.y()) * smooth_step(0.0, 0.05, leg);
}

void dress(Actor& actor, const BodyField& field) {
  const TriangleMesh& mesh = actor.character.mesh;
  const MeshTopology topology(mesh);
  for (const Vector3d& p : mesh.vertices) {
    const double drop = skirt_drop(field, p);
    const double angle = std::atan2(p.x(), p.z());
    const Material material = material_at(field, p);
    const Vector3d outward = field.gradient(p).normalized();
    double loose = drop;
    // The skirt as worn: wider and lower than the template, with uneven folds.
    Vector3d hang = drop * (Vector3d(p.x(), 0, p.z()).normalized() * (0.024 + 0.009 * std::sin(4 * angle + 1.1)) -
                            (0.016 + 0.007 * std::cos(3 * angle)) * Vector3d::UnitY());
    if (material == Material::shirt && p.y() < 1.36) {
      loose = 0.16;
      hang = 0.008 * outward - 0.006 * Vector3d::UnitY();
    }
    actor.looseness.push_back(loose);
    actor.hang.push_back(hang);
  }
  const double edge = std::sqrt(2.9 / mesh.num_vertices());  // about one edge; equal reach on any mesh
  const int rounds = std::max(2, static_cast<int>(std::lround(0.0045 / (edge * edge))));
  smooth_values(actor.looseness, topology, rounds);
  smooth_values(actor.hang, topology, rounds);
}

}  // namespace

Skeleton make_skeleton() {
  SkeletonBuilder builder;
  const int root = add_root(builder);
  // Hips, knees, ankles, neck, collar bones, shoulders, elbows: 6 + 2 + 4 + 3 + 4 + 4 + 4 = 27 after the root's six.
  add_head(builder, root);
  add_limbs(builder, root, true);
  add_limbs(builder, root, false);
  add_markers(builder);
  return builder.skeleton;
}

SkinningWeights make_weights(const TriangleMesh& mesh) {
  const BodyField field;
  SkinningWeights skin;
  skin.bones = {"Root",     "Head",          "LeftShoulder", "LeftArm",      "LeftForeArm", "LeftUpLeg", "LeftLeg",
                "LeftFoot", "RightShoulder", "RightArm",     "RightForeArm", "RightUpLeg",  "RightLeg",  "RightFoot"};
  std::vector<WeightVector> dense;
  for (const Vector3d& p : mesh.vertices) dense.emplace_back(point_weights(field, p).data());
  smooth_values(dense, MeshTopology(mesh), 2);
  for (const WeightVector& w : dense) append_row(skin, w);
  return skin;
}

Actor make_actor(const ActorOptions& options) {
  const BodyField field;
  Actor actor;
  Character& c = actor.character;
  c.name = "actor";
  const TriangleMesh fine =
      mesh_field(BodyField::field(), {-0.78, -0.06, -0.46}, {0.78, 1.83, 0.46}, options.grid_cell);
  c.mesh = coarsen(fine, BodyField::field(), options.vertices, relative_edge);
  unwrap(c.mesh, 3.0 / options.texture_size);
  c.mesh.texture = paint_texture(c.mesh, field, options.texture_size);
  c.labels = parser_labels(c.mesh, field);
  c.skeleton = make_skeleton();
  c.skin = make_weights(c.mesh);
  for (const std::string& bone : c.skin.bones) c.bone_joint.push_back(c.skeleton.joint_of_bone(bone, BoneRule::exact));
  c.rest_dofs.assign(c.skeleton.num_dofs(), 0.0);
  c.rest_dofs[*c.skeleton.find_dof("Root_ty")] = BodyPlan::root().y();
  c.options.num_nodes = options.nodes;
  c.graph = build_graph(c.mesh, options.nodes, c.options.graph);
  c.rigidity = vertex_rigidity(c.labels, c.num_vertices(), c.options.rigidity);
  const std::vector<Vector3d> normals = vertex_normals(c.mesh);
  for (int v = 0; v < c.num_vertices(); ++v) actor.openness.push_back(field.openness(c.mesh.vertices[v], normals[v]));
  dress(actor, field);
  actor.own_rest = c.mesh.vertices;
  return actor;
}

}  // namespace doppel::synth
