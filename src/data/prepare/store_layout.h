#pragma once

#include <string>
#include <vector>

#include "doppel/character/skeleton.h"
#include "doppel/data/prepare/store.h"
#include "doppel/geometry/camera.h"

namespace doppel {

/// The folder of the LMDB files inside a prepared capture.
inline constexpr char kStoreFolder[] = "store";

/// The description of a store, saved beside its records.
struct StoreLayout {
  std::string settings;  ///< all settings that affect the records, one per line; equal settings give equal records
  int num_dofs = 0;      ///< of the character
  int mask_size = 0, image_size = 0;
  std::vector<PinholeCamera> cameras;  ///< at the resolution of the images
  std::vector<int> file_index;         ///< [C] position in the calibration file, the {camera} of path patterns
  std::vector<Marker> landmarks;       ///< [M] of the prepared keypoints, or none
  std::string skeleton;                ///< fingerprint_of the character; empty in stores of earlier versions
  bool complete = false;
};

/// Changes with the names, types and parents of the joints and with the names and drives of the DoFs. Lengths may
/// change: a character that was fitted to a person still fits a store.
std::string fingerprint_of(const Skeleton& skeleton);

/// @throws FileError for a store of another version, without a description, or with impossible sizes
StoreLayout read_store_layout(const Store& store);
/// Writes the description without `complete`. `mark_complete` writes that item last.
void write_store_layout(Store& store, const StoreLayout& layout);
void mark_complete(Store& store);

}  // namespace doppel
