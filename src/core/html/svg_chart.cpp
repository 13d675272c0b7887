#include "doppel/core/html/svg_chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace doppel {

namespace {

constexpr double kWidth = 560, kHeight = 260, kLeft = 62, kRight = 14, kTop = 30, kBottom = 34;
constexpr double kLine = 15;  ///< height of a line of the legend
constexpr std::array<const char*, 6> kColours = {"#2563eb", "#dc2626", "#059669", "#d97706", "#7c3aed", "#475569"};
constexpr std::array<const char*, 4> kDashes = {"none", "6 3", "2 3", "8 3 2 3"};  ///< a colour again has the next one
constexpr std::size_t kMaxPoints = 400;

/// Maps values to screen coordinates along one axis.
struct Axis {
  double low = 0, high = 1, from = 0, to = 1;
  bool logarithmic = false;

  double value(double x) const { return logarithmic ? std::log10(x) : x; }
  double pixel_of(double x) const { return from + (value(x) - low) / (high - low) * (to - from); }

  /// Round numbers (1, 2 or 5 times a power of ten; whole powers on long logarithmic axes) inside the range.
  std::vector<double> ticks() const {
    std::vector<double> out;
    if (logarithmic && high - low >= 1.0) {
      const double stride = std::max(1.0, std::ceil((high - low) / 6.0));
      for (double e = std::ceil(low); e <= high + 1e-9; e += stride) out.push_back(std::pow(10.0, e));
      return out;
    }
    const double first = logarithmic ? std::pow(10.0, low) : low, last = logarithmic ? std::pow(10.0, high) : high;
    const double rough = (last - first) / 5.0, power = std::pow(10.0, std::floor(std::log10(rough)));
    const double step = (rough / power < 1.5   ? 1.0
                         : rough / power < 3.5 ? 2.0
                         : rough / power < 7.5 ? 5.0
                                               : 10.0) *
                        power;
    for (double x = std::ceil(first / step) * step; x <= last + 1e-9 * step; x += step)
      out.push_back(std::abs(x) < 1e-12 * step ? 0.0 : x);
    return out;
  }
};

std::vector<std::pair<double, double>> thin(const std::vector<std::pair<double, double>>& points) {
  if (points.size() <= kMaxPoints) return points;
  std::vector<std::pair<double, double>> out;
  const std::size_t pieces = kMaxPoints / 2;
  for (std::size_t piece = 0; piece < pieces; ++piece) {
    const auto begin = points.begin() + static_cast<std::ptrdiff_t>(piece * points.size() / pieces);
    const auto end = points.begin() + static_cast<std::ptrdiff_t>((piece + 1) * points.size() / pieces);
    auto [low, high] = std::minmax_element(begin, end, [](auto& a, auto& b) { return a.second < b.second; });
    if (low > high) std::swap(low, high);
    out.push_back(*low);
    if (low != high) out.push_back(*high);
  }
  return out;
}

/// The range of all values, widened when there is only one value.
std::pair<double, double> range(const std::vector<ChartSeries>& series, bool x) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const ChartSeries& s : series)
    for (const auto& point : s.points) {
      low = std::min(low, x ? point.first : point.second);
      high = std::max(high, x ? point.first : point.second);
    }
  if (!(low <= high)) return {0.0, 1.0};
  if (low == high)
    return low == 0.0 ? std::make_pair(0.0, 1.0)
                      : std::make_pair(std::min(0.9 * low, 1.1 * low), std::max(0.9 * low, 1.1 * low));
  return {low, high};
}

std::string grid(const Axis& x, const Axis& y) {
  std::string out;
  for (double tick : x.ticks())
    out += fmt::format("<text class=\"tick\" x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:g}</text>",
                       x.pixel_of(tick), kHeight - kBottom + 16, tick);
  for (double tick : y.ticks())
    out += fmt::format(
        "<line class=\"grid\" x1=\"{}\" x2=\"{}\" y1=\"{:.1f}\" y2=\"{:.1f}\"/><text class=\"tick\" x=\"{}\" "
        "y=\"{:.1f}\" "
        "text-anchor=\"end\">{:.4g}</text>",
        kLeft, kWidth - kRight, y.pixel_of(tick), y.pixel_of(tick), kLeft - 6, y.pixel_of(tick) + 4, tick);
  return out;
}

/// How the line of a series looks.
std::string stroke(std::size_t series) {
  return fmt::format("stroke=\"{}\" stroke-width=\"1.5\" stroke-dasharray=\"{}\"", kColours[series % kColours.size()],
                     kDashes[series / kColours.size() % kDashes.size()]);
}

struct Legend {
  std::string svg;
  double height = 0;  ///< below the title's line
};

/// The lines of several series and their names, beside the title and below it.
Legend legend_of(const std::string& title, const std::vector<ChartSeries>& series) {
  Legend legend;
  if (series.size() < 2) return legend;
  double x = kLeft + 8.0 * static_cast<double>(title.size()) + 12.0, y = 16;
  for (std::size_t i = 0; i < series.size(); ++i) {
    const double width = 7.0 * static_cast<double>(series[i].name.size()) + 34.0;
    if (x > kLeft && x + width > kWidth) {
      x = kLeft;
      y += kLine;
    }
    legend.svg += fmt::format(
        "<line x1=\"{:.1f}\" x2=\"{:.1f}\" y1=\"{}\" y2=\"{}\" {}/><text class=\"tick\" x=\"{:.1f}\" "
        "y=\"{}\">{}</text>",
        x, x + 16, y - 4, y - 4, stroke(i), x + 20, y, escape_html(series[i].name));
    x += width;
  }
  legend.height = y - 16;
  return legend;
}

}  // namespace

std::string escape_html(const std::string& text) {
  std::string out;
  for (char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string svg_chart(const std::string& title, const std::vector<ChartSeries>& series, bool logarithmic) {
  const auto [x_low, x_high] = range(series, true);
  auto [y_low, y_high] = range(series, false);
  const bool log_axis = logarithmic && y_low > 0.0;
  if (log_axis) {
    y_low = std::log10(y_low);
    y_high = std::log10(y_high);
  }
  const Legend legend = legend_of(title, series);
  const Axis x{x_low, x_high, kLeft, kWidth - kRight, false};
  const Axis y{y_low, y_high, kHeight - kBottom, kTop, log_axis};

  std::string curves = grid(x, y);
  for (std::size_t i = series.size(); i-- > 0;) {
    std::string path;
    for (const auto& [px, py] : thin(series[i].points))
      path += fmt::format("{:.1f},{:.1f} ", x.pixel_of(px), y.pixel_of(py));
    curves += fmt::format("<polyline fill=\"none\" {} points=\"{}\"/>", stroke(i), path);
  }
  return fmt::format(
      "<svg viewBox=\"0 0 {0} {1}\" role=\"img\"><text class=\"title\" x=\"{2}\" y=\"16\">{3}</text>{4}"
      "<g transform=\"translate(0 {5})\">{6}</g></svg>",
      kWidth, kHeight + legend.height, kLeft, escape_html(title), legend.svg, legend.height, curves);
}

}  // namespace doppel
