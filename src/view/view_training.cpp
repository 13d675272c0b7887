#include "doppel/view/view_training.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "doppel/actor/run_folder.h"
#include "doppel/actor/run_stages.h"
#include "doppel/core/as_size.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/train/metrics.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxImageBytes = 64 << 20, kPoints = 500;

/// The run itself when it trains one stage, and the stages of a chain, as far as they have begun.
std::vector<RunFolder> begun_stages(const fs::path& run) {
  std::vector<RunFolder> found;
  if (fs::exists(RunFolder(run).metrics())) found.emplace_back(run);
  std::vector<std::string> stages = ddc_stages();
  stages.insert(stages.end(), {"posenet", "defnet"});
  for (const std::string& stage : stages)
    if (fs::exists(RunFolder(run / stage).metrics())) found.emplace_back(run / stage);
  return found;
}

std::vector<fs::path> image_files(const RunFolder& stage) {
  std::vector<fs::path> files;
  if (fs::is_directory(stage.images()))
    for (const auto& entry : fs::directory_iterator(stage.images()))
      if (entry.path().extension() == ".jpg") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

nlohmann::json curves(const std::vector<MetricsRecord>& records) {
  nlohmann::json result = nlohmann::json::object();
  const std::size_t every = std::max<std::size_t>(1, (records.size() + kPoints - 1) / kPoints);
  for (std::size_t i = (records.size() - 1) % every; i < records.size(); i += every) {  // the last one is kept
    const MetricsRecord& record = records[i];
    result["loss"].push_back({record.step, record.loss});
    if (record.terms.size() < 2) continue;
    for (const MetricsRecord::Term& term : record.terms) result[term.name].push_back({record.step, term.weighted});
  }
  return result;
}

nlohmann::json image_entry(const fs::path& file) {
  const fs::path caption = fs::path(file).replace_extension(".txt");
  return {{"caption", fs::exists(caption) ? read_file(caption) : file.stem().string()},
          {"written", fs::last_write_time(file).time_since_epoch().count()}};
}

nlohmann::json stage_entry(const RunFolder& stage) {
  nlohmann::json entry{{"name", fs::absolute(stage.path()).lexically_normal().filename().string()},
                       {"steps", 0},
                       {"seconds", 0.0},
                       {"curves", nlohmann::json::object()},
                       {"images", nlohmann::json::array()}};
  const std::vector<MetricsRecord> records = read_metrics(stage.metrics());
  if (!records.empty()) {
    entry["steps"] = records.back().step;
    entry["seconds"] = records.back().seconds;
    entry["curves"] = curves(records);
  }
  for (const fs::path& file : image_files(stage)) entry["images"].push_back(image_entry(file));
  return entry;
}

}  // namespace

std::string training_state(const fs::path& run) {
  nlohmann::json stages = nlohmann::json::array();
  for (const RunFolder& stage : begun_stages(run)) stages.push_back(stage_entry(stage));
  return nlohmann::json{{"stages", stages}}.dump();
}

std::string training_image(const fs::path& run, int stage, int image) {
  const std::vector<RunFolder> stages = begun_stages(run);
  if (stage < 0 || as_size(stage) >= stages.size())
    fail<UsageError>("there is no stage {}; {} stages have begun, counted from 0", stage, stages.size());
  const std::vector<fs::path> files = image_files(stages[stage]);
  if (image < 0 || as_size(image) >= files.size())
    fail<UsageError>("there is no image {}; there are {}, counted from 0", image, files.size());
  return read_file(files[image], kMaxImageBytes);
}

}  // namespace doppel
