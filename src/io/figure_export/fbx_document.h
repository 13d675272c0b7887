#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "doppel/io/figure_export/fbx_records.h"

namespace doppel {

/// Lengths of the file are centimetres, the unit of FBX itself: programs that do not read `UnitScaleFactor` have the
/// right size too.
inline constexpr double kFbxUnitsPerMetre = 100.0;

/// A property of an object, a record of its `Properties70`. @param flags `A`: a curve may change it; `` otherwise
FbxNode property70(const std::string& name, const std::string& type, const std::string& label, const std::string& flags,
                   std::vector<FbxNode::Value> values);
FbxNode properties70(std::vector<FbxNode> properties);

/// What an FBX file says of its time.
struct FbxClock {
  double frames_per_second = 25.0;
  int last_frame = 0;

  /// Time in units of the format. @param frame from 0, not always whole
  std::int64_t ticks(double frame) const;
  /// The format's number for this rate (TimeMode); that of a rate of one's own (CustomFrameRate) where it has none.
  int mode() const;
  bool own_rate() const;
};

/// The objects of an FBX file and their connections. Ids are counted up, and times of creation are fixed, so the same
/// figure gives the same bytes.
class FbxDocument {
 public:
  /// Adds an object and returns its id. @param record its record (`Model`), @param kind the part after its name, often
  ///   the same, @param type its third value (`LimbNode`), which may be empty
  std::int64_t add(const std::string& record, const std::string& name, const std::string& kind, const std::string& type,
                   std::vector<FbxNode> children);
  /// Connects an object below another one, 0 for the scene.
  void connect(std::int64_t lower, std::int64_t upper);
  /// Connects an object to a property of another one.
  void connect(std::int64_t lower, std::int64_t upper, const std::string& property);

  /// The records of the file. @param animation name of the animation stack that plays, or empty
  FbxNode root(const FbxClock& clock, const std::string& animation) const;

 private:
  std::vector<FbxNode> objects_, connections_;
};

}  // namespace doppel
