#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Formats that wrap their content: in an archive behind a checksum, or behind a length. Damage of such a file mostly
/// ends at the checksum or the length. A mutation of one part, wrapped anew, reaches the readers behind them.
namespace doppel::fuzz {

/// A file without its wrapping.
struct Unwrapped {
  std::vector<std::string> parts;
  /// The file with other bytes in its parts, whose number stays. Lengths and checksums fit.
  std::function<std::string(const std::vector<std::string>& parts)> wrap;
};

/// @return nothing for a file of another format, and for one with no part
using Unwrap = std::function<std::optional<Unwrapped>(std::string_view bytes)>;

/// Name and content of each file of a zip archive, for .npz, .pth and .pt.
std::optional<Unwrapped> unwrap_zip(std::string_view bytes);
/// The chunks of a .glb file.
std::optional<Unwrapped> unwrap_glb(std::string_view bytes);
/// The header and the numbers of a .safetensors file.
std::optional<Unwrapped> unwrap_safetensors(std::string_view bytes);
/// The innermost values of a message of protocol buffers that have a length: texts, bytes and packed numbers.
std::optional<Unwrapped> unwrap_protobuf(std::string_view bytes);

}  // namespace doppel::fuzz
