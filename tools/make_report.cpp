#include "make_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "doppel/core/atomic_file.h"
#include "doppel/core/html/embedded_image.h"
#include "doppel/core/html/html_page.h"
#include "doppel/core/html/svg_chart.h"
#include "doppel/core/progress.h"

namespace doppel::tools {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

void add_card(std::vector<HtmlCard>& cards, const Json& values, const std::string& key, const std::string& name,
              const std::string& note, double scale = 1.0) {
  if (values.contains(key) && values[key].is_number())
    cards.push_back({name, fmt::format("{:.3g}", scale * values[key].get<double>()), note});
}

/// The figures of the test frames: the first method is skinning, the last is the whole actor.
void add_evaluation(std::vector<HtmlCard>& cards, const fs::path& file) {
  if (!fs::exists(file)) return;
  const Json evaluation = Json::parse(read_file(file));
  const Json& test = evaluation.at("splits").at("test");
  if (test.empty()) return;
  for (const auto& [method, values] : test.items())
    add_card(cards, values, "AMVIoU", "AMVIoU, " + method, "of the surface and the masks, frames never trained on");
}

std::string image_of(const fs::path& file, const std::string& caption) {
  return fs::exists(file) ? embedded_image(read_file(file), "image/jpeg", caption) : std::string();
}

std::string command_table(const Json& steps) {
  std::string rows = "<table><tr><th>step</th><th>time</th><th>command</th></tr>\n";
  for (const Json& step : steps)
    rows += fmt::format("<tr><td>{}</td><td>{}</td><td><code>{}</code></td></tr>\n",
                        escape_html(step["name"].get<std::string>()), format_duration(step["seconds"].get<double>()),
                        escape_html(step["command"].get<std::string>()));
  return rows + "</table>\n";
}

std::string links(const fs::path& out) {
  std::string items;
  for (const auto& [file, what] : std::vector<std::pair<std::string, std::string>>{
           {"animation/turntable.mp4", "the actor in a motion that it was not trained on"},
           {"actor.glb", "the same motion for Blender, engines and browsers"},
           {"actor.pt", "the actor for LibTorch and PyTorch"},
           {"run/report.html", "curves and overlays of the training"},
           {"doctor.html", "what is known about the recording"}})
    if (fs::exists(out / file))
      items += fmt::format("<li><a href=\"{0}\">{0}</a>: {1}</li>\n", escape_html(file), escape_html(what));
  return items.empty() ? items : "<ul>\n" + items + "</ul>\n";
}

}  // namespace

void write_make_report(const fs::path& out, const std::string& title, const Json& steps, const Json& results) {
  std::vector<HtmlCard> cards;
  if (results.contains("fit")) {
    add_card(cards, results["fit"], "keypoint_error_px", "keypoints of the fit", "pixels");
    add_card(cards, results["fit"], "IoU", "IoU of the fit", "template and masks");
  }
  add_evaluation(cards, out / "evaluation.json");
  std::string body = html_cards(cards) + links(out);
  body += image_of(out / "run" / "gaussians" / "pictures" / "gaussians-test.jpg",
                   "Frames never trained on: film, textured mesh and its error, Gaussians and their error");
  body += image_of(out / "body" / "fit.jpg", "The body that was fitted to the videos");
  std::vector<fs::path> sheets;
  if (fs::is_directory(out / "tracked"))
    for (const auto& entry : fs::directory_iterator(out / "tracked"))
      if (entry.path().extension() == ".jpg") sheets.push_back(entry.path());
  std::sort(sheets.begin(), sheets.end());
  for (const fs::path& sheet : sheets) body += image_of(sheet, "Tracking: " + sheet.stem().string());
  body += html_details("The commands", command_table(steps));
  write_atomically(out / "report.html", html_page(title, body));
}

}  // namespace doppel::tools
