#include "doppel/data/capture/hold_out.h"

#include <algorithm>
#include <cmath>

#include "doppel/core/error.h"
#include "doppel/data/capture/filmed_sequence.h"

namespace doppel {

namespace {

bool has_split(const Capture& capture, Split split) {
  return std::any_of(capture.sequences.begin(), capture.sequences.end(),
                     [split](const SequenceEntry& sequence) { return sequence.split == split; });
}

/// The rows [first, last] of a sequence as one of its own.
SequenceEntry part_of(const SequenceEntry& sequence, Split split, RowRange rows) {
  SequenceEntry part = sequence;
  if (split != Split::train) part.name = sequence.name + "_" + to_string(split);
  part.split = split;
  part.first_frame = rows.first;
  part.last_frame = rows.last;
  std::erase_if(part.cuts, [&](long row) { return row <= rows.first || row > rows.last; });
  return part;
}

}  // namespace

Capture hold_out(const Capture& capture, const CaptureCameras& filmed, const HoldOutOptions& options) {
  const double validation = has_split(capture, Split::validation) ? 0.0 : options.validation;
  const double test = has_split(capture, Split::test) ? 0.0 : options.test;
  if (validation < 0.0 || test < 0.0 || validation + test >= 1.0)
    fail<UsageError>(
        "keeping back {} of the rows for validation and {} for tests: found {} in total, allowed is 0 to "
        "less than 1",
        validation, test, validation + test);
  Capture divided = capture;
  divided.sequences.clear();
  for (const SequenceEntry& sequence : capture.sequences) {
    const RowRange rows = sequence.split == Split::train ? rows_of_sequence(capture, sequence, filmed) : RowRange();
    const long count = rows.last - rows.first + 1;
    if (sequence.split != Split::train || count < kMinDividedRows || validation + test == 0.0) {
      divided.sequences.push_back(sequence);
      continue;
    }
    const auto share = [count](double part) { return std::lround(part * static_cast<double>(count)); };
    const long test_begin = rows.last + 1 - share(test), validation_begin = test_begin - share(validation);
    divided.sequences.push_back(part_of(sequence, Split::train, {rows.first, validation_begin - 1}));
    if (validation_begin < test_begin)
      divided.sequences.push_back(part_of(sequence, Split::validation, {validation_begin, test_begin - 1}));
    if (test_begin <= rows.last) divided.sequences.push_back(part_of(sequence, Split::test, {test_begin, rows.last}));
  }
  return divided;
}

}  // namespace doppel
