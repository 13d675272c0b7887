#include "doppel/train/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "doppel/core/atomic_file.h"
#include "doppel/core/html/embedded_image.h"
#include "doppel/core/html/html_page.h"
#include "doppel/core/html/svg_chart.h"
#include "doppel/core/progress.h"
#include "doppel/core/statistics.h"
#include "doppel/train/metrics.h"

namespace doppel {

namespace {

namespace fs = std::filesystem;

template <typename Get>
ChartSeries curve(const std::string& name, const std::vector<MetricsRecord>& records, Get get) {
  ChartSeries series{name, {}};
  for (const MetricsRecord& record : records) series.points.emplace_back(static_cast<double>(record.step), get(record));
  return series;
}

std::string charts(const std::vector<MetricsRecord>& records, const std::vector<MetricsRecord>& validation) {
  if (records.empty()) return "<p class=\"muted\">No steps have been logged yet.</p>";
  std::string out = "<div class=\"charts\">";
  std::vector<ChartSeries> loss = {curve("sum", records, [](const MetricsRecord& r) { return r.loss; })};
  for (std::size_t i = 0; i < records.front().terms.size(); ++i)
    loss.push_back(curve(records.front().terms[i].name, records,
                         [i](const MetricsRecord& r) { return i < r.terms.size() ? r.terms[i].weighted : 0.0; }));
  out += svg_chart("Loss, weighted terms", loss, true);
  if (!validation.empty())
    out += svg_chart("Loss on validation frames",
                     {curve("validation", validation, [](const MetricsRecord& r) { return r.loss; })}, true);
  for (std::size_t i = 0; i < records.front().terms.size(); ++i)
    out += svg_chart(
        records.front().terms[i].name + ", unweighted",
        {curve("raw", records, [i](const MetricsRecord& r) { return i < r.terms.size() ? r.terms[i].raw : 0.0; })},
        true);
  out += svg_chart("Learning rate", {curve("rate", records, [](const MetricsRecord& r) { return r.learning_rate; })},
                   false);
  out += svg_chart("Gradient norm", {curve("norm", records, [](const MetricsRecord& r) { return r.gradient_norm; })},
                   true);
  return out + "</div>";
}

/// Medians over the logged lines, so that single slow lines (a cold start, a busy machine) have no influence.
std::string step_times(const std::vector<MetricsRecord>& records) {
  std::vector<std::pair<std::string, std::vector<double>>> parts;
  for (const MetricsRecord& record : records)
    for (const auto& [name, time] : record.milliseconds) {
      auto part = std::find_if(parts.begin(), parts.end(), [&name = name](const auto& p) { return p.first == name; });
      if (part == parts.end()) part = parts.insert(parts.end(), {name, {}});
      part->second.push_back(time);
    }
  std::vector<std::pair<std::string, double>> medians;
  double total = 0.0;
  for (auto& [name, times] : parts) {
    medians.emplace_back(name, median(std::move(times)));
    total += medians.back().second;
  }
  if (total <= 0.0) return "";
  std::string out = "<h2>Time of a step</h2><table><tr><th>part</th><th>ms per step</th><th>share</th><th></th></tr>";
  for (const auto& [name, time] : medians)
    out += fmt::format(
        "<tr><td>{}</td><td>{:.2f}</td><td>{:.0f} %</td><td style=\"text-align:left\"><span class=\"bar\" "
        "style=\"width:{:.0f}px\"></span></td></tr>",
        escape_html(name), time, 100.0 * time / total, 260.0 * time / total);
  return out + fmt::format(
                   "<tr><td>sum</td><td>{:.2f}</td><td></td><td></td></tr></table>"
                   "<p>Main memory at the end: {:.0f} MB.</p>",
                   total, records.back().memory_mb);
}

/// The columns of the evaluation: cameras, named in the first method of the first split.
std::string evaluation_table(const nlohmann::json& split) {
  std::vector<std::string> columns = {"AMVIoU"};
  for (const auto& [method, result] : split.items())
    for (const auto& [name, value] : result.items())
      if (value.is_number() && std::find(columns.begin(), columns.end(), name) == columns.end())
        columns.push_back(name);
  std::vector<std::string> cameras;
  for (const auto& [method, result] : split.items())
    if (result.contains("cameras"))
      for (const auto& [camera, iou] : result.at("cameras").items())
        if (std::find(cameras.begin(), cameras.end(), camera) == cameras.end()) cameras.push_back(camera);
  std::string out = "<table><tr><th>surface</th>";
  for (const std::string& name : columns) out += "<th>" + escape_html(name) + "</th>";
  for (const std::string& name : cameras) out += "<th>" + escape_html(name) + "</th>";
  out += "</tr>";
  const auto cell = [](const nlohmann::json& from, const std::string& name) {
    return from.contains(name) && from.at(name).is_number()
               ? fmt::format("<td>{:.4f}</td>", from.at(name).get<double>())
               : std::string("<td></td>");
  };
  for (const auto& [method, result] : split.items()) {
    out += "<tr><td>" + escape_html(method) + "</td>";
    for (const std::string& name : columns) out += cell(result, name);
    for (const std::string& name : cameras) out += cell(result.value("cameras", nlohmann::json::object()), name);
    out += "</tr>";
  }
  return out + "</table>";
}

/// A figure of a method of a split, or nothing.
std::optional<double> figure(const nlohmann::json& split, const std::string& method, const char* name) {
  const auto result = split.find(method);
  if (result == split.end() || !result->is_object() || !result->contains(name) || !result->at(name).is_number())
    return std::nullopt;
  return result->at(name).get<double>();
}

/// The method with the largest value of a figure; empty without one.
std::string best_method(const nlohmann::json& split, const char* name) {
  std::string best;
  for (const auto& [method, result] : split.items())
    if (const auto value = figure(split, method, name); value && (best.empty() || *value > *figure(split, best, name)))
      best = method;
  return best;
}

/// The evaluation in a sentence and in a few figures.
std::string verdict(const std::string& name, const nlohmann::json& split) {
  std::vector<HtmlCard> cards;
  std::string sentence;
  const auto skinned = figure(split, "skinning", "AMVIoU");
  if (const std::string best = best_method(split, "AMVIoU"); !best.empty()) {
    const double value = *figure(split, best, "AMVIoU");
    sentence = fmt::format("On the {} frames, the surface of {} overlaps the masks by {:.1f} % (IoU)", name, best,
                           100.0 * value);
    cards.push_back({"AMVIoU", fmt::format("{:.4f}", value), best});
    if (skinned && best != "skinning") {
      sentence += fmt::format("; skinning alone by {:.1f} %", 100.0 * *skinned);
      cards.push_back({"over skinning", fmt::format("{:+.4f}", value - *skinned), "AMVIoU"});
    }
    sentence += ".";
    if (const auto error = figure(split, best, "vertex_error_mm"))
      cards.push_back({"vertex error", fmt::format("{:.1f} mm", *error), "against the ground truth"});
  }
  if (const std::string best = best_method(split, "PSNR"); !best.empty())
    cards.push_back({"PSNR", fmt::format("{:.1f} dB", *figure(split, best, "PSNR")), best});
  return (sentence.empty() ? "" : html_verdict(sentence)) + html_cards(cards);
}

/// evaluation.json of a run; null without a readable one.
nlohmann::json read_evaluation(const RunFolder& run) {
  if (!fs::exists(run.evaluation())) return nullptr;
  auto json = nlohmann::json::parse(read_file(run.evaluation()), nullptr, false);
  return json.is_object() && json.contains("splits") && json.at("splits").is_object() ? json : nlohmann::json();
}

std::string verdicts(const RunFolder& run) {
  const nlohmann::json json = read_evaluation(run);
  if (json.is_null()) return html_verdict("This run was not evaluated yet.");
  std::string out;
  for (const auto& [name, split] : json.at("splits").items()) out += verdict(name, split);
  return out;
}

std::string evaluation(const RunFolder& run) {
  const nlohmann::json json = read_evaluation(run);
  if (json.is_null()) return "";
  std::string out = "<h2>Evaluation</h2>";
  for (const auto& [name, split] : json.at("splits").items())
    out += "<h3>" + escape_html(name) + "</h3>" + evaluation_table(split);
  if (json.contains("protocol"))
    out += html_details("Protocol", "<pre>" + escape_html(json.at("protocol").dump(2)) + "</pre>");
  return out;
}

std::string images(const RunFolder& run) {
  std::vector<fs::path> files;
  if (fs::is_directory(run.images()))
    for (const auto& entry : fs::directory_iterator(run.images()))
      if (entry.path().extension() == ".jpg") files.push_back(entry.path());
  if (files.empty()) return "";
  std::sort(files.begin(), files.end());
  std::string out = "<h2>Images</h2>";
  for (const fs::path& file : files) {
    const fs::path caption = fs::path(file).replace_extension(".txt");
    const std::string text = fs::exists(caption) ? read_file(caption) : file.stem().string();
    out += embedded_image(read_file(file), "image/jpeg", text);
  }
  return out;
}

std::string summary(const std::vector<MetricsRecord>& records) {
  if (records.empty()) return "";
  const MetricsRecord& last = records.back();
  return fmt::format("<p class=\"muted\">{} steps in {}, loss {:.4g} (first logged: {:.4g})</p>", last.step,
                     format_duration(last.seconds), last.loss, records.front().loss);
}

/// The training part of a run's report: curves, times, images.
std::string training(const RunFolder& run) {
  const auto records = read_metrics(run.metrics());
  return summary(records) + images(run) + "<h2>Curves</h2>" + charts(records, read_metrics(run.validation())) +
         step_times(records);
}

/// Writes a whole page around `body` to the run's report.
void write_page(const RunFolder& run, const std::string& body) {
  const std::string name = fs::absolute(run.path()).lexically_normal().filename().string();
  std::string page = body;
  if (fs::exists(run.config()))
    page += html_details("Configuration", "<pre>" + escape_html(read_file(run.config())) + "</pre>");
  write_atomically(run.report(), html_page(name, page));
}

}  // namespace

void write_report(const RunFolder& run) { write_page(run, verdicts(run) + training(run) + evaluation(run)); }

void write_report(const RunFolder& run, const std::vector<ReportSection>& sections) {
  std::string body = verdicts(run);
  for (const ReportSection& section : sections)
    body += "<h1>" + escape_html(section.title) + "</h1>" + training(section.run);
  write_page(run, body + evaluation(run));
}

}  // namespace doppel
