#pragma once

#include <string>

namespace doppel {

/// An image inside a page: `<figure>` with the bytes of an image file and a caption.
/// @param bytes of the file @param type "image/jpeg", "image/png" @param caption plain text, which the function escapes
std::string embedded_image(const std::string& bytes, const std::string& type, const std::string& caption);

}  // namespace doppel
