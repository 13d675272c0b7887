#pragma once

#include <torch/types.h>

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "doppel/data/dataset/dataset.h"

namespace doppel {

/// Scans of frames: a mesh per frame, of any topology, in the world of the cameras (Table 6.6). The scan of a frame is
/// `FOLDER/<sequence>/<frame>.obj`. A sequence without such a folder has its scans in `FOLDER/<frame>.obj`. `<frame>`
/// is the row of the motion; it may begin with zeros. Frames may lack a scan.
class Scans {
 public:
  /// Finds the scans of these samples. The files are read when they are needed.
  /// @param metres_per_unit of the files: 0.001 or 1
  /// @throws UsageError when the folder is missing; when no sample has a scan; when two files have the number of one
  /// frame; when samples of two sequences have their scans in `FOLDER` itself
  Scans(const Dataset& dataset, const std::vector<SampleId>& samples, const std::filesystem::path& folder,
        double metres_per_unit);

  /// The mean distance of all vertices of a surface to the scan, in this direction only, metres. Nothing when the frame
  /// has no scan.
  /// @param vertices float32 [N,3] world metres
  /// @throws FileError when the file is no mesh (read_obj)
  std::optional<double> mean_distance(const SampleId& sample, const torch::Tensor& vertices) const;

  /// The number of samples with a scan.
  std::size_t size() const { return files_.size(); }

 private:
  std::map<std::pair<int, long>, std::filesystem::path> files_;  ///< by sequence and frame
  double metres_per_unit_;
};

}  // namespace doppel
