#pragma once

#include <memory>
#include <vector>

#include "animate_clips.h"
#include "animate_performer.h"
#include "doppel/actor/draw.h"
#include "doppel/actor/export/film.h"
#include "doppel/data/dataset/dataset.h"

namespace doppel::tools {

/// The cameras to choose from by name, and the capture's images of the empty studio.
struct Studio {
  std::vector<Camera> cameras;
  std::optional<Dataset> dataset;
};

Studio read_studio(const AnimateOptions& options);

/// The path of the camera. `--camera FILE` selects the only camera of the file.
std::unique_ptr<CameraPath> camera_path(const AnimateOptions& options, const Character& character,
                                        const ResultFrames& frames, const Studio& studio);

/// The writer of --format mp4 and png.
std::unique_ptr<SequenceWriter> film_writer(const AnimateOptions& options, const Performer& performer,
                                            const ResultFrames& frames, Profile& profile);

}  // namespace doppel::tools
