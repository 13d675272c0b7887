/// The C API of include/doppel/actor.h on ActorFile.

#include "doppel/actor.h"

#include <ATen/Parallel.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "doppel/actor/export/actor_file.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/losses/silhouette.h"
#include "doppel/render/splats/splat_rows.h"
#include "doppel/render/splats/splats.h"

struct doppel_actor {
  explicit doppel_actor(doppel::ActorFile opened) : file(std::move(opened)) {}

  doppel::ActorFile file;
  torch::Tensor window;     ///< [1,F+1,D], oldest first
  torch::Tensor next;       ///< scratch of the same size
  torch::Tensor vertices;   ///< [1,N,3]; undefined before the first pose
  torch::Tensor texture;    ///< [1,T,T,3]
  torch::Tensor gaussians;  ///< [1,P,14]
  torch::Tensor drawn;      ///< [1,1,H,W,4]
  torch::Tensor projection = torch::empty({1, 3, 4});
  torch::Tensor faces;    ///< int32 [F,3]
  torch::Tensor normals;  ///< [1,N,3]; undefined before they are asked for
};

namespace {

thread_local std::string last_error;

/// Runs `body`. An exception becomes the error of this thread and the result `failed`.
template <typename Result, typename Body>
Result guarded(Result failed, const Body& body) {
  try {
    const torch::NoGradGuard no_grad;
    return body();
  } catch (const std::exception& e) {
    last_error = e.what();
  } catch (...) {
    last_error = "an unknown error";
  }
  return failed;
}

const doppel::ActorDescription& description(const doppel_actor* actor) { return actor->file.description(); }

/// @throws Error before the first pose. @param what is asked for, for the message
void require_pose(const doppel_actor& actor, const char* what) {
  if (!actor.vertices.defined()) doppel::fail("{} of the actor {}: push a pose first", what, description(&actor).name);
}

/// The camera as a tensor [1,3,4]. @throws Error for numbers that are not finite, and where three columns have no
/// inverse
const torch::Tensor& take_projection(doppel_actor& actor, const float projection[12]) {
  const Eigen::Map<const Eigen::Matrix<float, 3, 4, Eigen::RowMajor>> rows(projection);
  if (!rows.allFinite() || rows.leftCols<3>().cast<double>().fullPivLu().rank() < 3)
    doppel::fail(
        "the actor {} in a camera: the projection is not that of a camera; its twelve numbers must be finite, and its "
        "first three columns must have an inverse",
        description(&actor).name);
  std::memcpy(actor.projection.data_ptr<float>(), projection, 12 * sizeof(float));
  return actor.projection;
}

/// The rows of the Gaussians in a camera.
void find_gaussians(doppel_actor& actor, const float projection[12]) {
  require_pose(actor, "Gaussians");
  actor.gaussians = actor.file.gaussians(actor.window, take_projection(actor, projection), actor.vertices).contiguous();
}

/// Moves the window by one pose; before the first pose, all rows are that pose.
void next_window(doppel_actor& actor, const float* dofs) {
  const std::int64_t rows = actor.window.size(1), columns = actor.window.size(2);
  const bool first = !actor.vertices.defined();
  float* out = actor.next.data_ptr<float>();
  for (std::int64_t row = 0; row < rows; ++row) {
    const bool newest = first || row == rows - 1;
    const float* from = newest ? dofs : actor.window.data_ptr<float>() + (row + 1) * columns;
    std::memcpy(out + row * columns, from, doppel::as_size(columns) * sizeof(float));
  }
}

}  // namespace

const char* doppel_last_error(void) { return last_error.c_str(); }

doppel_actor* doppel_actor_open(const char* path) {
  return guarded<doppel_actor*>(nullptr, [&] {
    auto actor = std::make_unique<doppel_actor>(doppel::ActorFile::load(path));
    const doppel::ActorDescription& d = description(actor.get());
    actor->window = torch::zeros({1, d.past_frames + 1, static_cast<std::int64_t>(d.dof_names.size())});
    actor->next = torch::zeros_like(actor->window);
    actor->faces = torch::tensor(actor->file.topology().faces, torch::kInt32).view({-1, 3});
    return actor.release();
  });
}

void doppel_actor_close(doppel_actor* actor) { delete actor; }
void doppel_set_threads(int threads) { at::set_num_threads(std::max(1, threads)); }

int doppel_actor_num_dofs(const doppel_actor* actor) { return static_cast<int>(description(actor).dof_names.size()); }
int doppel_actor_num_vertices(const doppel_actor* actor) { return description(actor).num_vertices; }
int doppel_actor_num_faces(const doppel_actor* actor) {
  return static_cast<int>(actor->file.topology().faces.size() / 3);
}
int doppel_actor_num_uvs(const doppel_actor* actor) { return static_cast<int>(actor->file.topology().uvs.size() / 2); }
int doppel_actor_texture_size(const doppel_actor* actor) { return description(actor).texture_size; }
int doppel_actor_window(const doppel_actor* actor) { return description(actor).past_frames + 1; }
double doppel_actor_frames_per_second(const doppel_actor* actor) { return description(actor).frames_per_second; }

const char* doppel_actor_dof_name(const doppel_actor* actor, int dof) {
  if (dof < 0 || dof >= doppel_actor_num_dofs(actor)) return nullptr;
  return description(actor).dof_names[doppel::as_size(dof)].c_str();
}

const int32_t* doppel_actor_faces(const doppel_actor* actor) { return actor->file.topology().faces.data(); }
const float* doppel_actor_uvs(const doppel_actor* actor) { return actor->file.topology().uvs.data(); }
const int32_t* doppel_actor_face_uvs(const doppel_actor* actor) { return actor->file.topology().face_uvs.data(); }

int doppel_actor_push_pose(doppel_actor* actor, const float* dofs, int count) {
  return guarded(-1, [&] {
    if (count != doppel_actor_num_dofs(actor))
      doppel::fail("posing the actor {}: a pose has {} DoFs, found {}", description(actor).name,
                   doppel_actor_num_dofs(actor), count);
    for (int i = 0; i < count; ++i)
      if (!std::isfinite(dofs[i]))
        doppel::fail("posing the actor {}: DoF {} ({}) is not finite", description(actor).name, i,
                     doppel_actor_dof_name(actor, i));
    next_window(*actor, dofs);
    actor->vertices = actor->file.forward(actor->next).contiguous();
    std::swap(actor->window, actor->next);
    actor->normals = torch::Tensor();
    return 0;
  });
}

void doppel_actor_reset(doppel_actor* actor) { actor->vertices = torch::Tensor(); }

const float* doppel_actor_vertices(const doppel_actor* actor) {
  return guarded<const float*>(nullptr, [&]() -> const float* {
    require_pose(*actor, "vertices");
    return actor->vertices.data_ptr<float>();
  });
}

const float* doppel_actor_normals(doppel_actor* actor) {
  if (doppel_actor_vertices(actor) == nullptr) return nullptr;
  return guarded<const float*>(nullptr, [&]() -> const float* {
    if (!actor->normals.defined())
      actor->normals = doppel::silhouette_normals(actor->vertices, actor->faces).contiguous();
    return actor->normals.data_ptr<float>();
  });
}

const float* doppel_actor_texture(doppel_actor* actor, const float projection[12]) {
  if (doppel_actor_vertices(actor) == nullptr) return nullptr;
  return guarded<const float*>(nullptr, [&]() -> const float* {
    const torch::Tensor& camera = take_projection(*actor, projection);
    actor->texture = actor->file.texture(actor->window, camera, actor->vertices).contiguous();
    return actor->texture.data_ptr<float>();
  });
}

int doppel_actor_num_gaussians(const doppel_actor* actor) { return description(actor).num_gaussians; }

const float* doppel_actor_gaussians(doppel_actor* actor, const float projection[12]) {
  return guarded<const float*>(nullptr, [&]() -> const float* {
    find_gaussians(*actor, projection);
    return actor->gaussians.data_ptr<float>();
  });
}

const float* doppel_actor_draw(doppel_actor* actor, const float projection[12], int width, int height) {
  return guarded<const float*>(nullptr, [&]() -> const float* {
    find_gaussians(*actor, projection);
    const doppel::SplatImage image =
        doppel::draw_splats(doppel::splats_of_rows(actor->gaussians), actor->projection.unsqueeze(1), height, width);
    actor->drawn = torch::cat({image.colour, image.alpha.unsqueeze(4)}, 4).contiguous();
    return actor->drawn.data_ptr<float>();
  });
}
