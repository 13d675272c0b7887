#pragma once

#include <cstddef>
#include <cstdint>

namespace doppel {

/// CRC-32C (Castagnoli, reflected, as in iSCSI and TensorBoard records) of `size` bytes, continuing from `crc`.
std::uint32_t crc32c(const void* data, std::size_t size, std::uint32_t crc = 0);

}  // namespace doppel
