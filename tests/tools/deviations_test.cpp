// The presets of configs/paper do what the thesis prints; docs/results/deviations.md names every exception.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "doppel/core/atomic_file.h"
#include "tools/thesis_values.h"

namespace doppel::deviations {
namespace {

namespace fs = std::filesystem;

const fs::path kSource = DOPPEL_SOURCE_DIR;
const fs::path kPage = kSource / "docs/results/deviations.md";

const ThesisValues& thesis() {
  static const ThesisValues values = ThesisValues::load(kSource / "docs/results/thesis_values.yaml");
  return values;
}

bool belongs_to_machine(const std::string& key) {
  return std::any_of(thesis().machine.begin(), thesis().machine.end(), [&](const std::string& ending) {
    if (key.size() < ending.size()) return false;
    const std::size_t start = key.size() - ending.size();
    return key.compare(start, ending.size(), ending) == 0 && (start == 0 || key[start - 1] == '.');
  });
}

class Preset : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    const auto found = std::find_if(thesis().presets.begin(), thesis().presets.end(),
                                    [](const PresetValues& preset) { return preset.name == GetParam(); });
    ASSERT_NE(found, thesis().presets.end()) << "docs/results/thesis_values.yaml has no preset " << GetParam();
    expected_ = *found;
    found_ = preset_values(GetParam(), kSource / "configs/paper" / (GetParam() + ".yaml"));
  }
  PresetValues expected_;
  std::map<std::string, std::string> found_;
};

TEST_P(Preset, HasAnArgumentForEveryKey) {
  for (const auto& [key, value] : found_) {
    if (belongs_to_machine(key)) continue;
    const KeyEntry* entry = expected_.find(key);
    if (!entry)
      ADD_FAILURE() << "docs/results/thesis_values.yaml says nothing about " << key << ": " << value;
    else
      EXPECT_TRUE(same_value(value, entry->ours))
          << key << " is " << value << ", docs/results/thesis_values.yaml has " << entry->ours;
  }
}

TEST_P(Preset, ListsNoKeyThatDoesNotExist) {
  for (const auto& [key, entry] : expected_.keys) EXPECT_TRUE(found_.count(key)) << key;
}

TEST_P(Preset, SaysWhyForEveryDeviation) {
  for (const auto& [key, entry] : expected_.keys) {
    if (entry.kind != KeyEntry::Kind::deviates) continue;
    EXPECT_FALSE(entry.why.empty() || entry.section.empty()) << key;
    EXPECT_FALSE(same_value(entry.ours, entry.thesis)) << key << " does not deviate";
  }
  for (const OtherDeviation& other : expected_.others)
    EXPECT_FALSE(other.why.empty() || other.thesis.empty() || other.ours.empty() || other.section.empty());
}

INSTANTIATE_TEST_SUITE_P(Paper, Preset, ::testing::Values("livecap", "deepcap", "adapt", "ddc", "hybrid", "nerf"),
                         [](const auto& preset) { return preset.param; });

TEST(DeviationsPage, IsUpToDate) {
  const std::string page = deviations_page(thesis());
  if (std::getenv("DOPPEL_WRITE_DEVIATIONS")) write_atomically(kPage, page);
  ASSERT_TRUE(fs::exists(kPage)) << "run scripts/deviations.sh";
  EXPECT_EQ(read_file(kPage), page) << "run scripts/deviations.sh";
}

TEST(ThesisValues, ComparesNumbersAsNumbers) {
  EXPECT_TRUE(same_value("1e-4", "0.0001"));
  EXPECT_TRUE(same_value("paper", "paper"));
  EXPECT_FALSE(same_value("1e-4", "1e-3"));
  EXPECT_FALSE(same_value("true", "1"));
}

}  // namespace
}  // namespace doppel::deviations
