#pragma once

#include "doppel/geometry/mesh.h"
#include "doppel/synth/body_field.h"

namespace doppel::synth {

/// The material of a surface point. It determines colour and label.
enum class Material { skin, hair, shirt, skirt, trousers, shoe };
Material material_at(const BodyField& field, const Eigen::Vector3d& p);

/// RGB 0..1 of a point of the rest-pose surface. The colour depends on the position only, so seams of the atlas are not
/// visible.
Eigen::Vector3d colour_at(const BodyField& field, const Eigen::Vector3d& p);

/// Paints an 8-bit BGR texture of `size` x `size` texels for a mesh with UVs; each chart is extended by a few texels
/// beyond its edge, so that texture filtering never mixes in the background colour.
cv::Mat paint_texture(const TriangleMesh& mesh, const BodyField& field, int size);

/// The label of the LIP human parser per vertex (formats: hair 2, upper clothes 5, pants 9, skirt 12, face 13, arms,
/// shoes).
std::vector<int> parser_labels(const TriangleMesh& mesh, const BodyField& field);

}  // namespace doppel::synth
