#pragma once

#include "doppel/data/capture/capture.h"
#include "doppel/data/capture/capture_cameras.h"

namespace doppel {

/// Shares of a training take's rows that are kept back at its end.
struct HoldOutOptions {
  double validation = 0.1;
  double test = 0.2;
};

/// Keeps back the end of every training take: first the rows of NAME_validation, then those of NAME_test. A split that
/// the capture has already is not made again. Takes of fewer than 20 rows stay whole.
/// @param filmed the cameras of the capture
/// @return the capture with the new sequences behind their take
/// @throws UsageError when the shares leave nothing to train on; Error and FileError as rows_of_sequence
Capture hold_out(const Capture& capture, const CaptureCameras& filmed, const HoldOutOptions& options = {});

}  // namespace doppel
