#ifndef _USE_MATH_DEFINES
#define _USE_MATH_DEFINES
#endif
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModBaseT.hh>
#include <OpenMesh/Tools/Decimater/ModNormalFlippingT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/geometry/topology.h"

namespace doppel {
namespace {

constexpr double kShortfall = 1.05;      // largest ratio to the target that counts as reached
constexpr float kMaxNormalTurn = 75.0f;  // degrees a face may rotate in one collapse without a fold
constexpr double kBorderTurn = 0.9;      // cosine of the largest corner of a border that a collapse may cut

struct DoubleTraits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
};
using OmMesh = OpenMesh::TriMesh_ArrayKernelT<DoubleTraits>;

/// Keeps the border of an open mesh, because the quadrics of a flat border do not penalise its shrinking. A border
/// vertex may only move along the border, and only where the border is nearly straight.
class KeepBorder : public OpenMesh::Decimater::ModBaseT<OmMesh> {
 public:
  using Base = OpenMesh::Decimater::ModBaseT<OmMesh>;
  using Handle = OpenMesh::Decimater::ModHandleT<KeepBorder>;
  DECIMATER_MODNAME(KeepBorder);

  explicit KeepBorder(OmMesh& surface) : Base(surface, /*_is_binary=*/true) {}

  float collapse_priority(const Base::CollapseInfo& collapse) override {
    const OmMesh& mesh = Base::mesh();
    if (!mesh.is_boundary(collapse.v0)) return Base::LEGAL_COLLAPSE;
    if (!mesh.is_boundary(mesh.edge_handle(collapse.v0v1))) return Base::ILLEGAL_COLLAPSE;
    // Removing v0 cuts the corner that the border makes there.
    const OmMesh::HalfedgeHandle outer =
        mesh.is_boundary(collapse.v0v1) ? collapse.v0v1 : mesh.opposite_halfedge_handle(collapse.v0v1);
    const OmMesh::VertexHandle other = outer == collapse.v0v1
                                           ? mesh.from_vertex_handle(mesh.prev_halfedge_handle(outer))
                                           : mesh.to_vertex_handle(mesh.next_halfedge_handle(outer));
    const OpenMesh::Vec3d towards = collapse.p0 - mesh.point(other), onwards = collapse.p1 - collapse.p0;
    const double aligned = (towards | onwards) / (towards.norm() * onwards.norm());
    return aligned > kBorderTurn ? Base::LEGAL_COLLAPSE : Base::ILLEGAL_COLLAPSE;
  }
};

/// Keeps a closed component from becoming flat: a tetrahedron cannot lose another edge.
class KeepSolid : public OpenMesh::Decimater::ModBaseT<OmMesh> {
 public:
  using Base = OpenMesh::Decimater::ModBaseT<OmMesh>;
  using Handle = OpenMesh::Decimater::ModHandleT<KeepSolid>;
  DECIMATER_MODNAME(KeepSolid);

  explicit KeepSolid(OmMesh& surface) : Base(surface, /*_is_binary=*/true) {}

  float collapse_priority(const Base::CollapseInfo& collapse) override {
    const OmMesh& mesh = Base::mesh();
    // A vertex of valence 3 opposite the edge would keep only two coincident faces.
    for (const OmMesh::VertexHandle opposite : {collapse.vl, collapse.vr}) {
      if (opposite.is_valid() && mesh.valence(opposite) <= 3 && !mesh.is_boundary(opposite))
        return Base::ILLEGAL_COLLAPSE;
    }
    return Base::LEGAL_COLLAPSE;
  }
};

OmMesh to_openmesh(const TriangleMesh& mesh) {
  OmMesh out;
  // Vertices without a face are left out, because no collapse removes them.
  std::vector<OmMesh::VertexHandle> handles(mesh.vertices.size());
  for (const Triangle& face : mesh.faces) {
    for (int v : face) {
      if (handles[v].is_valid()) continue;
      handles[v] = out.add_vertex(OpenMesh::Vec3d(mesh.vertices[v].x(), mesh.vertices[v].y(), mesh.vertices[v].z()));
    }
  }
  for (const Triangle& face : mesh.faces) {
    if (!out.add_face(handles[face[0]], handles[face[1]], handles[face[2]]).is_valid()) {
      fail(
          "decimating a mesh: the face {} {} {} touches a neighbour only in a vertex or has the opposite orientation; "
          "repair the mesh first",
          face[0], face[1], face[2]);
    }
  }
  return out;
}

TriangleMesh from_openmesh(const OmMesh& mesh) {
  TriangleMesh out;
  for (const auto& v : mesh.vertices()) {
    const OpenMesh::Vec3d& p = mesh.point(v);
    out.vertices.emplace_back(p[0], p[1], p[2]);
  }
  for (const auto& f : mesh.faces()) {
    Triangle face{};
    int corner = 0;
    for (auto v = mesh.cfv_ccwiter(f); v.is_valid(); ++v) face[corner++] = v->idx();
    out.faces.push_back(face);
  }
  return out;
}

void check_input(const TriangleMesh& mesh, int target_vertices) {
  if (target_vertices < 4)
    fail("decimating a mesh: the target is {} vertices, a surface needs at least 4", target_vertices);
  const MeshReport report = inspect_mesh(mesh);
  if (report.non_manifold_edges > 0) {
    fail(
        "decimating a mesh: found {} edges that do not belong to one or two faces of the same orientation; repair the "
        "mesh first",
        report.non_manifold_edges);
  }
  for (const Triangle& face : mesh.faces) {
    if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0]) {
      fail("decimating a mesh: the face {} {} {} has a vertex twice; repair the mesh first", face[0], face[1], face[2]);
    }
  }
}

}  // namespace

TriangleMesh decimate(const TriangleMesh& mesh, int target_vertices) {
  check_input(mesh, target_vertices);
  OmMesh surface = to_openmesh(mesh);
  // The decimater needs these properties.
  surface.request_vertex_status();
  surface.request_edge_status();
  surface.request_halfedge_status();
  surface.request_face_status();
  surface.request_face_normals();
  surface.update_face_normals();

  OpenMesh::Decimater::DecimaterT<OmMesh> decimater(surface);
  OpenMesh::Decimater::ModQuadricT<OmMesh>::Handle quadric;
  OpenMesh::Decimater::ModNormalFlippingT<OmMesh>::Handle flipping;
  decimater.add(quadric);
  decimater.add(flipping);
  KeepBorder::Handle border;
  KeepSolid::Handle solid;
  decimater.add(border);
  decimater.add(solid);
  decimater.module(quadric).unset_max_err();
  decimater.module(flipping).set_max_normal_deviation(kMaxNormalTurn);
  if (!decimater.initialize()) fail("decimating a mesh: OpenMesh rejects the modules");
  const int in_use = static_cast<int>(surface.n_vertices());
  if (target_vertices < in_use) {
    decimater.decimate_to(as_size(target_vertices));
    surface.garbage_collection();
  }

  TriangleMesh out = from_openmesh(surface);
  if (out.num_vertices() > kShortfall * target_vertices && target_vertices < in_use) {
    fail("decimating a mesh of {} vertices to {}: no collapse keeps the surface below {}; ask for more vertices",
         mesh.num_vertices(), target_vertices, out.num_vertices());
  }
  return out;
}

}  // namespace doppel
