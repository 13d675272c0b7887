#pragma once

/// Intrinsics of files that give lengths as fractions of the image and do not state its size.

#include "doppel/geometry/camera.h"

namespace doppel {

/// Some formats (Captury, RealityCapture) cannot be brought to pixels before the size of the images is known. Their
/// cameras have width and height 0, and K in one of two units:
/// - the width of the image, measured from its upper left corner: K(0, 2) is near 0.5;
/// - the longer side of the image, measured from its centre: K(0, 2) is near 0.
/// K(0, 0) is below 64 for these and above for pixels: no lens of a capture has 64 image widths as focal length.
bool has_relative_intrinsics(const Camera& camera);

/// The camera for images of a size that its file does not state: intrinsics in pixels and the size are set. Cameras
/// that have a size are returned unchanged.
Camera with_image_size(Camera camera, int width, int height);

}  // namespace doppel
