#pragma once

#include <filesystem>
#include <string>

#include "support/comparable_files.h"

namespace doppel::faults {

using support::Files;

/// The files of a folder as two runs of one command have them alike: stores by their records, checkpoints by their
/// tensors, logs without times. Empty for a missing folder. A file that cannot be read is `damaged: ...`.
Files state_of(const std::filesystem::path& folder);

/// Whether the content belongs to work that is not finished: a store with a part of its records, a log with its first
/// lines, the name of a checkpoint.
bool is_part_of(const std::string& name, const std::string& content, const std::string& whole);

/// The first difference between two states, as a sentence; empty when they are equal.
std::string difference(const Files& found, const Files& expected);

/// Whether a temporary file, or any hidden one.
bool is_leftover(const std::string& name);

}  // namespace doppel::faults
