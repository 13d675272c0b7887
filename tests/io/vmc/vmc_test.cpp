#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <oscpack/ip/UdpSocket.h>
#include <oscpack/osc/OscReceivedElements.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <set>

#include "doppel/io/vmc/vmc_sender.h"
#include "doppel/rigging/body/body_model.h"
#include "doppel/rigging/body/measures.h"
#include "support/message_of.h"

namespace doppel::vmc_test {
namespace {

using support::message_of;
using ::testing::HasSubstr;

const Character& person() {
  static const Character kPerson = BodyModel(1500, 100).character("person", mean_measures());
  return kPerson;
}

std::vector<double> some_pose(double phase) {
  std::vector<double> dofs = person().rest_dofs;
  for (std::size_t d = 0; d < dofs.size(); ++d) dofs[d] += 0.25 * std::sin(1.3 * static_cast<double>(d) + phase);
  return dofs;
}

/// The positions of the bones, rebuilt as a receiver does, in our axes.
std::map<std::string, Eigen::Vector3d> positions(const std::vector<VmcBone>& bones) {
  std::vector<Eigen::Vector3d> position;
  std::vector<Eigen::Quaterniond> world;
  std::map<std::string, Eigen::Vector3d> named;
  for (const VmcBone& bone : bones) {
    const bool root = bone.parent < 0;
    position.push_back(root ? bone.position : position[bone.parent] + world[bone.parent] * bone.position);
    world.push_back(root ? bone.rotation : world[bone.parent] * bone.rotation);
    named[bone.name] = {-position.back().x(), position.back().y(), position.back().z()};
  }
  return named;
}

TEST(VmcAvatarAgrees, JointsThatAReceiverRebuildsAreThoseOfThePose) {
  const VmcAvatar avatar(person());
  const Figure figure = make_figure(person(), BoneNames::unity);
  for (const double phase : {0.0, 1.0, 2.0}) {
    const std::vector<double> dofs = some_pose(phase);
    const auto found = positions(avatar.bones(dofs));
    const auto posed = pose_nodes(figure, person().skeleton, dofs);
    int compared = 0;
    for (std::size_t n = 0; n < figure.nodes.size(); ++n) {
      const std::string& name = figure.nodes[n].name;
      const auto it = found.find(name);
      if (it == found.end()) continue;
      EXPECT_LT((it->second - posed[n].translation()).norm(), 1e-4) << name;
      ++compared;
    }
    EXPECT_GE(compared, 50);
  }
}

TEST(VmcAvatarBehaves, WithoutRotationsTheAvatarStandsInATPose) {
  std::vector<VmcBone> bones = VmcAvatar(person()).bones(person().rest_dofs);
  for (VmcBone& bone : bones) bone.rotation = Eigen::Quaterniond::Identity();
  auto found = positions(bones);
  EXPECT_NEAR(found.at("LeftHand").y(), found.at("LeftUpperArm").y(), 1e-6);
  EXPECT_NEAR(found.at("LeftHand").z(), found.at("LeftUpperArm").z(), 1e-6);
  EXPECT_GT(found.at("LeftHand").x(), found.at("RightHand").x() + 0.8);
  EXPECT_NEAR(found.at("RightFoot").x(), found.at("RightUpperLeg").x(), 1e-6);
  // Fingers lie along the arm. The thumb, beside the hand, does not.
  for (const char* finger : {"Index", "Middle", "Ring", "Little"}) {
    const Eigen::Vector3d first = found.at(std::string("Right") + finger + "Proximal"),
                          last = found.at(std::string("Right") + finger + "Distal");
    EXPECT_LT((last - first).normalized().x(), -1.0 + 1e-9) << finger;
  }
  EXPECT_GT((found.at("LeftThumbDistal") - found.at("LeftThumbProximal")).normalized().z(), 0.2);
}

/// HumanBodyBones of Unity, without eyes and jaw.
std::set<std::string> human_body_bones() {
  std::set<std::string> names{"Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"};
  for (const std::string side : {"Left", "Right"}) {
    for (const char* part : {"UpperLeg", "LowerLeg", "Foot", "Shoulder", "UpperArm", "LowerArm", "Hand", "Toes"})
      names.insert(side + part);
    for (const char* finger : {"Thumb", "Index", "Middle", "Ring", "Little"})
      for (const char* bone : {"Proximal", "Intermediate", "Distal"}) names.insert(side + finger + bone);
  }
  return names;
}

TEST(VmcAvatarAgrees, BonesHaveTheNamesOfUnity) {
  const std::set<std::string> known = human_body_bones();
  std::set<std::string> sent;
  for (const VmcBone& bone : VmcAvatar(person()).bones(person().rest_dofs)) {
    EXPECT_TRUE(known.contains(bone.name)) << bone.name;
    EXPECT_TRUE(sent.insert(bone.name).second) << bone.name;
  }
  EXPECT_GE(sent.size(), 50U);
}

TEST(VmcAvatarAgrees, EachBoneOfAFingerIsThatOfUnity) {
  // Unity calls the three bones of a thumb as those of the other fingers; VRM 1.0 starts with the metacarpal.
  const std::map<std::string, std::string> own{
      {"LeftThumbProximal", "LeftHandThumb1"},       {"LeftThumbIntermediate", "LeftHandThumb2"},
      {"LeftThumbDistal", "LeftHandThumb3"},         {"RightIndexProximal", "RightHandIndex1"},
      {"RightIndexIntermediate", "RightHandIndex2"}, {"RightLittleDistal", "RightHandPinky3"}};
  const Figure figure = make_figure(person(), BoneNames::skeletool);
  const std::vector<double> dofs = some_pose(0.5);
  const auto found = positions(VmcAvatar(person()).bones(dofs));
  const auto posed = pose_nodes(figure, person().skeleton, dofs);
  for (const auto& [unity, name] : own) {
    const auto node = std::find_if(figure.nodes.begin(), figure.nodes.end(),
                                   [&name = name](const FigureNode& other) { return other.name == name; });
    ASSERT_NE(node, figure.nodes.end()) << name;
    EXPECT_LT((found.at(unity) - posed[static_cast<std::size_t>(node - figure.nodes.begin())].translation()).norm(),
              1e-4)
        << unity;
  }
}

/// A UDP port of this machine that waits for packets.
class Receiver {
 public:
  Receiver() : socket_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    const timeval patience{5, 0};
    EXPECT_EQ(::bind(socket_, reinterpret_cast<sockaddr*>(&address), size), 0);
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
  }
  ~Receiver() { ::close(socket_); }
  std::string address() const { return "vmc://127.0.0.1:" + std::to_string(port_); }
  std::vector<char> next() {
    std::vector<char> packet(65536);
    packet.resize(static_cast<std::size_t>(std::max<ssize_t>(0, ::recv(socket_, packet.data(), packet.size(), 0))));
    return packet;
  }

 private:
  int socket_;
  int port_ = 0;
};

TEST(VmcSenderAgrees, PacketsDecodeToThePose) {
  Receiver receiver;
  VmcSender sender(receiver.address(), person());
  const VmcAvatar avatar(person());
  for (int frame = 0; frame < 30; ++frame) {
    const std::vector<double> dofs = some_pose(0.1 * frame);
    sender.send(dofs, frame / 30.0, frame != 5);
    const std::vector<char> packet = receiver.next();
    ASSERT_FALSE(packet.empty());
    const osc::ReceivedBundle bundle(
        osc::ReceivedPacket(packet.data(), static_cast<osc::osc_bundle_element_size_t>(packet.size())));
    const std::vector<VmcBone> expected = avatar.bones(dofs);
    std::size_t bone = 0;
    std::map<std::string, int> messages;
    for (auto element = bundle.ElementsBegin(); element != bundle.ElementsEnd(); ++element) {
      const osc::ReceivedMessage message(*element);
      const std::string address = message.AddressPattern();
      auto argument = message.ArgumentsBegin();
      ++messages[address];
      if (address == "/VMC/Ext/OK") {
        EXPECT_EQ((argument++)->AsInt32(), 1);
        ++argument;
        ++argument;
        EXPECT_EQ(argument->AsInt32(), frame != 5 ? 1 : 0);
      } else if (address == "/VMC/Ext/T") {
        EXPECT_FLOAT_EQ(argument->AsFloat(), static_cast<float>(frame / 30.0));
      } else if (address == "/VMC/Ext/Root/Pos") {
        EXPECT_STREQ((argument++)->AsString(), "root");
        for (const float value : {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 1.0f})
          EXPECT_EQ((argument++)->AsFloat(), value) << "the pose of the person is that of the hips";
      } else if (address == "/VMC/Ext/Bone/Pos") {
        ASSERT_LT(bone, expected.size());
        const VmcBone& wanted = expected[bone++];
        EXPECT_EQ((argument++)->AsString(), wanted.name);
        const auto& [p, q] = std::tie(wanted.position, wanted.rotation);
        for (const double value : {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()})
          EXPECT_NEAR((argument++)->AsFloat(), value, 1e-6);
      }
    }
    EXPECT_EQ(bone, expected.size());
    EXPECT_EQ(messages, (std::map<std::string, int>{{"/VMC/Ext/OK", 1},
                                                    {"/VMC/Ext/T", 1},
                                                    {"/VMC/Ext/Root/Pos", 1},
                                                    {"/VMC/Ext/Bone/Pos", static_cast<int>(expected.size())}}));
  }
}

TEST(VmcSenderBehaves, NobodyNeedsToListen) {
  std::string address;
  { address = Receiver().address(); }
  VmcSender sender(address, person());
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < 5; ++i) EXPECT_NO_THROW(sender.send(person().rest_dofs, i, true)) << i;
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(2)) << "it waits for nobody";
}

TEST(VmcSenderErrors, AddressesThatAreNone) {
  for (const char* address : {"127.0.0.1:39539", "vmc://127.0.0.1", "vmc://:39539", "vmc://127.0.0.1:0",
                              "vmc://127.0.0.1:99999", "vmc://127.0.0.1:39539x"})
    EXPECT_THAT(message_of([&] { VmcSender(address, person()); }), HasSubstr("vmc://HOST:PORT")) << address;
  EXPECT_THAT(message_of([] { VmcSender("vmc://no.such.host.invalid:1", person()); }), HasSubstr("was not found"));
}

}  // namespace
}  // namespace doppel::vmc_test
