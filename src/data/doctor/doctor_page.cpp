#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "doppel/calibration/formats/camera_plan.h"
#include "doppel/core/as_size.h"
#include "doppel/core/html/embedded_image.h"
#include "doppel/core/html/html_page.h"
#include "doppel/core/html/svg_chart.h"
#include "doppel/data/doctor/doctor.h"

namespace doppel {

namespace {

constexpr int kImageWidth = 420;

std::string figure_html(const cv::Mat& image, const std::string& caption) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, 80});
  return embedded_image({bytes.begin(), bytes.end()}, "image/jpeg", caption);
}

const char* verdict_sentence(Verdict verdict) {
  switch (verdict) {
    case Verdict::healthy:
      return "This capture is healthy: go on with it.";
    case Verdict::suspicious:
      return "This capture is suspicious: look at the findings before you go on.";
    case Verdict::faulty:
      return "This capture is faulty: mend the faults below first, results would be wrong.";
  }
  return "";
}

std::string findings_table(const Examination& examination) {
  if (examination.findings.empty()) return "<p>Nothing was found.</p>";
  std::string rows;
  for (const Finding& finding : examination.findings)
    rows += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{}</td><td style=\"text-align:left\">{}</td>"
        "<td style=\"text-align:left\">{}</td></tr>",
        escape_html(finding.camera.empty() ? "all" : finding.camera), finding.fault, to_string(finding.severity),
        escape_html(finding.figure), escape_html(finding.advice));
  return "<table><tr><th>camera</th><th>fault</th><th>severity</th><th style=\"text-align:left\">measured</th>"
         "<th style=\"text-align:left\">what to do</th></tr>" +
         rows + "</table>";
}

std::string cameras_table(const Examination& examination) {
  if (!examination.body) return "";
  const BodyExamination& body = *examination.body;
  const Consensus& consensus = examination.rig->nominal;
  std::string rows;
  for (std::size_t c = 0; c < body.cameras.size(); ++c) {
    const CameraCoverage& coverage = body.cameras[c];
    rows += fmt::format(
        "<tr><td>{}</td><td>{:.2f} %</td><td>{:.2f} %</td><td>{:.2f} m</td><td>{:.0f} px</td><td>{:.0f} %</td>"
        "<td>{:.0f} %</td><td>{:.0f}°</td></tr>",
        escape_html(examination.seen.cameras[c].name), 100.0 * consensus.residual[c], 100.0 * consensus.expected[c],
        coverage.distance, coverage.height, 100.0 * coverage.inside, 100.0 * coverage.detected, coverage.azimuth);
  }
  return fmt::format(
      "<h2>Cameras</h2><p>The person is about {:.2f} m tall and covers {:.1f} x {:.1f} x {:.1f} m. The residual is the "
      "distance of a camera's keypoints from the body that the other cameras see, as a share of the person's size in "
      "the "
      "image.</p><table><tr><th>camera</th><th>residual</th><th>expected</th><th>distance</th><th>person</th>"
      "<th>body in image</th><th>frames with person</th><th>direction</th></tr>{}</table>",
      body.stature, body.highest.x() - body.lowest.x(), body.highest.y() - body.lowest.y(),
      body.highest.z() - body.lowest.z(), rows);
}

/// Curves of a measure over the rows, one for each camera; charts without points are left out.
template <typename Measure>
std::string chart_of(const Examination& examination, std::size_t sequence, const std::string& title,
                     const Measure& measure) {
  std::vector<ChartSeries> series;
  for (std::size_t c = 0; c < examination.seen.cameras.size(); ++c) {
    ChartSeries curve{examination.seen.cameras[c].name, {}};
    for (const ImageFacts& facts : examination.footage[sequence][c].images)
      if (const double value = measure(facts); std::isfinite(value))
        curve.points.emplace_back(static_cast<double>(facts.row), value);
    if (!curve.points.empty()) series.push_back(std::move(curve));
  }
  return series.empty() ? "" : svg_chart(title, series, false);
}

std::string residual_chart(const Examination& examination) {
  if (!examination.rig || !examination.rig->nominal.found) return "";
  std::vector<ChartSeries> series;
  for (std::size_t c = 0; c < examination.seen.cameras.size(); ++c) {
    ChartSeries curve{examination.seen.cameras[c].name, {}};
    const std::vector<double>& windows = examination.rig->nominal.by_window[c];
    for (std::size_t w = 0; w < windows.size(); ++w)
      if (windows[w] >= 0.0) curve.points.emplace_back(examination.seen.windows[w].front(), 100.0 * windows[w]);
    if (!curve.points.empty()) series.push_back(std::move(curve));
  }
  return series.empty()
             ? ""
             : svg_chart("Residual of the keypoints, % of the person's size, over all frames", series, false);
}

std::string charts_html(const Examination& examination) {
  std::string charts = residual_chart(examination);
  const auto known = [](double value) { return value < 0.0 ? NAN : value; };
  for (std::size_t s = 0; s < examination.footage.size(); ++s) {
    const std::string of = examination.footage.size() > 1 ? ", " + examination.sequences[s] : "";
    charts +=
        chart_of(examination, s, "Light on the person, stops" + of, [](const ImageFacts& f) { return f.exposure; });
    charts += chart_of(examination, s, "Change from frame to frame, grey levels" + of,
                       [&](const ImageFacts& f) { return known(f.change); });
    charts += chart_of(examination, s, "Width of the sharpest edges, pixels" + of,
                       [&](const ImageFacts& f) { return known(f.edge_width); });
    charts += chart_of(examination, s, "Area of the mask, % of the image" + of,
                       [&](const ImageFacts& f) { return 100.0 * known(f.mask_area); });
    charts += chart_of(examination, s, "Flicker of the mask, % of its area" + of,
                       [&](const ImageFacts& f) { return 100.0 * known(f.flicker); });
  }
  return charts.empty() ? "" : "<h2>Curves</h2><div class=\"charts\">" + charts + "</div>";
}

/// The image with the outline of the mask (blue), the keypoints (yellow) and the body that the cameras agree on
/// (green).
cv::Mat drawn_sample(const Examination& examination, const FootageExamination& footage, std::size_t c) {
  const Sightings& seen = examination.seen;
  const double scale = static_cast<double>(kImageWidth) / footage.sample.cols;
  cv::Mat image;
  cv::resize(footage.sample, image, {}, scale, scale, cv::INTER_AREA);
  if (!footage.sample_mask.empty()) {
    cv::Mat mask;
    cv::resize(footage.sample_mask, mask, image.size(), 0, 0, cv::INTER_NEAREST);
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(mask, outlines, cv::RETR_LIST, cv::CHAIN_APPROX_SIMPLE);
    cv::drawContours(image, outlines, -1, {255, 120, 40}, 1, cv::LINE_AA);
  }
  const auto mark = [&](const Eigen::Vector2d& pixel, const cv::Scalar& colour, int radius) {
    if (pixel.allFinite() && pixel.cwiseAbs().maxCoeff() < 1e5)
      cv::circle(image, {static_cast<int>(pixel.x() * scale), static_cast<int>(pixel.y() * scale)}, radius, colour,
                 radius > 2 ? 1 : cv::FILLED, cv::LINE_AA);
  };
  const auto instant = as_size(footage.sample_instant);
  for (int k = 0; examination.rig && examination.rig->nominal.found && k < seen.num_points(); ++k) {
    const Eigen::Vector3d& point = examination.rig->nominal.body.at(footage.sample_instant, k);
    const auto pixel = point.allFinite() ? examination.rig->views[c].pixel(point) : std::nullopt;
    if (pixel) mark(*pixel, {80, 220, 80}, 4);
  }
  for (const SeenPerson& person : seen.people[c][instant])
    for (const SeenPoint& point : person)
      if (point.seen) mark(point.pixel, {0, 230, 255}, 2);
  return image;
}

std::string samples_html(const Examination& examination) {
  std::string figures;
  for (std::size_t s = 0; s < examination.footage.size(); ++s)
    for (std::size_t c = 0; c < examination.footage[s].size(); ++c) {
      const FootageExamination& footage = examination.footage[s][c];
      if (footage.sample.empty()) continue;
      figures +=
          figure_html(drawn_sample(examination, footage, c),
                      fmt::format("camera {}, {}, frame {}", examination.seen.cameras[c].name, examination.sequences[s],
                                  examination.seen.instants[footage.sample_instant].row));
    }
  if (figures.empty()) return "";
  return "<h2>Images</h2><p>Yellow: keypoints. Green circles: the body that the cameras agree on, as this camera "
         "should "
         "see it. Blue: outline of the mask.</p><div class=\"charts\">" +
         figures + "</div>";
}

std::string plan_html(const Examination& examination) {
  std::vector<Camera> cameras = examination.seen.cameras;
  for (Camera& camera : cameras) camera.t /= examination.seen.scale;
  return "<h2>Plan of the cameras</h2>" +
         figure_html(draw_camera_plan(cameras), "from above and from the side, as calibrated");
}

}  // namespace

std::string doctor_page(const Examination& examination) {
  const std::string body = html_verdict(verdict_sentence(examination.verdict())) +
                           html_cards({{"verdict", to_string(examination.verdict()), ""},
                                       {"findings", std::to_string(examination.findings.size()), ""}}) +
                           findings_table(examination) + cameras_table(examination) + samples_html(examination) +
                           plan_html(examination) + charts_html(examination);
  return html_page("Examination of " + examination.capture, body);
}

}  // namespace doppel
