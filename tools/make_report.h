#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace doppel::tools {

/// Writes `OUT/report.html`: how good the actor is, images of the body and of the tracking, and the commands.
/// @param steps of MakeChain @param results what each step printed, by its name
void write_make_report(const std::filesystem::path& out, const std::string& title, const nlohmann::ordered_json& steps,
                       const nlohmann::ordered_json& results);

}  // namespace doppel::tools
