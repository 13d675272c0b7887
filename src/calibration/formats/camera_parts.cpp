#include "doppel/calibration/formats/camera_parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "doppel/core/atomic_file.h"
#include "doppel/geometry/decompositions.h"

namespace doppel {
namespace {

constexpr std::uintmax_t kMaxJsonBytes = 64 << 20;  // parsed, up to 48 times as much
constexpr int kMaxJsonDepth = 64;
constexpr double kMendableRotation = 1e-2;  // how far R R^T of a rounded rotation may be off the identity

double offset_of(PixelCentre centre) { return centre == PixelCentre::integer ? 0.5 : 0.0; }

bool is_count_of(Lens lens, std::size_t count) {
  if (lens == Lens::fisheye) return count == 4;
  if (lens == Lens::polynomial) return count <= 6;
  constexpr std::size_t kCounts[] = {0, 1, 2, 4, 5, 8, 12, 14};
  return std::find(std::begin(kCounts), std::end(kCounts), count) != std::end(kCounts);
}

const char* counts_of(Lens lens) {
  switch (lens) {
    case Lens::fisheye:
      return "a fisheye lens has 4";
    case Lens::polynomial:
      return "allowed are 0 to 6";
    case Lens::opencv:
      break;
  }
  return "allowed are 0, 1, 2, 4, 5, 8, 12 or 14";
}

void collect(const nlohmann::json& value, const std::string& what, const FileLocation& where, std::vector<double>& to) {
  if (value.is_array()) {
    for (const nlohmann::json& item : value) collect(item, what, where, to);
    return;
  }
  if (!value.is_number() || !std::isfinite(value.get<double>()))
    fail_at(where, "reading a camera calibration: {} must hold finite numbers", what);
  to.push_back(value.get<double>());
}

}  // namespace

Eigen::Matrix3d intrinsics(double fx, double fy, double cx, double cy, PixelCentre centre) {
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  K(0, 0) = fx;
  K(1, 1) = fy;
  K(0, 2) = cx + offset_of(centre);
  K(1, 2) = cy + offset_of(centre);
  return K;
}

Eigen::Matrix3d intrinsics(std::span<const double> row_major, PixelCentre centre, const FileLocation& where) {
  if (row_major.size() != 9)
    fail_at(where, "reading a camera calibration: the intrinsic matrix has {} numbers, expected 9", row_major.size());
  Eigen::Matrix3d K = matrix_from_rows(row_major);
  K(0, 2) += offset_of(centre);
  K(1, 2) += offset_of(centre);
  return K;
}

int image_side(double pixels) {
  const bool legal = pixels >= 1.0 && pixels <= kMaxImageSide && pixels == std::floor(pixels);
  return legal ? static_cast<int>(pixels) : 0;
}

int image_side(double pixels, const std::string& what, const FileLocation& where) {
  const int side = image_side(pixels);
  if (side == 0)
    fail_at(where, "reading a camera calibration: {} is {}, allowed are integers from 1 to {}", what, pixels,
            kMaxImageSide);
  return side;
}

const char* lens_name(Lens lens) {
  switch (lens) {
    case Lens::fisheye:
      return "fisheye";
    case Lens::polynomial:
      return "polynomial";
    case Lens::opencv:
      break;
  }
  return "opencv";
}

void set_distortion(Camera& camera, Lens lens, std::span<const double> coefficients, const FileLocation& where) {
  std::size_t count = coefficients.size();
  // Some writers fill up with zeros.
  while (count > 0 && !is_count_of(lens, count) && coefficients[count - 1] == 0.0) --count;
  if (!is_count_of(lens, count))
    fail_at(where, "reading a camera calibration: camera {} has {} coefficients of distortion; {}", camera.name,
            coefficients.size(), counts_of(lens));
  camera.lens = lens;
  camera.distortion = {};
  std::copy_n(coefficients.begin(), count, camera.distortion.begin());
  if (lens == Lens::polynomial && camera.distortion[5] == 0.0) camera.lens = Lens::opencv;
}

Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  if (angle == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

Eigen::Vector3d vector_from_rotation(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

Eigen::Matrix3d rotation_from_quaternion(double w, double x, double y, double z, const FileLocation& where) {
  const Eigen::Quaterniond q(w, x, y, z);
  if (!(q.norm() > 0.0) || !std::isfinite(q.norm()))
    fail_at(where, "reading a camera calibration: the quaternion ({}, {}, {}, {}) is no rotation", w, x, y, z);
  return q.normalized().toRotationMatrix();
}

Eigen::Matrix3d repaired_rotation(const Eigen::Matrix3d& matrix) {
  const double deviation = (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(deviation <= kMendableRotation)) return matrix;
  const auto [U, values, V] = svd(matrix);
  return U * V.transpose();
}

Eigen::Matrix3d matrix_from_rows(std::span<const double> row_major) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(row_major.data());
}

void set_pose_at(Camera& camera, const Eigen::Matrix3d& R, const Eigen::Vector3d& centre) {
  camera.R = R;
  camera.t = -R * centre;
}

nlohmann::json read_json(const std::filesystem::path& path) {
  const std::string text = read_file(path, kMaxJsonBytes);
  try {
    return nlohmann::json::parse(text, [&](int depth, nlohmann::json::parse_event_t, nlohmann::json&) {
      if (depth > kMaxJsonDepth)
        fail_at({path.string(), 0}, "reading a camera calibration: lists and objects are nested more than {} deep",
                kMaxJsonDepth);
      return true;
    });
  } catch (const nlohmann::json::exception& e) {
    long line = 1;
    if (const auto* parse = dynamic_cast<const nlohmann::json::parse_error*>(&e))
      line += std::count(text.begin(), text.begin() + static_cast<long>(std::min(parse->byte, text.size())), '\n');
    fail_at({path.string(), static_cast<int>(line)}, "reading a camera calibration: this is no valid JSON: {}",
            e.what());
  }
}

std::vector<double> numbers(const nlohmann::json& array, std::size_t count, const std::string& what,
                            const FileLocation& where) {
  if (!array.is_array()) fail_at(where, "reading a camera calibration: {} must be a list of numbers", what);
  std::vector<double> found;
  collect(array, what, where, found);
  if (count != 0 && found.size() != count)
    fail_at(where, "reading a camera calibration: {} has {} numbers, expected {}", what, found.size(), count);
  return found;
}

double number(const nlohmann::json& object, const char* key, const std::string& what, const FileLocation& where) {
  const auto item = object.find(key);
  if (item == object.end() || !item->is_number() || !std::isfinite(item->get<double>()))
    fail_at(where, "reading a camera calibration: {} must be a finite number{}", what,
            item == object.end() ? ", it is missing" : "");
  return item->get<double>();
}

}  // namespace doppel
