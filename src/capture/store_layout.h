#pragma once

#include <string>
#include <vector>

#include "doppel/character/skeleton.h"
#include "doppel/capture/store.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// The folder of the LMDB files inside a prepared capture.
inline constexpr char kStoreFolder[] = "store";

/// What a store says about itself, beside its records.
struct StoreLayout {
  std::string settings;  ///< everything that shapes the records, one fact per line; equal settings, equal records
  int num_dofs = 0;      ///< of the character
  int mask_size = 0, image_size = 0;
  std::vector<Camera> cameras;    ///< without distortion, at the resolution of the images
  std::vector<int> file_index;    ///< [C] position in the calibration file, the {camera} of path patterns
  std::vector<Marker> landmarks;  ///< [M] that keypoints were prepared for, or none
  bool complete = false;
};

/// @throws FileError for a store of another version, or without a description
StoreLayout read_store_layout(const Store& store);
/// The items to put. `complete` is written last, on its own, by `mark_complete`.
void write_store_layout(Store& store, const StoreLayout& layout);
void mark_complete(Store& store);

}  // namespace doppel
