#pragma once

#include <torch/types.h>

#include <filesystem>
#include <opencv2/core.hpp>

#include "doppel/data/capture/video_file.h"
#include "doppel/track/track_view.h"

namespace doppel {

/// A film of tracked surfaces, drawn by `TrackView`.
class TrackFilm {
 public:
  TrackFilm(const std::filesystem::path& path, const PinholeCamera& camera, const TriangleMesh& mesh,
            double frames_per_second, const TrackViewOptions& options = {})
      : view_(camera, mesh, options), video_(path, view_.size(), frames_per_second) {}

  /// @param image and @param vertices as for `TrackView::draw`
  void add(const cv::Mat& image, const torch::Tensor& vertices) { video_.write(view_.draw(image, vertices)); }
  void close() { video_.close(); }

 private:
  TrackView view_;
  VideoFile video_;
};

}  // namespace doppel
