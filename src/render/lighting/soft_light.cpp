#include "doppel/render/lighting/soft_light.h"

#include <array>

namespace doppel {

namespace {

using Eigen::Vector3d;

constexpr double kAmbient = 0.55, kKey = 0.5;    // strength of the sky and of the key light
const Vector3d kKeyDirection(0.4, -0.8, -0.45);  // in the camera's axes

/// Adds the first three bands of `strength` * max(0, n . d) to coefficients in the order of sh_basis. They are
/// 1/4 + 1/2 c + 5/32 (3 c^2 - 1) with c = n . d.
void add_lambert(std::array<double, 9>& light, double strength, const Vector3d& d) {
  const double square = 5.0 / 32.0 * strength;
  light[0] += strength / 4;
  light[1] += strength / 2 * d.y();
  light[2] += strength / 2 * d.z();
  light[3] += strength / 2 * d.x();
  light[4] += 6 * square * d.x() * d.y();
  light[5] += 6 * square * d.y() * d.z();
  light[6] += square * (d.z() * d.z() - 0.5 * (d.x() * d.x() + d.y() * d.y()));
  light[7] += 6 * square * d.x() * d.z();
  light[8] += 1.5 * square * (d.x() * d.x() - d.y() * d.y());
}

}  // namespace

torch::Tensor soft_light(const Camera& camera, double albedo) {
  std::array<double, 9> light{};
  light[0] = 0.75 * kAmbient;
  light[1] = 0.25 * kAmbient;
  add_lambert(light, kKey, camera.R.transpose() * kKeyDirection.normalized());
  torch::Tensor coefficients = torch::empty({1, 1, 3, 9});
  for (int channel = 0; channel < 3; ++channel)
    for (int j = 0; j < 9; ++j) coefficients[0][0][channel][j] = albedo * light[j];
  return coefficients;
}

}  // namespace doppel
