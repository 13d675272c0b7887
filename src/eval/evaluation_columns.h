#pragma once

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace doppel {

/// A figure of the tables of `doppel evaluate` and `doppel compare`.
struct EvaluationColumn {
  const char* key;  ///< in the rows of evaluation.json; `filmed_MSE` stands for `filmed.MSE`
  const char* title;
  double factor;  ///< from the value in the file to the number in the table
  int digits;
  const char* unit;

  /// The value in a row; null when the row does not have the figure.
  const nlohmann::ordered_json* find(const nlohmann::ordered_json& row) const {
    constexpr std::string_view kFilmed = "filmed_MSE";
    if (!row.is_object()) return nullptr;
    if (kFilmed == key) return row.contains("filmed") ? member(row["filmed"], "MSE") : nullptr;
    return member(row, key);
  }
  /// The number as in a table, without the unit; `-` for a value that is no finite number, which files hold as null.
  std::string text(const nlohmann::ordered_json& value) const {
    if (!value.is_number() || !std::isfinite(value.get<double>())) return "-";
    return fmt::format("{:.{}f}", factor * value.get<double>(), digits);
  }

 private:
  static const nlohmann::ordered_json* member(const nlohmann::ordered_json& object, const char* name) {
    const auto found = object.find(name);
    return found == object.end() ? nullptr : &*found;
  }
};

/// All figures, in the order of the tables.
inline constexpr EvaluationColumn kEvaluationColumns[] = {{"AMVIoU", "AMVIoU", 1, 4, ""},
                                                          {"RVIoU", "RVIoU", 1, 4, ""},
                                                          {"SVIoU", "SVIoU", 1, 4, ""},
                                                          {"hand_IoU", "hands", 1, 3, ""},
                                                          {"outside", "outside", 100, 2, " %"},
                                                          {"missing", "missing", 100, 2, " %"},
                                                          {"vertex_error_mm", "vertex error", 1, 2, " mm"},
                                                          {"Hausdorff_mm", "Hausdorff", 1, 2, " mm"},
                                                          {"surface_distance_mm", "off the surface", 1, 2, " mm"},
                                                          {"seen_distance_mm", "where seen", 1, 2, " mm"},
                                                          {"normal_error_deg", "normals", 1, 2, " deg"},
                                                          {"roughness_error_mm", "roughness error", 1, 2, " mm"},
                                                          {"roughness_ratio", "roughness", 1, 3, ""},
                                                          {"border_length_ratio", "borders", 1, 3, ""},
                                                          {"scan_distance_mm", "off the scan", 1, 2, " mm"},
                                                          {"noise_mm", "noise", 1, 2, " mm"},
                                                          {"median_mm", "median", 1, 2, " mm"},
                                                          {"p99_mm", "99 %", 1, 2, " mm"},
                                                          {"3DPCK", "3DPCK", 1, 1, " %"},
                                                          {"AUC", "AUC", 1, 1, " %"},
                                                          {"MPJPE_mm", "MPJPE", 1, 1, " mm"},
                                                          {"GLE_mm", "GLE", 1, 1, " mm"},
                                                          {"keypoint_error_px", "keypoints", 1, 1, " px"},
                                                          {"frames_without_pose", "frames without pose", 1, 0, ""},
                                                          {"MSE", "MSE", 1, 2, ""},
                                                          {"PSNR", "PSNR", 1, 2, " dB"},
                                                          {"SSIM", "SSIM", 1, 4, ""},
                                                          {"sharpness", "sharpness", 1, 3, ""},
                                                          {"LPIPS", "LPIPS", 1, 4, ""},
                                                          {"flicker", "flicker", 1, 2, ""},
                                                          {"filmed_flicker", "filmed flicker", 1, 2, ""},
                                                          {"whole_MSE", "whole MSE", 1, 2, ""},
                                                          {"whole_PSNR", "whole PSNR", 1, 2, " dB"},
                                                          {"whole_SSIM", "whole SSIM", 1, 4, ""},
                                                          {"whole_full_MSE", "whole full MSE", 1, 2, ""},
                                                          {"whole_full_PSNR", "whole full PSNR", 1, 2, " dB"},
                                                          {"whole_full_SSIM", "whole full SSIM", 1, 4, ""},
                                                          {"seconds", "drawn in", 1, 3, " s"},
                                                          {"filmed_MSE", "as filmed", 1, 2, ""}};

}  // namespace doppel
