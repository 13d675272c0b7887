#pragma once

#include <string>

namespace doppel {

/// The bytes of an ONNX file in a form that older versions of OpenCV read: `Clip` whose limits are constants gets them
/// as attributes, as before version 11 of the operators. OpenCV 4.6 refuses limits that are inputs (its issue 22015).
/// @return the bytes unchanged when there is nothing to edit, or when they are no ONNX file
std::string with_readable_clips(const std::string& onnx);

}  // namespace doppel
