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

/// A line chart as an inline SVG element: axes with round numbers, a legend, at most 400 points per curve (long series
/// keep the extremes of each piece). `logarithmic` applies where all values are positive.
std::string svg_chart(const std::string& title, const std::vector<ChartSeries>& series, bool logarithmic);

/// `text` with the characters that mean something in HTML replaced.
std::string escape_html(const std::string& text);

}  // namespace doppel
