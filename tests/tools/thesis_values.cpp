#include "tools/thesis_values.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>

#include "doppel/core/text_reader.h"
#include "doppel/track/livecap/livecap_config.h"
#include "doppel/train/adapt.h"
#include "doppel/train/stage_table.h"

namespace doppel::deviations {
namespace {

std::string text(const YAML::Node& node) {
  if (!node.IsDefined() || node.IsNull()) return "";
  if (node.IsScalar()) return node.Scalar();
  std::string items;
  for (const YAML::Node& item : node) items += (items.empty() ? "" : ", ") + item.Scalar();
  return "[" + items + "]";
}

/// The keys of one preset, or of the section `common`.
std::map<std::string, KeyEntry> read_keys(const YAML::Node& node) {
  std::map<std::string, KeyEntry> keys;
  for (const auto& group : node["printed"])
    for (const auto& entry : group.second) {
      const std::string value = text(entry.second);
      keys[entry.first.Scalar()] = {KeyEntry::Kind::printed, value, value, group.first.Scalar(), ""};
    }
  for (const auto& entry : node["deviates"]) {
    const YAML::Node& v = entry.second;
    keys[entry.first.Scalar()] = {KeyEntry::Kind::deviates, text(v["ours"]), text(v["thesis"]), text(v["at"]),
                                  text(v["why"])};
  }
  for (const auto& entry : node["silent"])
    keys[entry.first.Scalar()] = {KeyEntry::Kind::silent, text(entry.second), "", "", ""};
  for (const auto& entry : node["off"])
    keys[entry.first.Scalar()] = {KeyEntry::Kind::off, text(entry.second), "", "", ""};
  return keys;
}

PresetValues read_preset(const std::string& name, const YAML::Node& node,
                         const std::map<std::string, KeyEntry>& common) {
  PresetValues preset{name, read_keys(node), common, {}};
  for (const YAML::Node& v : node["others"])
    preset.others.push_back({text(v["thesis"]), text(v["ours"]), text(v["at"]), text(v["why"])});
  return preset;
}

std::string cell(const std::string& text) { return text.empty() ? " " : " " + text + " "; }

}  // namespace

const KeyEntry* PresetValues::find(const std::string& key) const {
  const auto exact = keys.find(key);
  if (exact != keys.end()) return &exact->second;
  const KeyEntry* found = nullptr;
  std::size_t longest = 0;
  for (const auto& [ending, entry] : common) {
    if (ending.size() <= longest || key.size() < ending.size()) continue;
    const std::size_t start = key.size() - ending.size();
    if (key.compare(start, ending.size(), ending) != 0 || (start > 0 && key[start - 1] != '.')) continue;
    found = &entry;
    longest = ending.size();
  }
  return found;
}

ThesisValues ThesisValues::load(const std::filesystem::path& path) {
  const YAML::Node root = YAML::LoadFile(path.string());
  ThesisValues values;
  for (const YAML::Node& ending : root["machine"]) values.machine.push_back(ending.Scalar());
  for (const auto& preset : root["presets"])
    values.presets.push_back(read_preset(preset.first.Scalar(), preset.second, read_keys(root["common"])));
  return values;
}

bool same_value(const std::string& a, const std::string& b) {
  const auto x = parse_number(a), y = parse_number(b);
  return x && y ? *x == *y : a == b;
}

std::map<std::string, std::string> preset_values(const std::string& name, const std::filesystem::path& file) {
  const ConfigDocument document =
      ConfigDocument::load(file, name == "livecap" || name == "adapt" ? std::vector<std::string>{}
                                                                      : std::vector<std::string>{"capture=none"});
  if (name == "livecap") read_livecap_config(document);
  if (name == "adapt") AdaptConfig::read(document);
  if (name == "livecap" || name == "adapt") return document.values();
  std::map<std::string, std::string> values;
  for (const StageEntry& entry : stage_table()) {
    if (!document.root().has(entry.name)) continue;
    const ConfigDocument stage = document.part(entry.name, {"capture", "seed", "character"});
    entry.check_options(stage);
    for (const auto& [key, value] : stage.values()) values[entry.name + "." + key] = value;
  }
  return values;
}

namespace {

/// "`key` value, `key` value" of the keys of one kind.
std::string listed(const std::map<std::string, KeyEntry>& keys, KeyEntry::Kind kind) {
  std::string list;
  for (const auto& [key, entry] : keys)
    if (entry.kind == kind) list += fmt::format("| `{}` |{}|\n", key, cell(entry.ours));
  return list.empty() ? "" : "| key | value |\n|---|---|\n" + list;
}

std::string listed_parts(const std::map<std::string, KeyEntry>& keys) {
  std::string page;
  const std::string silent = listed(keys, KeyEntry::Kind::silent), off = listed(keys, KeyEntry::Kind::off);
  if (!silent.empty()) page += "\nNot stated in the thesis:\n\n" + silent;
  if (!off.empty()) page += "\nNot in the thesis, and switched off:\n\n" + off;
  return page;
}

std::string deviating_rows(const PresetValues& preset) {
  std::string rows;
  for (const auto& [key, entry] : preset.keys)
    if (entry.kind == KeyEntry::Kind::deviates)
      rows += fmt::format("| `{}` |{}|{}|{}|{}|\n", key, cell(entry.thesis), cell(entry.ours), cell(entry.section),
                          cell(entry.why));
  for (const OtherDeviation& other : preset.others)
    rows +=
        fmt::format("| |{}|{}|{}|{}|\n", cell(other.thesis), cell(other.ours), cell(other.section), cell(other.why));
  return rows;
}

std::string preset_part(const PresetValues& preset) {
  const auto printed = std::count_if(preset.keys.begin(), preset.keys.end(),
                                     [](const auto& item) { return item.second.kind == KeyEntry::Kind::printed; });
  const std::string rows = deviating_rows(preset);
  std::string page =
      fmt::format("\n## {0}\n\n`configs/paper/{0}.yaml`: {1} values are as printed.", preset.name, printed);
  page += rows.empty() ? " Nothing deviates.\n"
                       : "\n\n| key | thesis | ours | section | why |\n|---|---|---|---|---|\n" + rows;
  return page + listed_parts(preset.keys);
}

}  // namespace

std::string deviations_page(const ThesisValues& values) {
  std::string page =
      "# Deviations from the thesis\n\n"
      "The presets in `configs/paper` do what the thesis prints. This page lists, for each preset, what differs from "
      "the\n"
      "thesis and why, and the values that the thesis does not state. `scripts/deviations.sh` generates it from the "
      "presets\n"
      "and from [thesis_values.yaml](thesis_values.yaml). A test fails when a key is missing there, when a default "
      "changes,\n"
      "or when this page is not up to date. Keys that do not change results (threads, checkpoints, log lines) are left "
      "out.\n";
  for (const PresetValues& preset : values.presets) page += preset_part(preset);
  if (!values.presets.empty())
    page += "\n## All presets\n\nKeys that end in these names, where no preset above names them." + std::string("\n") +
            listed_parts(values.presets.front().common);
  return page;
}

}  // namespace doppel::deviations
