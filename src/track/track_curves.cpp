#include "doppel/track/track_curves.h"

#include <fmt/format.h>

#include "doppel/core/atomic_file.h"
#include "doppel/core/html/embedded_image.h"
#include "doppel/core/html/html_page.h"
#include "doppel/core/html/svg_chart.h"

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

std::string verdict_of(const SequenceReport& report) {
  const std::size_t frames = report.tracked.frames.size(), lost = report.lost_frames().size();
  std::vector<HtmlCard> cards{
      {"frames", std::to_string(frames), lost == 0 ? "none lost" : fmt::format("{} lost", lost)}};
  cards.push_back({"from the keypoints", fmt::format("{:.1f} px", report.keypoint_error()), "mean over the frames"});
  if (report.livecap) {
    const LivecapSummary overlap = summarise_livecap(report);
    cards.push_back({"overlap with the masks", fmt::format("{:.3f}", overlap.overlap), "IoU of the surface"});
  }
  if (report.frames_per_second() > 0)
    cards.push_back({"speed", fmt::format("{:.1f} / s", report.frames_per_second()), "frames fitted"});
  const std::string sentence =
      lost == 0 ? fmt::format("All {} frames were tracked.", frames)
                : fmt::format("{} of {} frames were tracked; {} were lost and bridged.", frames - lost, frames, lost);
  return html_verdict(sentence) + html_cards(cards);
}

std::string sheet_of(const std::filesystem::path& sheet) {
  if (!std::filesystem::exists(sheet)) return "";
  return embedded_image(read_file(sheet), "image/jpeg",
                        "fits: the mask's outline green, the surface's red, landmarks yellow, keypoints blue");
}

}  // namespace

std::string track_section(const std::filesystem::path& out, const SequenceReport& sequence) {
  const std::string& name = sequence.tracked.sequence.name;
  return "<h2>" + escape_html(name) + "</h2>" + verdict_of(sequence) + sheet_of(out / (name + ".jpg")) +
         "<div class=\"charts\">" + charts_of(sequence) + "</div>";
}

std::string track_page(const std::vector<std::string>& sections) {
  std::string body;
  for (const std::string& section : sections) body += section;
  return html_page("Tracking", body);
}

std::string track_curves(const std::filesystem::path& out, const TrackReport& report) {
  std::vector<std::string> sections;
  for (const SequenceReport& sequence : report.sequences) sections.push_back(track_section(out, sequence));
  return track_page(sections);
}

}  // namespace doppel
