/* Plays a motion file with an exported actor, by the C API of libdoppel.so.
 *   play_actor ACTOR.pt MOTION.motion OUT.f32 [LAST.pam]
 * writes the posed vertices of every frame as raw float32 [frames, vertices, 3], and prints the frames a second. With
 * LAST.pam, an actor with Gaussians is drawn from the front in its last pose: 512 x 512 RGBA.
 *   cc play_actor.c -ldoppel -lm -o play_actor */
#include <doppel/actor.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double now(void) {
  struct timespec t;
  timespec_get(&t, TIME_UTC);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Reads the first line, the name of the format. @return the sign of angles, which is another in the old format */
static float read_header(FILE* motion) {
  char line[64] = "";
  if (!fgets(line, sizeof(line), motion)) return 1;
  return strstr(line, "V0.1") ? -1.0f : 1.0f;
}

/* Reads the next row: the frame's number and `count` DoFs. 1: read, 0: the file has ended. */
static int read_pose(FILE* motion, float* dofs, int count, float sign) {
  float id;
  if (fscanf(motion, "%f", &id) != 1) return 0;
  for (int i = 0; i < count; ++i) {
    if (fscanf(motion, "%f", &dofs[i]) != 1) return 0;
    if (i >= 3) dofs[i] *= sign;
  }
  for (int c = fgetc(motion); c != '\n' && c != EOF;) c = fgetc(motion); /* columns of another program */
  return 1;
}

/* A camera in front of the actor: pixels from world metres, row by row [3,4]. */
static void face_actor(const doppel_actor* actor, int side, float projection[12]) {
  const float* v = doppel_actor_vertices(actor);
  float low[3] = {v[0], v[1], v[2]}, high[3] = {v[0], v[1], v[2]};
  for (int i = 0; i < 3 * doppel_actor_num_vertices(actor); ++i) {
    low[i % 3] = fminf(low[i % 3], v[i]);
    high[i % 3] = fmaxf(high[i % 3], v[i]);
  }
  const float x = (low[0] + high[0]) / 2, y = (low[1] + high[1]) / 2, z = (low[2] + high[2]) / 2;
  const float away = 3 * (high[1] - low[1]), focal = 2.5f * (float)side, middle = (float)side / 2;
  const float rows[12] = {focal, 0,      -middle, middle * (z + away) - focal * x,
                          0,     -focal, -middle, middle * (z + away) + focal * y,
                          0,     0,      -1,      z + away};
  for (int i = 0; i < 12; ++i) projection[i] = rows[i];
}

/* Draws the actor as it stands. 0: done */
static int draw(doppel_actor* actor, const char* path) {
  enum { side = 512 };
  if (doppel_actor_num_gaussians(actor) == 0)
    return printf("the actor has no Gaussians, so %s is not drawn\n", path), 0;
  float projection[12];
  face_actor(actor, side, projection);
  const float* image = doppel_actor_draw(actor, projection, side, side);
  if (!image) return fprintf(stderr, "%s\n", doppel_last_error()), 1;
  FILE* out = fopen(path, "wb");
  if (!out) return fprintf(stderr, "cannot write %s\n", path), 1;
  fprintf(out, "P7\nWIDTH %d\nHEIGHT %d\nDEPTH 4\nMAXVAL 255\nTUPLTYPE RGB_ALPHA\nENDHDR\n", side, side);
  for (int p = 0; p < side * side; ++p) {
    const float alpha = image[4 * p + 3], *rgb = image + 4 * p;
    for (int k = 0; k < 3; ++k)
      fputc((int)(255 * fminf(1, rgb[k] / fmaxf(alpha, 1e-6f)) + 0.5f), out); /* PAM's alpha is straight */
    fputc((int)(255 * alpha + 0.5f), out);
  }
  return fclose(out) == 0 ? 0 : 1;
}

int main(int argc, char** argv) {
  if (argc != 4 && argc != 5)
    return fprintf(stderr, "usage: play_actor ACTOR.pt MOTION.motion OUT.f32 [LAST.pam]\n"), 2;
  doppel_actor* actor = doppel_actor_open(argv[1]);
  if (!actor) return fprintf(stderr, "%s\n", doppel_last_error()), 1;
  const int num_dofs = doppel_actor_num_dofs(actor), num_vertices = doppel_actor_num_vertices(actor);
  float* dofs = malloc(sizeof(float) * (size_t)num_dofs);
  FILE *motion = fopen(argv[2], "r"), *out = fopen(argv[3], "wb");
  if (!dofs || !motion || !out) return fprintf(stderr, "cannot open the motion or the output\n"), 1;
  const float sign = read_header(motion);
  int frames = 0;
  double seconds = 0;
  while (read_pose(motion, dofs, num_dofs, sign)) {
    const double begin = now();
    if (doppel_actor_push_pose(actor, dofs, num_dofs) != 0) return fprintf(stderr, "%s\n", doppel_last_error()), 1;
    const float* vertices = doppel_actor_vertices(actor);
    if (frames++ > 0) seconds += now() - begin; /* the first frame also prepares the networks */
    fwrite(vertices, 3 * sizeof(float), (size_t)num_vertices, out);
  }
  printf("%d frames of %d vertices, %.1f frames/s; the actor plays at %.0f\n", frames, num_vertices,
         frames > 1 ? (frames - 1) / seconds : 0.0, doppel_actor_frames_per_second(actor));
  const int drawn = argc == 5 ? draw(actor, argv[4]) : 0;
  doppel_actor_close(actor);
  fclose(motion);
  free(dofs);
  return fclose(out) == 0 && drawn == 0 ? 0 : 1;
}
