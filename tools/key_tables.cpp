#include "key_tables.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/core/options.h"
#include "doppel/detect/networks/network_config.h"
#include "doppel/track/fit/track_config.h"
#include "doppel/track/livecap/livecap_config.h"
#include "doppel/train/adapt.h"
#include "doppel/train/def_net_stage.h"
#include "doppel/train/delta_net_stage.h"
#include "doppel/train/egnet_config.h"
#include "doppel/train/gaussian_stage.h"
#include "doppel/train/hybrid_stage.h"
#include "doppel/train/lighting_stage.h"
#include "doppel/train/nerf_stage.h"
#include "doppel/train/pose_net_stage.h"
#include "doppel/train/tex_net_stage.h"

namespace doppel::tools {

namespace {

using Rows = std::vector<KeyRow>;

bool contains(const Rows& rows, const KeyRow& row) {
  return std::any_of(rows.begin(), rows.end(), [&](const KeyRow& other) {
    return row.key == other.key && row.value == other.value && row.allowed == other.allowed &&
           row.meaning == other.meaning;
  });
}

/// The keys of the top level, and those that are the same for a stage on silhouettes and one on images.
Rows shared_rows() {
  Rows rows = key_rows<RunSubject>();
  const Rows others = key_rows<LightingRunConfig>();
  for (const KeyRow& row : key_rows<EgNetRunConfig>())
    if (contains(others, row)) rows.push_back(row);
  return rows;
}

template <typename Config>
Rows stage_rows() {
  const Rows shared = shared_rows();
  Rows rows;
  for (const KeyRow& row : key_rows<Config>())
    if (!contains(shared, row)) rows.push_back(row);
  return rows;
}

struct NamedRows {
  const char* name;
  Rows (*rows)();
};

constexpr NamedRows kTables[] = {{"livecap", [] { return key_rows<LivecapConfig>(); }},
                                 {"multiview", [] { return key_rows<TrackConfig>(); }},
                                 {"adapt", [] { return key_rows<AdaptConfig>(); }},
                                 {"stages", shared_rows},
                                 {"egnet", stage_rows<EgNetRunConfig>},
                                 {"lighting", stage_rows<LightingRunConfig>},
                                 {"deltanet", stage_rows<DeltaNetRunConfig>},
                                 {"texnet", stage_rows<TexNetRunConfig>},
                                 {"gaussians", stage_rows<GaussiansRunConfig>},
                                 {"posenet", stage_rows<PoseNetRunConfig>},
                                 {"defnet", stage_rows<DefNetRunConfig>},
                                 {"radiance", stage_rows<HybridRunConfig>},
                                 {"nerf", stage_rows<NerfRunConfig>},
                                 {"network", [] { return key_rows<NetworkKeys>(); }},
                                 {"crop", [] { return key_rows<CropOptions>(); }}};

}  // namespace

std::vector<std::string> key_table_names() {
  std::vector<std::string> names;
  for (const NamedRows& table : kTables) names.emplace_back(table.name);
  return names;
}

std::string key_table_of(const std::string& name) {
  for (const NamedRows& table : kTables)
    if (name == table.name) return key_table(table.rows());
  const std::vector<std::string> names = key_table_names();
  fail<UsageError>("--keys: there is no table '{}'; there are {}{}", name, fmt::join(names, ", "),
                   nearest_word_hint(name, names));
}

}  // namespace doppel::tools
