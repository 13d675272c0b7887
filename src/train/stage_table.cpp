#include "doppel/train/stage_table.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "doppel/core/error.h"

namespace doppel {

const std::vector<StageEntry>& stage_table() {
  static const std::vector<StageEntry> table{egnet_entry(),   lighting_entry(),  delta_net_entry(),
                                             tex_net_entry(), gaussians_entry(), hybrid_entry(),
                                             nerf_entry(),    pose_net_entry(),  def_net_entry()};
  return table;
}

const StageEntry& stage_entry(const std::string& name) {
  std::vector<std::string> names;
  for (const StageEntry& entry : stage_table()) {
    if (entry.name == name) return entry;
    names.push_back(entry.name);
  }
  fail<UsageError>("there is no stage \"{}\"; the stages are {}{}", name, fmt::join(names, ", "),
                   nearest_word_hint(name, names));
}

std::vector<std::string> stage_words() {
  std::vector<std::string> alone, chains;
  for (const StageEntry& entry : stage_table())
    for (const std::string& word : entry.chains) {
      std::vector<std::string>& words = word == entry.name ? alone : chains;
      if (std::find(words.begin(), words.end(), word) == words.end()) words.push_back(word);
    }
  alone.insert(alone.end(), chains.begin(), chains.end());
  return alone;
}

}  // namespace doppel
