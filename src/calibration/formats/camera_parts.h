#pragma once

/// Parts of cameras that several calibration formats share.

#include <Eigen/Core>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>

#include "doppel/core/error.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// Where a format has the centre of the first pixel.
enum class PixelCentre {
  integer,  ///< at (0, 0), as OpenCV and all that calibrates with it
  half,     ///< at (0.5, 0.5), as COLMAP, Metashape, the NeRF family and Doppel
};

/// fx 0 cx; 0 fy cy; 0 0 1 in Doppel's convention of pixel centres.
Eigen::Matrix3d intrinsics(double fx, double fy, double cx, double cy, PixelCentre centre);
/// The same from a 3 x 3 matrix, row by row; keeps the skew. @throws FileError when it is no matrix of intrinsics
Eigen::Matrix3d intrinsics(std::span<const double> row_major, PixelCentre centre, const FileLocation& where);

/// A number of pixels as the side of an image; 0 when it is no integer of 1 to 65536.
int image_side(double pixels);
/// The same. @throws FileError that names `what` where the other one returns 0
int image_side(double pixels, const std::string& what, const FileLocation& where);

/// The name of a lens in our own files and in `doppel info`: "opencv", "fisheye" or "polynomial".
const char* lens_name(Lens lens);
/// Sets `lens` and `distortion`. A polynomial without k4 is OpenCV's lens. @param coefficients in the order of the
/// lens; opencv: 0, 1, 2, 4, 5, 8, 12 or 14 of them, fisheye: 4, polynomial: up to 6. Longer lists whose surplus is 0
/// are legal. @throws FileError for another number
void set_distortion(Camera& camera, Lens lens, std::span<const double> coefficients, const FileLocation& where);

/// The rotation about `vector` by its length (Rodrigues).
Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& vector);
Eigen::Vector3d vector_from_rotation(const Eigen::Matrix3d& rotation);
/// The rotation of a quaternion that need not be normalised. @throws FileError when it is 0 or not finite
Eigen::Matrix3d rotation_from_quaternion(double w, double x, double y, double z, const FileLocation& where);
/// The nearest rotation, for matrices that were written with few digits (R R^T within 1e-2 of the identity); otherwise
/// the matrix itself, which Camera::faults then names.
Eigen::Matrix3d repaired_rotation(const Eigen::Matrix3d& matrix);
Eigen::Matrix3d matrix_from_rows(std::span<const double> row_major);

/// Sets R and t = -R centre. @param R camera from world
void set_pose_at(Camera& camera, const Eigen::Matrix3d& R, const Eigen::Vector3d& centre);

/// Reads a JSON file of at most 256 MB; NaN and Infinity, which some writers print, are refused.
/// @throws FileError with the line of the fault
nlohmann::json read_json(const std::filesystem::path& path);
/// The numbers of a JSON array, nested or not. @throws FileError that names `what`, when there are not `count` of them
/// (0: any number)
std::vector<double> numbers(const nlohmann::json& array, std::size_t count, const std::string& what,
                            const FileLocation& where);
/// A number of an object. @throws FileError that names `what` when it is missing, no number or not finite
double number(const nlohmann::json& object, const char* key, const std::string& what, const FileLocation& where);

}  // namespace doppel
