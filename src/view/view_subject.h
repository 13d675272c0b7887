#pragma once

#include <torch/types.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "doppel/character/character.h"
#include "doppel/character/motion.h"

namespace doppel {

/// One way to make vertices from poses.
struct ViewStage {
  std::string name;                                             ///< skinning, egnet, deltanet or actor
  int past_frames = 0;                                          ///< F of its motion windows
  std::function<torch::Tensor(const torch::Tensor&)> vertices;  ///< [1,F+1,D] -> [1,N,3], world metres
};

/// What `doppel view` shows.
struct ViewSubject {
  Character character;
  Motion motion;  ///< at least one frame
  double frames_per_second = 25.0;
  std::vector<ViewStage> stages;  ///< the best last
};

struct ViewOptions {
  std::filesystem::path motion;     ///< empty: that of the capture, or the rest pose
  std::filesystem::path character;  ///< for an actor file
};

/// Opens a run of egnet or ddc, an exported actor (`.pt`, with options.character), a `.character` file, a capture (a
/// `capture.yaml` or its folder) or a prepared capture.
/// @throws UsageError for another target, and for an actor file without a character; Error as the readers
ViewSubject open_view_subject(const std::filesystem::path& target, const ViewOptions& options = {});

}  // namespace doppel
