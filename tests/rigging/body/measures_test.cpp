#include "doppel/rigging/body/measures.h"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include "doppel/core/error.h"
#include "support/message_of.h"

namespace doppel::body_measures_test {
namespace {

using testing::HasSubstr;

TEST(BodyMeasures, HaveMeansWithinTheirRangesAndNamesOfTheirOwn) {
  std::set<std::string> names;
  for (const BodyMeasure& m : body_measures()) {
    EXPECT_TRUE(names.insert(m.name).second) << m.name;
    EXPECT_FALSE(m.source.empty()) << m.name;
    for (const double mean : {m.mean_woman, m.mean_man}) {
      EXPECT_GT(mean, m.low) << m.name;
      EXPECT_LT(mean, m.high) << m.name;
    }
    EXPECT_GT(m.deviation_woman, 0) << m.name;
    EXPECT_GT(m.deviation_man, 0) << m.name;
  }
  EXPECT_GE(names.size(), 30u);
}

TEST(BodyMeasures, AreFoundByName) {
  EXPECT_EQ(body_measures()[measure_index("waist_girth")].name, "waist_girth");
  const std::string message = support::message_of<UsageError>([] { measure_index("wrist"); });
  EXPECT_THAT(message, HasSubstr("'wrist'"));
  EXPECT_THAT(message, HasSubstr("wrist_girth"));
}

/// Sum of the heights of the segments from the soles to the top of the head.
double stature(const std::vector<double>& m) {
  double sum = 0;
  for (const char* part : {"ankle_height", "shin_length", "thigh_length", "trunk_length", "neck_length", "head_height"})
    sum += m[measure_index(part)];
  return sum;
}

TEST(BodyMeasures, SegmentsAddUpToTheStatureOfTheSurvey) {
  // ANSUR II: 1628.5 mm and 1756.2 mm.
  EXPECT_NEAR(stature(mean_measures(BodyBuild::woman)), 1.6285, 0.002);
  EXPECT_NEAR(stature(mean_measures(BodyBuild::man)), 1.7562, 0.002);
  const double child = stature(mean_measures(BodyBuild::child));
  EXPECT_GT(child, 1.20);
  EXPECT_LT(child, 1.35);
}

TEST(BodyMeasures, MeanAndDeviationAreThoseOfWomenAndMenTogether) {
  const int chest = measure_index("chest_girth");
  const BodyMeasure& m = body_measures()[chest];
  EXPECT_DOUBLE_EQ(mean_measures()[chest], 0.5 * (m.mean_woman + m.mean_man));
  // E[x^2] - E[x]^2 of the mixture
  const double square = 0.5 * (m.deviation_woman * m.deviation_woman + m.mean_woman * m.mean_woman +
                               m.deviation_man * m.deviation_man + m.mean_man * m.mean_man);
  EXPECT_NEAR(measure_deviations()[chest], std::sqrt(square - std::pow(mean_measures()[chest], 2)), 1e-12);
}

TEST(RandomMeasures, OneSeedGivesOneBodyWithinTheRanges) {
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    const std::vector<double> body = random_measures(seed);
    ASSERT_EQ(body, random_measures(seed));
    for (std::size_t i = 0; i < body.size(); ++i) {
      EXPECT_GE(body[i], body_measures()[i].low) << body_measures()[i].name;
      EXPECT_LE(body[i], body_measures()[i].high) << body_measures()[i].name;
    }
  }
  EXPECT_NE(random_measures(1), random_measures(2));
}

TEST(RandomMeasures, MeansAreThoseOfTheBuild) {
  constexpr int kDraws = 2000;
  std::map<BodyBuild, std::vector<std::vector<double>>> drawn;
  for (int seed = 0; seed < kDraws; ++seed) drawn[random_build(seed)].push_back(random_measures(seed));
  EXPECT_NEAR(static_cast<double>(drawn[BodyBuild::woman].size()), 0.4 * kDraws, 80);
  EXPECT_NEAR(static_cast<double>(drawn[BodyBuild::man].size()), 0.4 * kDraws, 80);
  EXPECT_NEAR(static_cast<double>(drawn[BodyBuild::child].size()), 0.2 * kDraws, 60);
  const std::vector<double> deviation = measure_deviations();
  for (const auto& [build, bodies] : drawn) {
    const std::vector<double> mean = mean_measures(build);
    for (std::size_t i = 0; i < mean.size(); ++i) {
      double sum = 0;
      for (const std::vector<double>& body : bodies) sum += body[i];
      EXPECT_NEAR(sum / static_cast<double>(bodies.size()), mean[i], 0.1 * deviation[i])
          << body_measures()[i].name << " of build " << static_cast<int>(build);
    }
  }
}

TEST(RandomMeasures, GirthsGoTogetherAndLengthsGoTogether) {
  std::vector<std::vector<double>> men;
  for (int seed = 0; seed < 2000; ++seed)
    if (random_build(seed) == BodyBuild::man) men.push_back(random_measures(seed));
  const auto correlation = [&](const char* first, const char* second) {
    const int a = measure_index(first), b = measure_index(second);
    const double n = static_cast<double>(men.size());
    double sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
    for (const auto& m : men) sa += m[a], sb += m[b], aa += m[a] * m[a], bb += m[b] * m[b], ab += m[a] * m[b];
    return (ab / n - sa * sb / n / n) / std::sqrt((aa / n - sa * sa / n / n) * (bb / n - sb * sb / n / n));
  };
  EXPECT_GT(correlation("waist_girth", "chest_girth"), 0.75);
  EXPECT_GT(correlation("thigh_length", "shin_length"), 0.55);
  EXPECT_LT(std::abs(correlation("waist_girth", "shin_length")), 0.35);
}

/// The table of docs/body.md.
std::string table() {
  std::ostringstream text;
  const auto mm = [](double metres) { return static_cast<int>(std::lround(1e3 * metres)); };
  text << "| measure | women, mm | men, mm | child, mm | range, mm | source |\n|---|---|---|---|---|---|\n";
  const std::vector<double> child = mean_measures(BodyBuild::child);
  for (std::size_t i = 0; i < body_measures().size(); ++i) {
    const BodyMeasure& m = body_measures()[i];
    text << "| `" << m.name << "` | " << mm(m.mean_woman) << " ± " << mm(m.deviation_woman) << " | " << mm(m.mean_man)
         << " ± " << mm(m.deviation_man) << " | " << mm(child[i]) << " | " << mm(m.low) << " to " << mm(m.high) << " | "
         << m.source << " |\n";
  }
  return text.str();
}

TEST(BodyMeasures, ThePageHasTheirTable) {
  std::ifstream file(std::string(DOPPEL_SOURCE_DIR) + "/docs/body.md");
  std::ostringstream page;
  page << file.rdbuf();
  EXPECT_THAT(page.str(), HasSubstr(table())) << "docs/body.md must hold this table:\n" << table();
}

}  // namespace
}  // namespace doppel::body_measures_test
