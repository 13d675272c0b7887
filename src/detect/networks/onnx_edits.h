#pragma once

#include <string>

namespace doppel {

/// The bytes of an ONNX file with operators that OpenCV 4.6 reads instead of some that it refuses. The network computes
/// the same.
///
/// - `Clip` with constant limits as inputs gets them as attributes (OpenCV's issue 22015).
/// - `Mul` with a constant row of s numbers becomes `MatMul` with a diagonal matrix.
/// - `Unsqueeze` before the last axis and `Mul` with a constant of m rows of s numbers become `MatMul` with m diagonal
///   matrices side by side, and `Reshape`. The attention of RTMPose scales its queries and keys like this.
///
/// @return the bytes unchanged when there is nothing to edit, or when they are no ONNX file
std::string readable_onnx(const std::string& onnx);

}  // namespace doppel
