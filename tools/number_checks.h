#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <string>

namespace doppel::tools {

/// A check of numbers on the command line whose message names the bound alone: the messages of CLI11 print the largest
/// number of the type, with 309 digits. CLI11 itself refuses what is no number.
/// @param complaint "is not ..." @param type for the help
inline CLI::Validator finite_number(bool (*is_allowed)(double), const std::string& complaint, const std::string& type) {
  return CLI::Validator(
      [=](const std::string& text) {
        double number = 0.0;
        if (!CLI::detail::lexical_cast(text, number)) return std::string();
        return std::isfinite(number) && is_allowed(number) ? std::string() : fmt::format("{} {}", text, complaint);
      },
      type);
}
inline CLI::Validator above_zero() {
  return finite_number([](double number) { return number > 0.0; }, "is not a number above 0", "POSITIVE");
}
inline CLI::Validator not_negative() {
  return finite_number([](double number) { return number >= 0.0; }, "is not a number from 0 on", "NONNEGATIVE");
}

/// Refuses NaN and infinity for all options of a command that are no whole numbers: they pass every range of CLI11.
inline void refuse_not_finite(CLI::App& app) {
  for (CLI::Option* option : app.get_options())
    if (option->get_type_name().rfind("FLOAT", 0) == 0)
      option->check(finite_number([](double) { return true; }, "is not a finite number", ""));
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) refuse_not_finite(*command);
}

}  // namespace doppel::tools
