#pragma once

#include <fmt/format.h>

#include <string>
#include <utility>

namespace doppel {

/// Sends log lines to stderr as `HH:MM:SS level message`, so that stdout carries results only.
/// `level` is one of trace, debug, info, warn, error, off.
/// @throws UsageError for another word
void setup_logging(const std::string& level = "info");

/// `log::info("{} frames of {}", read, all)` and the same for the other levels. The library that writes the lines is
/// included by log.cpp only: its headers cost a second in each source.
namespace log {

enum class Level { debug, info, warn, error };
void write(Level level, const std::string& message);

template <typename... Args>
void debug(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::debug, fmt::format(format, std::forward<Args>(args)...));
}
template <typename... Args>
void info(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::info, fmt::format(format, std::forward<Args>(args)...));
}
template <typename... Args>
void warn(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::warn, fmt::format(format, std::forward<Args>(args)...));
}
template <typename... Args>
void error(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::error, fmt::format(format, std::forward<Args>(args)...));
}

}  // namespace log

}  // namespace doppel
