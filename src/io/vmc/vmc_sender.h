#pragma once

#include <memory>
#include <string>
#include <vector>

#include "doppel/io/vmc/vmc_pose.h"

namespace doppel {

/// Sends poses to an avatar program (VSeeFace, Warudo, VMC, Unity and others) by the VMC protocol: OSC over UDP. A pose
/// is one bundle: `/VMC/Ext/OK`, `/VMC/Ext/T`, `/VMC/Ext/Root/Pos` and a `/VMC/Ext/Bone/Pos` for each bone.
class VmcSender {
 public:
  /// @param address `vmc://HOST:PORT`, for example `vmc://127.0.0.1:39539`
  /// @throws UsageError for another address, a host that is not found, or as VmcAvatar
  VmcSender(const std::string& address, const Character& character);
  VmcSender(const VmcSender&) = delete;
  VmcSender& operator=(const VmcSender&) = delete;
  ~VmcSender();

  /// Never waits, and never fails when nobody listens. @param seconds since the start @param tracked whether the person
  /// is seen
  void send(const std::vector<double>& dofs, double seconds, bool tracked);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace doppel
