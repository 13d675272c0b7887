#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "doppel/data/dataset/batch.h"
#include "doppel/data/dataset/dataset.h"
#include "doppel/distributed/batch_share.h"

namespace doppel {

struct LoaderOptions {
  Split split = Split::train;
  int batch_size = 1;
  std::vector<std::string> cameras;  ///< names to draw from; empty: all
  std::vector<long> frames;          ///< motion rows to draw from; empty: all of the split
  int cameras_per_sample = 0;        ///< drawn for each sample; 0, or more than there are: all
  int past_frames = 2;               ///< F: past frames in the motion window
  bool images = false;               ///< also load images
  int image_size = 0;                ///< side of the images; 0: as stored, otherwise at most as stored
  bool keypoints = false;            ///< also load keypoints and the cameras of the whole images
  int person_size = 0;               ///< side of the network's image of the person; 0: none
  bool augment = true;               ///< vary this image at random (person_crop.h); off for evaluation
  std::uint64_t seed = 1;
  int workers = 1;      ///< threads that load batches in advance; 0: load inside next()
  int prefetch = 4;     ///< batches kept ready
  int cache_mb = 1024;  ///< memory for distance fields and images kept between epochs; 0: no cache
};

/// What a batch of a loader contains.
BatchOptions batch_options(const LoaderOptions& options);

/// Endless stream of batches: all samples of a split, in a new seeded order each epoch. A batch may contain the end of
/// one epoch and the start of the next. The stream depends only on the options and the position, not on the number of
/// workers, the prefetch depth or the cache. With cameras_per_sample = C < all, each sample takes the first C of a
/// random permutation of the cameras.
class Loader {
 public:
  /// @param dataset must outlive the loader
  /// @throws UsageError for invalid options; Error when the split has no samples
  Loader(const Dataset& dataset, LoaderOptions options);
  ~Loader();
  Loader(const Loader&) = delete;
  Loader& operator=(const Loader&) = delete;

  /// The next batch. Throws the errors of the workers.
  Batch next();
  /// From now on, a batch has only this rank's rows of it. Position and state remain those of whole batches.
  /// @throws UsageError when there are more ranks than rows
  void take_share(int rank, int world);
  BatchShare share() const;

  /// The position of the stream after the last `next()`, as text for a checkpoint.
  std::string state() const;
  /// Continues at the position of `state`.
  /// @throws Error when the state belongs to other samples, cameras, batch size or past frames
  void restore(const std::string& state);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace doppel
