#pragma once

#include <exception>
#include <functional>
#include <string>

namespace doppel::support {

/// What an action complains of with an exception of type `E`, or "nothing was thrown". Others pass through and fail the
/// test.
template <typename E = std::exception>
std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const E& error) {
    return error.what();
  }
  return "nothing was thrown";
}

}  // namespace doppel::support
