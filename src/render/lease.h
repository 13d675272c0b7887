#pragma once

#include <algorithm>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace doppel::render {

/// Exclusive use of an object that is expensive to make, for one call. It is kept for later calls.
template <typename T>
class Lease {
 public:
  /// @param fits whether a kept object serves this call; if none does, all are dropped @param make makes a new one
  template <typename Fits, typename Make>
  Lease(const Fits& fits, const Make& make) {
    const std::lock_guard<std::mutex> lock(mutex());
    auto& kept = kept_ones();
    const auto found = std::find_if(kept.begin(), kept.end(), [&](const auto& object) { return fits(*object); });
    if (found == kept.end()) {
      kept.clear();
      object_ = make();
    } else {
      object_ = std::move(*found);
      kept.erase(found);
    }
  }
  /// Of an object that serves every call.
  Lease() : Lease([](const T&) { return true; }, [] { return std::make_unique<T>(); }) {}
  ~Lease() {
    const std::lock_guard<std::mutex> lock(mutex());
    kept_ones().push_back(std::move(object_));
  }
  Lease(const Lease&) = delete;
  Lease& operator=(const Lease&) = delete;
  T* operator->() const { return object_.get(); }
  T& operator*() const { return *object_; }

 private:
  static std::mutex& mutex() {
    static std::mutex instance;
    return instance;
  }
  /// Never destroyed: threads may still use it while static objects end.
  static std::vector<std::unique_ptr<T>>& kept_ones() {
    static auto* const instance = new std::vector<std::unique_ptr<T>>;
    return *instance;
  }
  std::unique_ptr<T> object_;
};

}  // namespace doppel::render
