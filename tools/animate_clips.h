#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "animate_options.h"
#include "animate_rates.h"
#include "doppel/character/character.h"
#include "doppel/character/root_motion.h"
#include "doppel/io/motion_import/read_motion_file.h"

namespace doppel::tools {

/// The frames of the result.
struct ResultFrames {
  double per_second = 25.0;
  double row_step = 1.0;  ///< from one frame to the next, in rows of the motion's file
};

/// A motion of the character, as it is posed and written.
struct Clip {
  std::string name, file;
  bool unseen = false;     ///< --unseen: it is not fitted
  Motion motion, written;  ///< at the rate of reading, and of the result
  FrameSteps steps;
  ResultFrames frames;
  std::optional<RetargetResult> retargeting;
  std::optional<GroundStep> step;  ///< of one repetition of a loop that travels
};

/// The motions of a call, those of --unseen last.
/// @param training_rate frames per second of the actor; nothing: skinning alone
/// @throws UsageError, FileError as read_motion_file
std::vector<Clip> read_clips(const AnimateOptions& options, const Character& character,
                             std::optional<double> training_rate);

/// The animations of a file with several; none for one motion.
std::vector<ClipPart> parts_of(const std::vector<Clip>& clips);

/// For `--json`.
nlohmann::json clips_json(const std::vector<Clip>& clips);
nlohmann::json retargeting_json(const RetargetResult& result);
/// A line with the animations of a file with several; empty for one motion.
std::string clips_text(const std::vector<Clip>& clips);

}  // namespace doppel::tools
