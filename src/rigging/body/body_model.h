#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/rigging/body/measures.h"
#include "doppel/rigging/joints/body_joints.h"

namespace doppel {

/// Doppel's parametric body: one mesh topology, skinning weights, UVs, labels and embedded graph for all bodies.
/// Measures (body_measures) move vertices and joints. The map from measures to positions is smooth, so that it can be
/// fitted with central differences. All functions are const and may be called by several threads.
class BodyModel {
 public:
  /// Meshes and rigs the reference body. Takes some seconds: build one model and keep it.
  /// @throws Error when the counts cannot be reached
  explicit BodyModel(int num_vertices = 5000, int num_nodes = 500);
  ~BodyModel();
  BodyModel(const BodyModel&) = delete;
  BodyModel& operator=(const BodyModel&) = delete;
  BodyModel(BodyModel&&) noexcept;
  BodyModel& operator=(BodyModel&&) noexcept;

  int num_vertices() const;

  /// The vertices of a body in the rest pose [N]: an A-pose, metres, y up, facing +z, left x > 0, soles at y = 0.
  /// @param measures [P]. Values outside of low .. high are taken as they are.
  /// @throws Error unless there are P finite values above 0 (hair and looseness: at least 0)
  std::vector<Eigen::Vector3d> vertices(std::span<const double> measures) const;

  /// The 21 joints of the body and the points head_top (of the skull, without hair), nose, eyes, ears, hands,
  /// fingertips, toe ends and heels, in the rest pose, metres.
  /// @throws Error as vertices
  BodyJoints joints(std::span<const double> measures) const;

  /// The character of these measures. All characters of one model have the same topology, skinning weights, UVs, graph
  /// topology, labels and DoFs. Skeleton, markers and rest pose are those of this body. At most 50 ms.
  /// @throws Error as vertices
  Character character(const std::string& name, std::span<const double> measures) const;

 private:
  struct Data;
  std::unique_ptr<const Data> data_;
};

}  // namespace doppel
