#include "doppel/train/metrics.h"

#include <optional>
#include <sstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"

namespace doppel {

namespace {

using Json = nlohmann::ordered_json;

std::vector<std::string> read_lines(const std::filesystem::path& path) {
  std::vector<std::string> lines;
  if (!std::filesystem::exists(path)) return lines;
  std::istringstream text(read_file(path));
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

/// Parses a line; nothing for an incomplete line or one of another format.
std::optional<MetricsRecord> parse(const std::string& line) {
  const auto json = nlohmann::json::parse(line, nullptr, false);
  if (json.is_discarded() || !json.is_object()) return std::nullopt;
  try {
    return MetricsRecord::from_json(json);
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

/// Rewrites the file with the lines up to `step`. @return its path
std::filesystem::path keep_until(const std::filesystem::path& path, std::int64_t step) {
  std::string kept;
  for (const std::string& line : read_lines(path)) {
    const auto record = parse(line);
    if (record && record->step <= step) kept += line + "\n";
  }
  write_atomically(path, kept);
  return path;
}

}  // namespace

std::string MetricsRecord::to_line() const {
  Json json;
  json["step"] = step;
  json["seconds"] = seconds;
  json["learning_rate"] = learning_rate;
  json["loss"] = loss;
  for (const Term& term : terms) json["terms"][term.name] = Json{{"raw", term.raw}, {"weighted", term.weighted}};
  json["gradient_norm"] = gradient_norm;
  for (const auto& [part, time] : milliseconds) json["milliseconds"][part] = time;
  json["memory_mb"] = memory_mb;
  return json.dump();
}

MetricsRecord MetricsRecord::from_json(const nlohmann::json& json) {
  MetricsRecord record;
  record.step = json.at("step").get<std::int64_t>();
  record.seconds = json.at("seconds").get<double>();
  record.learning_rate = json.at("learning_rate").get<double>();
  record.loss = json.at("loss").get<double>();
  record.gradient_norm = json.at("gradient_norm").get<double>();
  if (json.contains("terms"))
    for (const auto& [name, term] : json.at("terms").items())
      record.terms.push_back({name, term.at("raw").get<double>(), term.at("weighted").get<double>()});
  if (json.contains("milliseconds"))
    for (const auto& [part, time] : json.at("milliseconds").items())
      record.milliseconds.emplace_back(part, time.get<double>());
  record.memory_mb = json.value("memory_mb", 0.0);
  return record;
}

void MetricsWindow::add(const std::vector<MetricsRecord::Term>& terms, double gradient_norm, const Profile& profile) {
  if (sums_.empty())
    sums_ = terms;
  else
    for (std::size_t i = 0; i < terms.size(); ++i) {
      sums_.at(i).raw += terms[i].raw;
      sums_.at(i).weighted += terms[i].weighted;
    }
  gradient_norm_ += gradient_norm;
  profile_.add(profile);
  ++steps_;
}

MetricsRecord MetricsWindow::take() {
  MetricsRecord record;
  const double share = 1.0 / static_cast<double>(std::max<std::int64_t>(1, steps_));
  for (const MetricsRecord::Term& sum : sums_) {
    record.terms.push_back({sum.name, sum.raw * share, sum.weighted * share});
    record.loss += sum.weighted * share;
  }
  record.gradient_norm = gradient_norm_ * share;
  for (const auto& [part, seconds] : profile_.parts()) record.milliseconds.emplace_back(part, 1e3 * seconds * share);
  *this = MetricsWindow();
  return record;
}

std::string MetricsWindow::state() const {
  Json json;
  json["steps"] = steps_;
  json["gradient_norm"] = gradient_norm_;
  json["terms"] = Json::array();
  for (const MetricsRecord::Term& sum : sums_) json["terms"].push_back(Json::array({sum.name, sum.raw, sum.weighted}));
  json["parts"] = Json::array();
  for (const auto& [part, seconds] : profile_.parts()) json["parts"].push_back(Json::array({part, seconds}));
  return json.dump();
}

void MetricsWindow::restore(const std::string& state) {
  *this = MetricsWindow();
  try {
    const auto json = nlohmann::json::parse(state);
    steps_ = json.at("steps").get<std::int64_t>();
    gradient_norm_ = json.at("gradient_norm").get<double>();
    for (const auto& term : json.at("terms")) sums_.push_back({term.at(0), term.at(1), term.at(2)});
    for (const auto& part : json.at("parts")) profile_.add(part.at(0).get<std::string>(), part.at(1).get<double>());
  } catch (const nlohmann::json::exception& e) {
    fail("the checkpoint's metrics cannot be read ({}); it belongs to another version", e.what());
  }
}

MetricsFile::MetricsFile(const std::filesystem::path& path, std::int64_t step) : file_(keep_until(path, step)) {}

std::vector<MetricsRecord> read_metrics(const std::filesystem::path& path) {
  std::vector<MetricsRecord> records;
  for (const std::string& line : read_lines(path))
    if (auto record = parse(line)) records.push_back(std::move(*record));
  return records;
}

}  // namespace doppel
