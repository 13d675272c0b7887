#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "doppel/data/batch.h"
#include "doppel/data/dataset.h"

namespace doppel {

struct LoaderOptions {
  Split split = Split::train;
  int batch_size = 1;
  std::vector<std::string> cameras;  ///< names to draw from; empty: all
  std::vector<long> frames;          ///< rows of the sequences' motions to draw from; empty: all of the split
  int cameras_per_sample = 0;        ///< of those, drawn anew for each sample; 0 or more than there are: all
  int past_frames = 2;                    ///< F: earlier frames in the DoF window
  bool images = false;               ///< images too
  int image_size = 0;                ///< their side; 0: as stored, else at most that
  bool keypoints = false;            ///< keypoints and whole cameras too
  int person_size = 0;               ///< side of the images that a network sees of the person; 0: none
  bool augment = true;               ///< vary those images (person_crop.h); off for evaluation
  std::uint64_t seed = 1;
  int workers = 1;   ///< threads that load ahead; 0: load inside next()
  int prefetch = 4;  ///< batches kept ready
  int cache_mb =
      1024;  ///< memory for distance transforms and images kept between epochs; 0: make them anew each time
};

/// Endless stream of batches: all samples of a split in a new seeded order each epoch, one epoch running into the next.
/// What comes depends on the options and the position alone, never on the number of workers, the prefetch depth or
/// the cache. With cameras_per_sample = C < all, each sample takes the first C of a random permutation of the cameras.
class Loader {
 public:
  /// @param dataset must outlive the loader
  /// @throws UsageError for options that make no sense; Error when the split has no samples
  Loader(const Dataset& dataset, LoaderOptions options);
  ~Loader();
  Loader(const Loader&) = delete;
  Loader& operator=(const Loader&) = delete;

  /// The next batch. Errors of the workers surface here.
  Batch next();

  /// Where the stream stands after the last `next()`, as text for a checkpoint.
  std::string state() const;
  /// Goes on where `state` was taken. @throws Error when it belongs to other samples, cameras, batch size or window
  void restore(const std::string& state);

  std::int64_t num_samples() const;  ///< in one epoch
  double epoch() const;              ///< samples given out so far / num_samples

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace doppel
