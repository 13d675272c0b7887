#pragma once

#include <array>
#include <string>

namespace doppel {

/// The names of the labels of the LIP human parser (`background`, `hat`, `upper_clothes`, ...) and of label 20, the
/// body under a dress.
constexpr int kNumLabels = 21;
const std::array<std::string, kNumLabels>& label_names();

}  // namespace doppel
