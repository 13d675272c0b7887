#include "doppel/view/live_poses.h"

namespace doppel {

void LivePoses::push(std::vector<float> dofs, bool tracked) {
  {
    const std::lock_guard lock(mutex_);
    const Clock::time_point now = Clock::now();
    if (now - when_ > kLiveBreak) rows_.clear();
    if (rows_.size() == most_rows_) rows_.pop_front();
    rows_.push_back(std::move(dofs));
    tracked_ = tracked;
    when_ = now;
    ++number_;
  }
  changed_.notify_all();
}

std::optional<LivePoses::Latest> LivePoses::newer_than(std::uint32_t after, std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  const auto fresh = [&] { return number_ > after && Clock::now() - when_ <= kLiveBreak; };
  changed_.wait_for(lock, patience, [&] { return closed_ || fresh(); });
  if (closed_ || !fresh()) return std::nullopt;
  return Latest{number_, tracked_, {rows_.begin(), rows_.end()}};
}

void LivePoses::close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  changed_.notify_all();
}

}  // namespace doppel
