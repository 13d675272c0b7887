/* Plays a motion file with an exported actor, by the C API of libdoppel.so.
 *   play_actor ACTOR.pt MOTION.motion OUT.f32
 * writes the posed vertices of every frame as raw float32 [frames, vertices, 3], and prints the frames a second.
 *   cc play_actor.c -ldoppel -lm -o play_actor */
#include <doppel/actor.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void) {
  struct timespec t;
  timespec_get(&t, TIME_UTC);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Reads the next row: the frame's number and `count` DoFs. 1: read, 0: the file has ended. */
static int read_pose(FILE* motion, float* dofs, int count) {
  float id;
  if (fscanf(motion, "%f", &id) != 1) return 0;
  for (int i = 0; i < count; ++i)
    if (fscanf(motion, "%f", &dofs[i]) != 1) return 0;
  return 1;
}

int main(int argc, char** argv) {
  if (argc != 4) return fprintf(stderr, "usage: play_actor ACTOR.pt MOTION.motion OUT.f32\n"), 2;
  doppel_actor* actor = doppel_actor_open(argv[1]);
  if (!actor) return fprintf(stderr, "%s\n", doppel_last_error()), 1;
  const int num_dofs = doppel_actor_num_dofs(actor), num_vertices = doppel_actor_num_vertices(actor);
  float* dofs = malloc(sizeof(float) * (size_t)num_dofs);
  FILE *motion = fopen(argv[2], "r"), *out = fopen(argv[3], "wb");
  if (!dofs || !motion || !out) return fprintf(stderr, "cannot open the motion or the output\n"), 1;
  int c;
  while ((c = fgetc(motion)) != '\n' && c != EOF) continue; /* the first line is the name of the format */
  int frames = 0;
  double seconds = 0;
  while (read_pose(motion, dofs, num_dofs)) {
    const double begin = now();
    if (doppel_actor_push_pose(actor, dofs, num_dofs) != 0) return fprintf(stderr, "%s\n", doppel_last_error()), 1;
    const float* vertices = doppel_actor_vertices(actor);
    if (frames++ > 0) seconds += now() - begin; /* the first frame also prepares the networks */
    fwrite(vertices, 3 * sizeof(float), (size_t)num_vertices, out);
  }
  printf("%d frames of %d vertices, %.1f frames/s; the actor plays at %.0f\n", frames, num_vertices,
         frames > 1 ? (frames - 1) / seconds : 0.0, doppel_actor_frames_per_second(actor));
  doppel_actor_close(actor);
  fclose(motion);
  free(dofs);
  return fclose(out) == 0 ? 0 : 1;
}
