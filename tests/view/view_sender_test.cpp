#include "doppel/view/view_sender.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

// clang-format off
#include <Eigen/Core>  // before httplib, whose headers define names that Eigen uses
#include <httplib.h>
// clang-format on

#include <cstring>
#include <optional>
#include <thread>

#include "doppel/core/error.h"
#include "doppel/layers/surface.h"
#include "doppel/view/live_poses.h"
#include "doppel/view/view_server.h"
#include "support/test_character.h"

namespace doppel::view_sender_test {
namespace {

using namespace std::chrono_literals;

/// A stage whose vertices depend on the whole window, so that the window is seen: the sum of all its poses' surfaces.
ViewSubject subject() {
  ViewSubject result;
  result.character = make_test_character();
  result.motion = {{result.character.rest_dofs}, {0}};
  result.stages = {{"skinning", 2, [surface = CharacterSurface(result.character)](const torch::Tensor& window) mutable {
                      torch::Tensor sum;
                      for (std::int64_t row = 0; row < window.size(1); ++row) {
                        const torch::Tensor one = surface->skinned(window.select(1, row));
                        sum = sum.defined() ? sum + one : one;
                      }
                      return sum;
                    }}};
  return result;
}

/// A viewer in a thread of its own, and what it answers to a page.
class Viewer {
 public:
  explicit Viewer(int port = 0) : server_(subject(), port), thread_([this] { server_.serve(); }) {}
  ~Viewer() {
    server_.stop();
    thread_.join();
  }

  const std::string& url() const { return server_.url(); }
  int port() const { return std::stoi(url().substr(url().rfind(':') + 1)); }

  struct Shown {
    std::uint32_t number, tracked;
    std::vector<float> dofs, vertices;
  };
  /// @return nothing: no pose came
  std::optional<Shown> after(std::uint32_t number) const {
    httplib::Client client("127.0.0.1", port());
    client.set_read_timeout(60);
    const auto answer = client.Get("/api/live?stage=skinning&after=" + std::to_string(number) + "&" +
                                   url().substr(url().find("token=")));
    if (!answer || answer->status != 200 || answer->body.empty()) return std::nullopt;
    const Character character = make_test_character();
    Shown shown{};
    shown.dofs.resize(static_cast<std::size_t>(character.num_dofs()));
    shown.vertices.resize(3 * static_cast<std::size_t>(character.num_vertices()));
    const char* from = answer->body.data();
    const auto take = [&](void* to, std::size_t bytes) {
      std::memcpy(to, from, bytes);
      from += bytes;
    };
    take(&shown.number, 4);
    take(&shown.tracked, 4);
    take(shown.dofs.data(), shown.dofs.size() * sizeof(float));
    take(shown.vertices.data(), shown.vertices.size() * sizeof(float));
    return shown;
  }

 private:
  ViewServer server_;
  std::thread thread_;
};

std::vector<double> pose(double value) {
  std::vector<double> dofs = make_test_character().rest_dofs;
  dofs.back() = value;
  return dofs;
}

/// Sends a pose until it is shown: a sender leaves out poses that come while it sends, and a viewer leaves out old
/// ones.
Viewer::Shown shown_after(ViewSender& sender, const Viewer& viewer, double value, bool tracked, std::uint32_t number) {
  for (;;) {
    sender.send(pose(value), tracked);
    if (const auto shown = viewer.after(number); shown && shown->dofs.back() == static_cast<float>(value))
      return *shown;
  }
}

TEST(ViewSenderAgrees, TheViewerShowsTheWindowOfTheNewestPoses) {
  const Viewer viewer;
  ViewSender sender(viewer.url());
  Viewer::Shown shown{};
  bool quick = false;
  while (!quick) {  // a pause of two seconds, on a busy machine, begins another window
    quick = true;
    const auto start = std::chrono::steady_clock::now();
    for (const double value : {0.2, 0.4, 0.8}) {
      const std::uint32_t before = shown.number;
      shown = shown_after(sender, viewer, value, value < 0.8, before);
      quick &= shown.number == before + 1;
    }
    quick &= std::chrono::steady_clock::now() - start < 1s;
  }
  EXPECT_EQ(shown.tracked, 0u);
  torch::Tensor expected;
  const torch::NoGradGuard no_grad;
  CharacterSurface surface(make_test_character());
  for (const double value : {0.2, 0.4, 0.8}) {
    const torch::Tensor one = surface->skinned(torch::tensor(pose(value), torch::kFloat32).unsqueeze(0));
    expected = expected.defined() ? expected + one : one;
  }
  EXPECT_LT((torch::tensor(shown.vertices) - expected.flatten()).abs().max().item<float>(), 1e-5f);
}

TEST(ViewSenderBehaves, TheViewerMayCloseAndComeBack) {
  auto viewer = std::make_unique<Viewer>();
  const int port = viewer->port();
  ViewSender sender(viewer->url());
  EXPECT_EQ(shown_after(sender, *viewer, 0.1, true, 0).tracked, 1u);
  viewer.reset();
  for (int i = 0; i < 100; ++i) sender.send(pose(0.2), true);
  const Viewer other(port);  // it has another token, so it takes nothing
  sender.send(pose(0.3), true);
  EXPECT_FALSE(other.after(0));
  ViewSender right(other.url());
  EXPECT_GE(shown_after(right, other, 0.4, true, 0).number, 1u);
}

TEST(ViewSenderErrors, AddressesThatAreNone) {
  for (const char* address :
       {"http://127.0.0.1:80", "http://192.168.1.2:80/?token=ab", "http://example.org:80/?token=ab",
        "http://127.0.0.1:99999/?token=ab", "http://127.0.0.1:0/?token=ab", "http://127.0.0.1:80/?token=ab cd"})
    EXPECT_THROW(ViewSender{address}, UsageError) << address;
}

TEST(LivePosesBehave, ASlowReaderGetsTheNewestPoseAndNoOtherOne) {
  LivePoses poses(2);
  EXPECT_FALSE(poses.newer_than(0, 0ms));
  for (int i = 1; i <= 1000; ++i) poses.push({static_cast<float>(i)}, true);
  const auto latest = poses.newer_than(3, 0ms);
  ASSERT_TRUE(latest);
  EXPECT_EQ(latest->number, 1000u);
  EXPECT_EQ(latest->rows, (std::vector<std::vector<float>>{{999.0f}, {1000.0f}}));
  EXPECT_FALSE(poses.newer_than(1000, 0ms));
}

TEST(LivePosesBehave, ClosingEndsTheWaiting) {
  LivePoses poses(1);
  std::thread waiting([&] { EXPECT_FALSE(poses.newer_than(0, 10min)); });
  poses.close();
  waiting.join();
}

}  // namespace
}  // namespace doppel::view_sender_test
