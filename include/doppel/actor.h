/** @file
 * A streaming host for exported actors, in C. Link libdoppel.so.
 *
 * An actor is a file of `doppel export` on a run of egnet or ddc. Push one pose a frame; then ask for vertices,
 * normals, the dynamic texture, or a drawing of the actor. The actor keeps the window of past poses that its networks
 * need.
 *
 * Units are metres, the world is right-handed with y up. An actor is used by one thread at a time; several actors may
 * be used by several threads. Arrays belong to the actor. Those of a pose are valid until the next push, reset or
 * close.
 */
#ifndef DOPPEL_ACTOR_H
#define DOPPEL_ACTOR_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define DOPPEL_API __attribute__((visibility("default")))

typedef struct doppel_actor doppel_actor;

/** What went wrong in the last call of this thread that failed. */
DOPPEL_API const char* doppel_last_error(void);

/** Opens an actor file. NULL: failed, see doppel_last_error. The file contains code, which is checked:
   it can call nothing but operators that compute (SECURITY.md). */
DOPPEL_API doppel_actor* doppel_actor_open(const char* path);
/** NULL is allowed. */
DOPPEL_API void doppel_actor_close(doppel_actor* actor);
/** Threads of one frame, for all actors of the process. Call it before the first frame. */
DOPPEL_API void doppel_set_threads(int threads);

DOPPEL_API int doppel_actor_num_dofs(const doppel_actor* actor);
DOPPEL_API int doppel_actor_num_vertices(const doppel_actor* actor);
DOPPEL_API int doppel_actor_num_faces(const doppel_actor* actor);
DOPPEL_API int doppel_actor_num_uvs(const doppel_actor* actor); /**< 0: the template has no UVs */
/** Texels along a side of the dynamic texture. 0: the file has none. */
DOPPEL_API int doppel_actor_texture_size(const doppel_actor* actor);
/** Poses in the window that the networks see. */
DOPPEL_API int doppel_actor_window(const doppel_actor* actor);
/** The frame rate at which poses should be pushed. */
DOPPEL_API double doppel_actor_frames_per_second(const doppel_actor* actor);
/** The name of column `dof` of a pose. NULL: there is no such column. */
DOPPEL_API const char* doppel_actor_dof_name(const doppel_actor* actor, int dof);

DOPPEL_API const int32_t* doppel_actor_faces(const doppel_actor* actor);    /**< [faces,3], counter-clockwise outside */
DOPPEL_API const float* doppel_actor_uvs(const doppel_actor* actor);        /**< [uvs,2], u right, v up */
DOPPEL_API const int32_t* doppel_actor_face_uvs(const doppel_actor* actor); /**< [faces,3], rows of uvs */

/** Computes the frame of a pose: `count` DoFs as in a row of a motion file. The first pose after open or reset stands
 * for the poses before it. 0: done; -1: failed, and the actor is as before. */
DOPPEL_API int doppel_actor_push_pose(doppel_actor* actor, const float* dofs, int count);
/** Forgets all poses: the next one begins a motion. */
DOPPEL_API void doppel_actor_reset(doppel_actor* actor);

/** [vertices,3]. NULL: no pose was pushed. */
DOPPEL_API const float* doppel_actor_vertices(const doppel_actor* actor);
/** [vertices,3] of unit length, area-weighted; computed on demand. NULL: no pose was pushed. */
DOPPEL_API const float* doppel_actor_normals(doppel_actor* actor);
/** [size,size,3] RGB 0..1, row 0 at v = 1, for a camera: `projection` [3,4], row by row, pixels from world metres.
 * NULL: no pose was pushed, the file has no dynamic texture, or the projection is not that of a camera. */
DOPPEL_API const float* doppel_actor_texture(doppel_actor* actor, const float projection[12]);

/** Gaussians on the surface. 0: the file has none. */
DOPPEL_API int doppel_actor_num_gaussians(const doppel_actor* actor);
/** [gaussians,14] as the camera `projection` sees them: centre x y z (world, metres), unit quaternion w x y z, standard
 * deviations along the rotated axes (metres), opacity 0..1, red green blue as displayed, 0 and more. For hosts that
 * draw Gaussians themselves. Valid until the next call of this function or of doppel_actor_draw. NULL: no pose was
 * pushed, the file has no Gaussians, or the projection is not that of a camera. */
DOPPEL_API const float* doppel_actor_gaussians(doppel_actor* actor, const float projection[12]);
/** Draws the Gaussians in a camera: [height,width,4] red, green, blue (0 and more; 1 is white) and alpha (0..1), row
 * 0 at the top. Colours are already multiplied by alpha: over a background b, a pixel shows rgb + (1 - alpha) b. Valid
 * until the next call of this function. NULL: as doppel_actor_gaussians, or a side is not 1 to 16384 pixels. */
DOPPEL_API const float* doppel_actor_draw(doppel_actor* actor, const float projection[12], int width, int height);

#ifdef __cplusplus
}
#endif

#endif
