#pragma once

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <string_view>

#include "doppel/core/error.h"
#include "doppel/core/excerpt.h"
#include "doppel/core/text_reader.h"

/// Helpers of this module's readers and writers. Numbers are written with the shortest digits that read back as the
/// same double.
namespace doppel {

/// Skeletool files hold millimetres.
constexpr double kMetresPerMillimetre = 0.001;

/// @throws Error for NaN and infinity, which no reader accepts
inline std::string exact_text(double value) {
  if (!std::isfinite(value)) fail("cannot write the number {} to a file; only finite numbers can be read back", value);
  return fmt::format("{}", value);
}

/// Millimetres whose product with 0.001, as the reader computes it, is exactly `metres`, if such a double exists. It
/// exists for every length that was read from a file.
inline std::string millimetre_text(double metres) {
  const double nearest = metres / kMetresPerMillimetre;
  for (const double candidate : {nearest, std::nextafter(nearest, -HUGE_VAL), std::nextafter(nearest, HUGE_VAL)})
    if (candidate * kMetresPerMillimetre == metres) return exact_text(candidate);
  return exact_text(nearest);
}

/// Reads the first line, which must be `header`. @param what the kind of file, for messages
/// @param words that the headers of all versions hold: with them, the message names another version, and not another
///   kind of file
/// @throws FileError at the line
inline void require_version(TextReader& reader, std::string_view header, const char* what, std::string_view words) {
  reader.require_line("the header");
  if (reader.line() == header) return;
  if (reader.line().find(words) != std::string_view::npos)
    reader.fail_here("unsupported version '{}' of a {} file; only '{}' is read", excerpt(reader.line()), what, header);
  reader.fail_here("not a {} file: the first line must be '{}'", what, header);
}

}  // namespace doppel
