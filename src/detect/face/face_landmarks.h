#pragma once

#include <array>

namespace doppel {

/// A point of the face that neither the jaw nor an expression moves.
struct FaceLandmark {
  int point;                       ///< its number among the points of FacePose
  std::array<double, 3> position;  ///< on a mean face, centimetres: x to the person's left, y up, z forwards
};

/// The points of the face that fits use as landmarks: nose, corners of the eyes, temples, cheekbones, forehead. The
/// positions are those of MediaPipe's canonical face (`geometry_pipeline_metadata_landmarks.binarypb` in the package of
/// the network).
inline constexpr std::array<FaceLandmark, 24> kFaceLandmarks = {{
    {10, {0.00, 8.26, 4.48}},                                 // forehead, at the hair
    {151, {0.00, 6.55, 5.03}},                                // forehead
    {168, {0.00, 3.27, 5.24}},                                // between the eyes
    {6, {0.00, 2.47, 5.79}},                                  // bridge of the nose
    {195, {0.00, 1.06, 6.77}},                                // back of the nose
    {4, {0.00, -0.46, 7.59}},                                 // tip of the nose
    {33, {-4.45, 2.66, 3.17}},   {263, {4.45, 2.66, 3.17}},   // outer corners of the eyes
    {133, {-1.86, 2.59, 3.76}},  {362, {1.86, 2.59, 3.76}},   // inner corners of the eyes
    {127, {-7.74, 2.36, -2.01}}, {356, {7.74, 2.36, -2.01}},  // temples, at the height of the eyes
    {162, {-7.56, 4.11, -0.99}}, {389, {7.56, 4.11, -0.99}},  // temples
    {21, {-7.09, 5.43, 0.10}},   {251, {7.09, 5.43, 0.10}},   // temples, above
    {54, {-6.28, 6.62, 1.43}},   {284, {6.28, 6.62, 1.43}},   // sides of the forehead
    {67, {-3.52, 8.01, 3.73}},   {297, {3.52, 8.01, 3.73}},   // forehead, at the hair
    {234, {-7.66, 0.67, -2.44}}, {454, {7.66, 0.67, -2.44}},  // before the ears
    {116, {-6.47, 0.94, 1.69}},  {345, {6.47, 0.94, 1.69}},   // cheekbones
}};
inline constexpr int kFaceTip = 4;  ///< number of the tip of the nose

}  // namespace doppel
