/* Asserts what the C API promises.   host_check ACTOR.pt */
#undef NDEBUG
#include <assert.h>
#include <doppel/actor.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "allocations.h"

static void check_normals(doppel_actor* actor) {
  const float* normals = doppel_actor_normals(actor);
  assert(normals);
  for (int i = 0; i < doppel_actor_num_vertices(actor); ++i) {
    const float* n = normals + 3 * i;
    assert(fabsf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1) < 1e-4f);
  }
}

static void check_faces(const doppel_actor* actor) {
  const int32_t* faces = doppel_actor_faces(actor);
  assert(doppel_actor_num_faces(actor) > 0);
  for (int i = 0; i < 3 * doppel_actor_num_faces(actor); ++i)
    assert(faces[i] >= 0 && faces[i] < doppel_actor_num_vertices(actor));
}

/* Plays `frames` poses with their normals. */
static void play(doppel_actor* actor, float* pose, int frames) {
  for (int frame = 0; frame < frames; ++frame) {
    pose[1] = 0.01f * (float)(frame % 100);
    assert(doppel_actor_push_pose(actor, pose, doppel_actor_num_dofs(actor)) == 0 && doppel_actor_normals(actor));
  }
}

/* Reading the results of a frame again takes no memory. */
static void check_reading(doppel_actor* actor) {
  assert(doppel_actor_normals(actor));
  const long before = allocations_now().taken;
  assert(doppel_actor_vertices(actor) && doppel_actor_normals(actor) && doppel_actor_faces(actor));
  assert(doppel_actor_uvs(actor) && doppel_actor_face_uvs(actor) && doppel_actor_dof_name(actor, 0));
  assert(allocations_now().taken == before);
}

/* Frames give back what they take: over 2,000 frames the memory in use grows by less than one block, and less than 8
   bytes, a frame. The smallest block that the heap gives has 24 bytes. */
static void check_memory(doppel_actor* actor, float* pose) {
  enum { frames = 2000 };
  play(actor, pose, 100);
  const struct allocations before = allocations_now();
  play(actor, pose, frames);
  const struct allocations after = allocations_now();
  printf("a frame takes %.1f blocks of memory and keeps %.3f blocks, %.2f bytes\n",
         (double)(after.taken - before.taken) / frames, (double)(after.blocks - before.blocks) / frames,
         (double)(after.bytes - before.bytes) / frames);
  assert(after.blocks - before.blocks < frames / 4);
  assert(after.bytes - before.bytes < 8 * frames);
}

/* What an actor with Gaussians answers. */
static void check_gaussians(doppel_actor* actor) {
  const float camera[12] = {500, 0, -256, 900, 0, -500, -256, 900, 0, 0, -1, 3};
  float broken[12];
  memcpy(broken, camera, sizeof camera);
  broken[3] = NAN;
  const float zeros[12] = {0};
  float* pose = calloc((size_t)doppel_actor_num_dofs(actor), sizeof(float));
  assert(!doppel_actor_gaussians(actor, camera) && strstr(doppel_last_error(), "push a pose"));
  assert(!doppel_actor_draw(actor, camera, 16, 16) && strstr(doppel_last_error(), "push a pose"));
  assert(doppel_actor_push_pose(actor, pose, doppel_actor_num_dofs(actor)) == 0);
  for (const float* wrong = broken; wrong; wrong = wrong == broken ? zeros : NULL) {
    assert(!doppel_actor_gaussians(actor, wrong) && strstr(doppel_last_error(), "not that of a camera"));
    assert(!doppel_actor_texture(actor, wrong) && strstr(doppel_last_error(), "not that of a camera"));
  }
  const int sides[] = {0, -1, 16385};
  for (int i = 0; i < 3; ++i) {
    assert(!doppel_actor_draw(actor, camera, sides[i], 16) && strstr(doppel_last_error(), "16384"));
    assert(!doppel_actor_draw(actor, camera, 16, sides[i]) && strstr(doppel_last_error(), "16384"));
  }
  const float* rows = doppel_actor_gaussians(actor, camera);
  assert(rows);
  for (int i = 0; i < 14 * doppel_actor_num_gaussians(actor); ++i) assert(isfinite(rows[i]));
  const float* image = doppel_actor_draw(actor, camera, 24, 16);
  assert(image);
  for (int i = 3; i < 4 * 24 * 16; i += 4) assert(image[i] >= 0 && image[i] <= 1);
  free(pose);
}

int main(int argc, char** argv) {
  assert(argc == 2);
  assert(!doppel_actor_open("/no/such/actor.pt") && strstr(doppel_last_error(), "/no/such/actor.pt"));
  doppel_actor* actor = doppel_actor_open(argv[1]);
  if (actor && doppel_actor_num_gaussians(actor) > 0) {
    check_gaussians(actor);
    doppel_actor_close(actor);
    return 0;
  }
  assert(actor && doppel_actor_window(actor) == 3 && doppel_actor_texture_size(actor) == 0);
  const int num_dofs = doppel_actor_num_dofs(actor);
  const size_t size = 3 * sizeof(float) * (size_t)doppel_actor_num_vertices(actor);
  float *pose = calloc((size_t)num_dofs, sizeof(float)), *first = malloc(size);
  check_faces(actor);
  assert(doppel_actor_dof_name(actor, 0) && !doppel_actor_dof_name(actor, num_dofs));

  assert(!doppel_actor_vertices(actor) && strstr(doppel_last_error(), "push a pose"));
  assert(doppel_actor_push_pose(actor, pose, num_dofs - 1) == -1 && strstr(doppel_last_error(), "DoFs"));
  assert(doppel_actor_push_pose(actor, pose, num_dofs) == 0);
  memcpy(first, doppel_actor_vertices(actor), size);
  check_normals(actor);
  const float projection[12] = {500, 0, -256, 900, 0, -500, -256, 900, 0, 0, -1, 3};
  assert(!doppel_actor_texture(actor, projection) && strstr(doppel_last_error(), "no dynamic texture"));
  assert(doppel_actor_num_gaussians(actor) == 0);
  assert(!doppel_actor_draw(actor, projection, 8, 8) && strstr(doppel_last_error(), "holds none"));
  assert(!doppel_actor_gaussians(actor, projection) && strstr(doppel_last_error(), "holds none"));

  /* A pose that is not finite is refused and changes nothing. */
  pose[1] = NAN;
  assert(doppel_actor_push_pose(actor, pose, num_dofs) == -1 && strstr(doppel_last_error(), "not finite"));
  assert(memcmp(first, doppel_actor_vertices(actor), size) == 0);

  /* The window remembers past poses until it is reset. */
  pose[1] = 0.5f;
  assert(doppel_actor_push_pose(actor, pose, num_dofs) == 0);
  pose[1] = 0;
  assert(doppel_actor_push_pose(actor, pose, num_dofs) == 0);
  assert(memcmp(first, doppel_actor_vertices(actor), size) != 0);
  doppel_actor_reset(actor);
  assert(doppel_actor_push_pose(actor, pose, num_dofs) == 0);
  assert(memcmp(first, doppel_actor_vertices(actor), size) == 0);

  check_reading(actor);
  check_memory(actor, pose);
  doppel_actor_close(actor);
  free(pose);
  free(first);
  return 0;
}
