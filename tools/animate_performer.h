#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "animate_options.h"
#include "doppel/actor/draw.h"
#include "doppel/actor/export/animation.h"
#include "doppel/actor/export/film.h"
#include "doppel/actor/export/splat_writer.h"
#include "doppel/actor/trained_actor.h"
#include "doppel/character/character.h"

namespace doppel::tools {

/// The subject of the animation: an exported actor, an actor from its run, or else the skinned template.
struct Performer {
  Character character;
  std::optional<ActorFile> file;
  std::unique_ptr<TrainedActor> trained;

  /// The dynamic texture; empty without one.
  LookFunction texture() const;
  /// Its Gaussians; empty without them.
  SplatFunction splats() const;
  /// What draws the actor in place of its mesh; empty for the renderer `mesh`.
  FieldFunction field(const std::string& renderer) const;
  /// The rate of the training, or nothing: skinning alone has no rate.
  std::optional<double> frames_per_second() const;
};

/// @throws UsageError for options without an actor, or with one that lacks what is to be drawn
Performer make_performer(const AnimateOptions& options);

/// Poses the actor frame by frame, and hands each to the writers.
void perform(const AnimateOptions& options, const Performer& performer, std::span<const MotionPart> parts,
             const std::vector<std::unique_ptr<SequenceWriter>>& writers, Profile& profile);

}  // namespace doppel::tools
