#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "doppel/core/shard.h"

namespace doppel {

struct PrepareOptions {
  std::filesystem::path out;  ///< folder for capture.yaml, store/ and report.json
  int mask_size = 350;        ///< side of the cropped masks (thesis A.2)
  int image_size = 512;       ///< side of the cropped images
  double margin = 0.1;        ///< around the bounding box of the mask, as a share of its longer side
  int jpeg_quality = 95;      ///< of the cropped images; 0: lossless PNG
  int threads = 1;            ///< cameras processed in parallel (two at most)
  int chunk_frames = 16;      ///< frames per transaction
  long limit_frames = 0;      ///< prepare only so many frames of each sequence; 0: all
  bool overwrite = false;     ///< delete what was prepared with other settings
  bool force = false;         ///< warn where a failed check would stop
  /// Prepare only the cameras of sequences that belong to this shard. Camera c of sequence s is unit s*C + c. The store
  /// stays incomplete, and capture.yaml and report.json are not written.
  std::optional<Shard> shard{};
  /// Folders of all shards, by their index: take records and detected keypoints from there instead of making them.
  std::vector<std::filesystem::path> shards{};
};

}  // namespace doppel
