#pragma once

#include <filesystem>

#include "doppel/synth/synth_options.h"
#include "doppel/synth/synth_report.h"
#include "doppel/synth/takes.h"

namespace doppel::synth {

/// Writes a synthetic capture: an ordinary capture folder (docs/synth.md) with the true surfaces beside it. First the
/// takes are simulated, then each camera films each sequence; `options.threads` takes or cameras are worked on at a
/// time.
///
/// The files are written into the folder `.NAME.making` beside `folder`, which is renamed at the end. A run that was
/// stopped or killed leaves it, and the same command goes on with the takes and cameras that are missing. With
/// `options.shard` the files of that shard are written into `folder` itself, which is then no capture yet; with
/// `options.shards` they are copied from these folders.
///
/// The same options give the same content for any number of threads.
/// @return nothing when the user has stopped the work; without figures of the surface for a shard
/// @throws UsageError for options out of range, or when `folder` is not empty and `force` is not set
/// @throws Error when a file can't be written
std::optional<SynthReport> write_synthetic_capture(const std::filesystem::path& folder, const SynthOptions& options);

}  // namespace doppel::synth
