#pragma once

#include <spdlog/spdlog.h>

namespace doppel {

/// Sends log lines to stderr as `HH:MM:SS level message`, so that stdout carries results only.
/// `level` is one of trace, debug, info, warn, error, off.
/// @throws UsageError for another word
void setup_logging(const std::string& level = "info");

namespace log {
using spdlog::debug;
using spdlog::error;
using spdlog::info;
using spdlog::warn;
}  // namespace log

}  // namespace doppel
