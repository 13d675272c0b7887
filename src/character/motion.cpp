#include "doppel/character/motion.h"

#include <climits>

#include "doppel/character/file_text.h"
#include "doppel/core/atomic_file.h"
#include "doppel/core/log.h"
#include "doppel/core/text_reader.h"

namespace doppel {

namespace {

constexpr char kMotionHeader[] = "Skeletool Motion File V1.0";
constexpr char kOldHeader[] = "Skeletool Motion File V0.1";

/// Whether values after the translation are stored with the opposite sign.
bool read_motion_header(TextReader& reader) {
  reader.require_line("the header");
  if (reader.line() == kMotionHeader) return false;
  if (reader.line() == kOldHeader) return true;
  if (reader.line().substr(0, 21) == "Skeletool Motion File")
    reader.fail_here("unsupported version '{}' of a motion file; V1.0 and V0.1 are read", excerpt(reader.line()));
  reader.fail_here("not a motion file: the first line must be '{}'", kMotionHeader);
}

std::vector<double> read_row(const TextReader& reader, int num_dofs, bool negated) {
  const int found = static_cast<int>(reader.tokens().size()) - 1;
  if (found < num_dofs)
    reader.fail_here(
        "the row has {} values after the frame id, but the skeleton has {} DoFs; motion and skeleton do not "
        "belong together, or the file is truncated",
        found, num_dofs);
  std::vector<double> row(num_dofs);
  for (int d = 0; d < num_dofs; ++d) {
    const double value = reader.length(d + 1, "DoF value", 1.0);  // or radians, for which the same holds
    row[d] = negated && d >= 3 ? -value : value;
  }
  return row;
}

}  // namespace

Motion read_motion(const std::filesystem::path& path, int num_dofs) {
  TextReader reader(path, "a motion file");
  const bool negated = read_motion_header(reader);
  Motion motion;
  long irregular = 0, surplus = 0;
  while (reader.next_line()) {
    const long id = reader.integer(0, "frame id", 0, INT_MAX);
    if (!motion.ids.empty() && id != motion.ids.back() + 1) ++irregular;
    if (static_cast<int>(reader.tokens().size()) - 1 > num_dofs) ++surplus;
    motion.frames.push_back(read_row(reader, num_dofs, negated));
    motion.ids.push_back(id);
  }
  if (motion.frames.empty())
    fail_at({path.string(), 0}, "the motion holds no frames; each line after the header is one");
  if (irregular > 0)
    log::warn("{}: frame ids skip or repeat at {} rows; rows are counted in file order", path.string(), irregular);
  if (surplus > 0)
    log::warn("{}: {} rows have more than {} values; the surplus is ignored", path.string(), surplus, num_dofs);
  return motion;
}

void write_motion(const std::filesystem::path& path, const Motion& motion, bool exact) {
  if (!motion.ids.empty() && motion.ids.size() != motion.frames.size())
    fail("a motion of {} frames has {} frame ids; there must be one each, or none", motion.frames.size(),
         motion.ids.size());
  std::string text = std::string(kMotionHeader) + "\n";
  for (std::size_t f = 0; f < motion.frames.size(); ++f) {
    text += std::to_string(motion.ids.empty() ? static_cast<long>(f) : motion.ids[f]);
    for (const double value : motion.frames[f])
      text += " " + (exact || !std::isfinite(value) ? exact_text(value) : fmt::format("{:.9g}", value));
    text += "\n";
  }
  write_atomically(path, text);
}

}  // namespace doppel
