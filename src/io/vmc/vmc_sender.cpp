#include "doppel/io/vmc/vmc_sender.h"

#include <oscpack/ip/UdpSocket.h>
#include <oscpack/osc/OscOutboundPacketStream.h>

#include <array>
#include <charconv>

#include "doppel/core/error.h"

namespace doppel {
namespace {

constexpr std::size_t kMaxPacketBytes = 8192;  // 52 bones need about 5000
constexpr osc::int32 kLoaded = 1, kCalibrated = 3, kNormalMode = 0;

IpEndpointName endpoint_of(const std::string& address) {
  const std::string scheme = "vmc://";
  const std::size_t colon = address.rfind(':');
  int port = 0;
  const bool begins = address.rfind(scheme, 0) == 0 && colon != std::string::npos && colon > scheme.size();
  if (begins) {
    const char* end = address.data() + address.size();
    const auto [read, error] = std::from_chars(address.data() + colon + 1, end, port);
    if (error != std::errc() || read != end) port = 0;
  }
  if (port < 1 || port > 65535)
    fail<UsageError>("sending poses: '{}' is not an address; it must be vmc://HOST:PORT, e.g. vmc://127.0.0.1:39539",
                     address);
  const std::string host = address.substr(scheme.size(), colon - scheme.size());
  const IpEndpointName endpoint(host.c_str(), port);
  if (endpoint.address == IpEndpointName::ANY_ADDRESS || endpoint.address == 0)
    fail<UsageError>("sending poses: the host '{}' was not found", host);
  return endpoint;
}

void write_transform(osc::OutboundPacketStream& stream, const char* address, const std::string& name,
                     const Eigen::Vector3d& p, const Eigen::Quaterniond& q) {
  stream << osc::BeginMessage(address) << name.c_str();
  for (const double value : {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()}) stream << static_cast<float>(value);
  stream << osc::EndMessage;
}

}  // namespace

struct VmcSender::State {
  VmcAvatar avatar;
  UdpTransmitSocket socket;
  std::array<char, kMaxPacketBytes> buffer{};

  State(const std::string& address, const Character& character) : avatar(character), socket(endpoint_of(address)) {}
};

VmcSender::VmcSender(const std::string& address, const Character& character)
    : state_(std::make_unique<State>(address, character)) {}

VmcSender::~VmcSender() = default;

void VmcSender::send(const std::vector<double>& dofs, double seconds, bool tracked) {
  osc::OutboundPacketStream stream(state_->buffer.data(), state_->buffer.size());
  stream << osc::BeginBundleImmediate;
  stream << osc::BeginMessage("/VMC/Ext/OK") << kLoaded << kCalibrated << kNormalMode << osc::int32(tracked ? 1 : 0)
         << osc::EndMessage;
  stream << osc::BeginMessage("/VMC/Ext/T") << static_cast<float>(seconds) << osc::EndMessage;
  write_transform(stream, "/VMC/Ext/Root/Pos", "root", Eigen::Vector3d::Zero(), Eigen::Quaterniond::Identity());
  for (const VmcBone& bone : state_->avatar.bones(dofs))
    write_transform(stream, "/VMC/Ext/Bone/Pos", bone.name, bone.position, bone.rotation);
  stream << osc::EndBundle;
  state_->socket.Send(stream.Data(), stream.Size());
}

}  // namespace doppel
