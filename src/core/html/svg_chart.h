#pragma once

#include <string>
#include <utility>
#include <vector>

namespace doppel {

/// A curve of a chart.
struct ChartSeries {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< x ascending
};

/// A line chart as an inline SVG element, with round numbers on the axes, a legend and at most 400 points per curve. A
/// longer curve keeps the extremes of each piece. @param logarithmic ignored unless all values are positive
std::string svg_chart(const std::string& title, const std::vector<ChartSeries>& series, bool logarithmic);

/// `text` with the special characters of HTML escaped.
std::string escape_html(const std::string& text);

}  // namespace doppel
