#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <string>

namespace doppel::tools {

/// Checks of numbers on the command line whose messages name the bound alone: those of CLI11 print the largest number
/// of their type, with 309 digits.
inline CLI::Validator above_zero() {
  return CLI::Validator(
      [](const std::string& text) {
        double number = 0.0;
        const bool good = CLI::detail::lexical_cast(text, number) && number > 0.0 && std::isfinite(number);
        return good ? std::string() : fmt::format("{} is not a number above 0", text);
      },
      "POSITIVE");
}
inline CLI::Validator not_negative() {
  return CLI::Validator(
      [](const std::string& text) {
        double number = 0.0;
        const bool good = CLI::detail::lexical_cast(text, number) && number >= 0.0 && std::isfinite(number);
        return good ? std::string() : fmt::format("{} is not a number from 0 on", text);
      },
      "NONNEGATIVE");
}

/// Refuses NaN and infinity for all options of a command that are no whole numbers: they pass every range.
inline void refuse_not_finite(CLI::App& app) {
  for (CLI::Option* option : app.get_options())
    if (option->get_type_name().rfind("FLOAT", 0) == 0)
      option->check(CLI::Validator(
          [](const std::string& text) {
            double number = 0.0;
            const bool finite = !CLI::detail::lexical_cast(text, number) || std::isfinite(number);
            return finite ? std::string() : fmt::format("{} is not a finite number", text);
          },
          ""));
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) refuse_not_finite(*command);
}

}  // namespace doppel::tools
