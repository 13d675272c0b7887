#pragma once

#include <memory>
#include <string>
#include <vector>

namespace doppel {

/// Sends poses to a page of `doppel view` while they are tracked. A thread of its own sends the newest pose; those that
/// come meanwhile are left out. Without a viewer nothing is sent, and a viewer that comes back gets the next pose. What
/// the viewer answers when it refuses a pose is logged once.
class ViewSender {
 public:
  /// @param address the one that `doppel view` prints, `http://127.0.0.1:PORT/?token=...`
  /// @throws UsageError for another address or another computer
  explicit ViewSender(const std::string& address);
  ViewSender(const ViewSender&) = delete;
  ViewSender& operator=(const ViewSender&) = delete;
  ~ViewSender();

  /// Whether an address is meant for a viewer.
  static bool recognises(const std::string& address) { return address.rfind("http://", 0) == 0; }

  /// Never waits. @param dofs [D] @param tracked whether the person is seen
  void send(const std::vector<double>& dofs, bool tracked);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace doppel
