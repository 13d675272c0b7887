#pragma once

#include <string>

namespace doppel {

/// The bytes as base64 text (RFC 4648, with padding), for files that hold text alone.
std::string base64(const std::string& bytes);

}  // namespace doppel
