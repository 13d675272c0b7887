#pragma once

#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/capture_cameras.h"

namespace doppel {

inline constexpr long kMinDividedRows = 20;  ///< shorter sequences stay whole

/// Shares of a training sequence's rows that are kept back at its end.
struct HoldOutOptions {
  double validation = 0.1;
  double test = 0.2;
};

/// Keeps back the end of every training sequence: first the rows of NAME_validation, then those of NAME_test. A split
/// that the capture has already is not made again. Sequences of fewer than kMinDividedRows rows stay whole.
/// @param filmed the cameras of the capture
/// @return the capture with the new sequences behind theirs
/// @throws UsageError when the shares leave nothing to train on; Error and FileError as rows_of_sequence
Capture hold_out(const Capture& capture, const CaptureCameras& filmed, const HoldOutOptions& options = {});

}  // namespace doppel
