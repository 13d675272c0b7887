#pragma once

#include <cstddef>
#include <vector>

#include "doppel/core/as_size.h"

namespace doppel {

/// Thins out a list evenly, to at most `most` elements. The first one stays.
template <typename T>
void thin_out(std::vector<T>& elements, int most) {
  const std::size_t count = elements.size(), wanted = as_size(most);
  if (count <= wanted) return;
  for (std::size_t i = 0; i < wanted; ++i) elements[i] = elements[i * count / wanted];
  elements.resize(wanted);
}

}  // namespace doppel
