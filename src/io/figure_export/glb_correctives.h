#pragma once

#include <tiny_gltf.h>

#include "doppel/io/figure_export/corrective_function.h"
#include "doppel/io/figure_export/glb_buffer.h"

namespace doppel {

/// The object `correctives` in the extras of a mesh (docs/animate.md): `lags` and `limit` as numbers, and the arrays as
/// indices of accessors of floats, the rows of matrices one after the other. Bones are numbered as the joints of the
/// skin. Target 0 always has weight 1, target k + 1 has weight k of the function.
tinygltf::Value corrective_extras(GlbBuffer& buffer, const CorrectiveFunction& function);

/// The object `helpers`: the same keys, and `low` and `high` [6N]. The first joints of the skin are the bones, one for
/// each entry of `parents`; the last N are the helpers.
tinygltf::Value helper_extras(GlbBuffer& buffer, const HelperFunction& function);

}  // namespace doppel
