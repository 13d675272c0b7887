/* Asserts what the C API promises.   host_check ACTOR.pt */
#undef NDEBUG
#include <assert.h>
#include <doppel/actor.h>
#include <malloc.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Bytes in use on the heap. */
static size_t in_use(void) { return mallinfo2().uordblks + mallinfo2().hblkhd; }

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

int main(int argc, char** argv) {
  assert(argc == 2);
  assert(!doppel_actor_open("/no/such/actor.pt") && strstr(doppel_last_error(), "/no/such/actor.pt"));
  doppel_actor* actor = doppel_actor_open(argv[1]);
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
  const float projection[12] = {0};
  assert(!doppel_actor_texture(actor, projection) && strstr(doppel_last_error(), "geometry only"));

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

  /* Memory does not grow from frame to frame. */
  size_t before = 0;
  for (int frame = 0; frame < 300; ++frame) {
    pose[1] = 0.01f * (float)frame;
    assert(doppel_actor_push_pose(actor, pose, num_dofs) == 0 && doppel_actor_normals(actor));
    if (frame == 99) before = in_use();
  }
  assert(in_use() <= before + 4096);
  doppel_actor_close(actor);
  free(pose);
  free(first);
  return 0;
}
