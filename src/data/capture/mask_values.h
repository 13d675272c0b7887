#pragma once

#include <array>
#include <optional>
#include <string>

namespace doppel {

/// How often each value occurs in some masks of one camera. It tells black and white from the numbers or colours of
/// labels, which are darker.
struct MaskValues {
  std::array<long, 256> pixels{};  ///< by value

  /// The darkest and the brightest value; 0 where no pixels were counted.
  int lowest() const;
  int highest() const;
  /// The `mask_threshold` that these masks need, because the usual one finds nothing: the smallest value of labels, or
  /// the middle of dim masks. Nothing: the usual one finds something, or the masks are of one value.
  std::optional<int> needed_threshold() const;
  /// Whether a large part of what is not black belongs to labels that the usual threshold leaves out.
  bool has_dark_labels() const;
  /// "0, 1", or "0 to 97" for many.
  std::string to_string() const;
};

/// Looks at some masks of one camera, from the whole recording. @param source what `open_frames` opens
/// @throws FileError as open_frames and FrameReader::read
MaskValues look_at_masks(const std::string& source);

}  // namespace doppel
