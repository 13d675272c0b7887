#include "doppel/track/track_curves.h"

#include <vector>

#include "doppel/html/html_page.h"
#include "doppel/html/svg_chart.h"

namespace doppel {
namespace {

ChartSeries curve(const std::string& name, long first_frame, const std::vector<double>& values) {
  ChartSeries series{name, {}};
  for (std::size_t i = 0; i < values.size(); ++i)
    series.points.emplace_back(first_frame + static_cast<long>(i), values[i]);
  return series;
}

std::string chart(const std::string& title, std::vector<ChartSeries> curves) {
  std::vector<ChartSeries> drawn;
  for (ChartSeries& series : curves)
    if (!series.points.empty()) drawn.push_back(std::move(series));
  return drawn.empty() ? "" : svg_chart(title, drawn, false);
}

std::string overlap_chart(const SequenceReport& report, long first_frame) {
  ChartSeries pose{"pose", {}}, surface{"surface", {}};
  if (report.livecap)
    for (const LivecapOverlap& overlap : *report.livecap) {
      const long frame = first_frame + static_cast<long>(overlap.frame);
      pose.points.emplace_back(frame, overlap.pose);
      surface.points.emplace_back(frame, overlap.surface);
    }
  return chart("Overlap with the mask (IoU)", {pose, surface});
}

std::string charts_of(const SequenceReport& report) {
  const long first = report.tracked.sequence.first_frame;
  std::vector<double> keypoints;
  for (const TrackedFrame& frame : report.tracked.frames) keypoints.push_back(frame.keypoint_error);
  const MotionDifference joints = report.difference.value_or(MotionDifference());
  const SurfaceErrors vertices = report.errors.value_or(SurfaceErrors());
  return overlap_chart(report, first) +
         chart("Distance from keypoints, pixels", {curve("keypoints", first, keypoints)}) +
         chart("Joints from the true ones, mm",
               {curve("as tracked", first, joints.frame_mm), curve("aligned", first, joints.frame_aligned_mm)}) +
         chart("Vertices from the true ones, mm",
               {curve("pose", first, vertices.skinned), curve("surface", first, vertices.tracked)});
}

}  // namespace

std::string track_curves(const TrackReport& report) {
  std::string body;
  for (const SequenceReport& sequence : report.sequences)
    body += "<h2>" + escape_html(sequence.tracked.sequence.name) + "</h2><div class=\"charts\">" + charts_of(sequence) +
            "</div>";
  return html_page("Tracking", body);
}

}  // namespace doppel
