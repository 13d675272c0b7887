#include "doppel/detect/keypoints/space_points.h"

namespace doppel {

namespace {

constexpr double kMaxPointDistance = 1e5;  ///< metres

}  // namespace

double metres_of_unit(const std::string& unit, const FileLocation& where) {
  std::string word;
  for (const char c : unit) word += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  if (word == "m" || word == "meters" || word == "metres") return 1.0;
  if (word == "cm") return 0.01;
  if (word == "mm") return 0.001;
  fail_at(where, "reading points in space: the unit is '{}'; m, cm and mm are known", unit.substr(0, 20));
}

void require_near(const Eigen::Vector3d& point, const FileLocation& where) {
  if (!(point.cwiseAbs().maxCoeff() < kMaxPointDistance))
    fail_at(where, "reading points in space: a point is farther away than 100 km");
}

}  // namespace doppel
