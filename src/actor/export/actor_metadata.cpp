#include "doppel/actor/export/actor_metadata.h"

namespace doppel {

nlohmann::ordered_json actor_metadata(const Character& character, const ActorDescription& d) {
  nlohmann::ordered_json json = {
      {"name", d.name},
      {"input", "DoF window [batch, window, dofs], oldest frame first, in the units of the motion file"},
      {"output", "posed vertices [batch, vertices, 3]"},
      {"units", "metres"},
      {"world", "right-handed, y up"},
      {"window", d.past_frames + 1},
      {"frames_per_second", d.frames_per_second},
      {"num_vertices", character.num_vertices()},
      {"num_dofs", character.num_dofs()},
      {"dof_names", d.dof_names},
      {"joint_names", d.joint_names},
      {"fingerprint", d.fingerprint},
  };
  if (d.texture_size > 0)
    json["texture"] = {
        {"size", d.texture_size},
        {"method", "textured(window, projection [batch, 3, 4], pixels from world metres) -> (vertices, texture)"},
        {"output", "RGB [batch, size, size, 3], 0..1, row 0 at v = 1"}};
  if (d.num_gaussians > 0)
    json["gaussians"] = {
        {"count", d.num_gaussians},
        {"method", "gaussians(window, projection [batch, 3, 4], vertices [batch, vertices, 3]) -> rows"},
        {"output",
         "[batch, count, 14]: centre x y z in metres, unit quaternion w x y z, standard deviations along the rotated "
         "axes in metres, opacity 0..1, RGB as displayed, 0 and more"}};
  return json;
}

}  // namespace doppel
