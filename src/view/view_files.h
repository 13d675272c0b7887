#pragma once

#include <string>

#include "doppel/view/view_subject.h"

namespace doppel {

/// What the page loads once, from a server and from a folder alike, as the bytes of files below `double/`.
struct ViewFiles {
  /// `description.json`: `name`, `vertices`, `motion` (its number), `frames`, `frames_per_second`, `cuts` (frames that
  /// begin a new segment), `textured` (whether there is a texture.jpg), `cameras` and `training` (whether the server
  /// has images of this motion, and a run), `rest` [D], `dofs` (`name`, `limits` if any), `joints` (`name`, `parent`,
  /// `moved_by`: reach_dofs.h) and `stages` (`name`, `past_frames`, `texture_size`, and `geometry`: the stage that has
  /// the same vertices). For a sequence without a character the lists are empty, and there are `points` [K] names and
  /// `sticks`: pairs of points with a line between them
  std::string description;
  /// `mesh.bin`: uint32 counts of corners and of split vertices; uint32 corners [3F]; uint32 template vertex of each
  /// split vertex [S]; float32 UVs [S,2]
  std::string mesh;
  std::string motion;   ///< `motion.bin`: float32 [frames, D]
  std::string texture;  ///< `texture.jpg`: the template's texture; empty without
  std::string points;   ///< `points.bin`: float32 [frames, K, 3], world metres, NaN: not found; empty with a character
};

/// @param motion at least one frame, the subject's own or another; ignored for a sequence without a character
/// @param number of the motion, by which a page of the server names it
ViewFiles view_files(const ViewSubject& subject, const Motion& motion, int number = 0);

}  // namespace doppel
