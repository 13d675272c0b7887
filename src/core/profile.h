#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

namespace doppel {

/// Times of the parts of a repeated work, seconds, in the order in which the parts were first added.
class Profile {
 public:
  void add(const std::string& part, double seconds) {
    for (auto& [name, sum] : parts_)
      if (name == part) {
        sum += seconds;
        return;
      }
    parts_.emplace_back(part, seconds);
  }
  void add(const Profile& other) {
    for (const auto& [name, seconds] : other.parts_) add(name, seconds);
  }
  const std::vector<std::pair<std::string, double>>& parts() const { return parts_; }
  void clear() { parts_.clear(); }

 private:
  std::vector<std::pair<std::string, double>> parts_;
};

/// Adds the time of its scope to a part of a profile.
class ProfileScope {
 public:
  ProfileScope(Profile& profile, std::string part) : profile_(profile), part_(std::move(part)) {}
  ~ProfileScope() {
    profile_.add(part_, std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count());
  }
  ProfileScope(const ProfileScope&) = delete;
  ProfileScope& operator=(const ProfileScope&) = delete;

 private:
  Profile& profile_;
  std::string part_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace doppel
