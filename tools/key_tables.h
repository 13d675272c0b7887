#pragma once

#include <string>
#include <vector>

namespace doppel::tools {

/// The names of the tables of keys: `livecap`, `multiview`, `adapt`, `stages` (keys that all stages of training share)
/// and the stages.
std::vector<std::string> key_table_names();
/// The keys that a configuration may hold, a table in Markdown. The table of a stage leaves out the keys of `stages`.
/// @throws UsageError for an unknown name; the message suggests the nearest
std::string key_table_of(const std::string& name);

}  // namespace doppel::tools
