#pragma once

/// Parts of persons that several JSON formats share.

#include <filesystem>
#include <initializer_list>
#include <memory>
#include <nlohmann/json.hpp>

#include "doppel/core/error.h"
#include "doppel/detect/keypoints/keypoints.h"

namespace doppel {

/// Parses a JSON file of at most 1 GB. The tokens NaN and Infinity, which Python writes, become null.
/// @throws FileError with the line of the fault
std::shared_ptr<const nlohmann::json> parse_keypoint_json(const std::filesystem::path& path);

/// The value of the first of these keys that an object has; null when it has none or is no object.
const nlohmann::json* find_key(const nlohmann::json& object, std::initializer_list<const char*> keys);

/// A point with its confidence brought to 0..1; not seen when the confidence is 0 or less, or a number is missing.
Keypoint keypoint_of(double x, double y, double confidence);

/// What the third number of a point is.
enum class ThirdNumber {
  confidence,
  visibility  ///< 0 not labelled, 1 hidden, 2 visible; become confidences 0, 0.5, 1
};

/// [x, y, c, x, y, c, ...]. A point with a null is not seen. @throws FileError when the list is not of this form
Person flat_points(const nlohmann::json& list, const FileLocation& where, ThirdNumber third = ThirdNumber::confidence);
/// [[x, y], ...] with the confidences in a list beside it, or [[x, y, c], ...] without.
/// @param scores null: none @throws FileError as flat_points, and for points in space
Person nested_points(const nlohmann::json& list, const nlohmann::json* scores, const FileLocation& where);
/// Either of the two forms; an empty list is nobody.
Person points_of_person(const nlohmann::json& list, const nlohmann::json* scores, const FileLocation& where);

/// A frame number: an integer from 0. Nothing for other values.
std::optional<long> json_frame(const nlohmann::json* value);
/// The names in a list or in an object of `"0": name`; empty when it is neither.
std::vector<std::string> json_names(const nlohmann::json* value);

}  // namespace doppel
