#include "doppel/train/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <regex>

#include "doppel/core/atomic_file.h"
#include "doppel/core/html/svg_chart.h"
#include "doppel/train/metrics.h"
#include "support/temporary_folder.h"

namespace doppel::report_test {

using support::TemporaryFolder;

namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Every element that is opened is closed, in order.
::testing::AssertionResult well_formed(const std::string& html) {
  static const std::regex tag("<(/?)([a-zA-Z0-9]+)((?:\"[^\"]*\"|[^\">])*)>");
  const std::set<std::string> empty = {"meta", "img", "br", "link"};
  std::vector<std::string> open;
  for (std::sregex_iterator it(html.begin(), html.end(), tag), end; it != end; ++it) {
    const std::string name = (*it)[2], rest = (*it)[3];
    if (empty.count(name) || (!rest.empty() && rest.back() == '/')) continue;
    if ((*it)[1] != "/") {
      open.push_back(name);
    } else if (open.empty() || open.back() != name) {
      return ::testing::AssertionFailure() << "</" << name << "> closes " << (open.empty() ? "nothing" : open.back());
    } else {
      open.pop_back();
    }
  }
  return open.empty() ? ::testing::AssertionSuccess() : ::testing::AssertionFailure() << open.back() << " stays open";
}

TEST(ReportReference, HoldsCurvesTimesTableAndImages) {
  const TemporaryFolder folder;
  const RunFolder run(folder / "a<b");
  std::filesystem::create_directories(run.images());
  {
    MetricsFile file(run.metrics(), 0);
    for (int step = 1; step <= 1000; ++step) {
      MetricsRecord r;
      r.step = step;
      r.loss = 100.0 / step;
      r.terms = {{"silhouette", 1.0 / step, 100.0 / step}};
      r.milliseconds = {{"backward", 30.0}, {"load", 10.0}};
      file.append(r);
    }
  }
  write_atomically(run.config(), "stage: egnet  # <&>\n");
  write_atomically(run.evaluation(), R"({"protocol": {"frames": 60}, "splits": {"test": {
    "skinning": {"AMVIoU": 0.904, "cameras": {"0": 0.9}}, "egnet": {"AMVIoU": 0.9712, "cameras": {"0": 0.97}}}}})");
  write_atomically(run.images() / "overlay.jpg", std::string("Man"));
  write_atomically(run.images() / "overlay.txt", "mask green, model red");
  write_report(run);
  const std::string html = read_file(run.report());
  EXPECT_TRUE(well_formed(html));
  EXPECT_THAT(html, HasSubstr("0.9712"));
  EXPECT_THAT(html, HasSubstr("<td>backward</td><td>30.00</td><td>75 %</td>"));
  EXPECT_THAT(html, HasSubstr("base64,TWFu"));
  EXPECT_THAT(html, HasSubstr("the surface of egnet overlaps the masks by 97.1 %"));
  EXPECT_THAT(html, HasSubstr("skinning alone by 90.4 %"));
  EXPECT_LT(html.find("class=\"verdict\""), html.find("<h2>Curves"));
  EXPECT_THAT(html, HasSubstr("<details><summary>Protocol"));
  EXPECT_THAT(html, HasSubstr("mask green"));
  EXPECT_THAT(html, HasSubstr("a&lt;b"));
  EXPECT_THAT(html, Not(HasSubstr("http://")));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

TEST(ReportRecovers, AnEmptyRunAndDamagedFiles) {
  const TemporaryFolder folder;
  const RunFolder run(folder.path());
  write_report(run);
  EXPECT_TRUE(well_formed(read_file(run.report())));
  write_atomically(run.evaluation(), "{\"splits\": ");
  write_atomically(run.metrics(), "garbage");
  write_report(run);
  EXPECT_TRUE(well_formed(read_file(run.report())));
}

TEST(ChartReference, LongSeriesKeepTheirExtremes) {
  ChartSeries series{"s", {}};
  for (int i = 0; i < 10000; ++i) series.points.emplace_back(i, i == 5003 ? 7.0 : 1.0 + 0.001 * (i % 2));
  const std::string svg = svg_chart("peak", {series}, true);
  EXPECT_TRUE(well_formed(svg));
  // The peak touches the top of the drawing area (y = 30).
  EXPECT_TRUE(std::regex_search(svg, std::regex(",30\\.0 ")));
  EXPECT_LT(svg.size(), 12000u);
}

TEST(ChartReference, EverySeriesLooksAsItsNameInTheLegend) {
  std::vector<ChartSeries> series;
  for (int i = 0; i < 12; ++i) series.push_back({"camera " + std::to_string(i), {{0, i}, {1, i + 1}}});
  const std::string svg = svg_chart("cameras", series, false);
  EXPECT_TRUE(well_formed(svg));
  std::map<std::string, int> looks;
  const std::regex stroke("stroke=\"#[^>]*dasharray=\"[^\"]*\"");
  for (std::sregex_iterator at(svg.begin(), svg.end(), stroke), end; at != end; ++at) ++looks[at->str()];
  EXPECT_EQ(looks.size(), 12u);
  for (const auto& [look, times] : looks) EXPECT_EQ(times, 2) << look;
}

TEST(ChartReference, SinglePointZeroAndNegativeValues) {
  EXPECT_TRUE(well_formed(svg_chart("one", {{"a", {{1, 5}}}}, true)));
  EXPECT_TRUE(well_formed(svg_chart("zero", {{"a", {{1, 0}, {2, 0}}}}, true)));
  EXPECT_TRUE(well_formed(svg_chart("none", {{"a", {}}}, false)));
  const std::string svg = svg_chart("negative", {{"a", {{1, -2}, {2, 3}}}, {"b", {{1, 1}, {2, 0}}}}, true);
  EXPECT_TRUE(well_formed(svg));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace doppel::report_test
