#include "doppel/track/track_curves.h"

#include <vector>

#include "doppel/train/html_page.h"
#include "doppel/train/svg_chart.h"

namespace doppel {
namespace {

using nlohmann::ordered_json;

struct Curve {
  const char *key, *name;
};
struct Chart {
  const char* title;
  std::vector<Curve> curves;
};

const std::vector<Chart>& all_charts() {
  static const std::vector<Chart> charts{
      {"Overlap with the mask (IoU)", {{"IoU_of_pose", "pose"}, {"IoU_of_surface", "surface"}}},
      {"Distance from keypoints, pixels", {{"keypoint_error_px", "keypoints"}}},
      {"Joints from the true ones, mm", {{"joints_mm", "as tracked"}, {"aligned_joints_mm", "aligned"}}},
      {"Vertices from the true ones, mm", {{"pose_vertices_mm", "pose"}, {"vertices_mm", "surface"}}}};
  return charts;
}

std::string chart_of(const Chart& chart, const ordered_json& frames) {
  std::vector<ChartSeries> series;
  for (const Curve& curve : chart.curves) {
    ChartSeries points{curve.name, {}};
    for (const auto& frame : frames)
      if (frame.contains(curve.key)) points.points.emplace_back(frame["frame"], frame[curve.key]);
    if (!points.points.empty()) series.push_back(std::move(points));
  }
  return series.empty() ? "" : svg_chart(chart.title, series, false);
}

}  // namespace

std::string track_curves(const ordered_json& report) {
  std::string body;
  for (const auto& [name, sequence] : report["sequences"].items()) {
    body += "<h2>" + escape_html(name) + "</h2><div class=\"charts\">";
    for (const Chart& chart : all_charts()) body += chart_of(chart, sequence["per_frame"]);
    body += "</div>";
  }
  return html_page("Tracking", body);
}

}  // namespace doppel
