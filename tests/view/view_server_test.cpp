#include "doppel/view/view_server.h"

#include <gtest/gtest.h>
#include <httplib.h>

#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>
#include <thread>

#include "doppel/character/motion.h"
#include "doppel/core/atomic_file.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/layers/surface.h"
#include "support/temporary_folder.h"
#include "support/test_character.h"

namespace doppel::view_server_test {
namespace {

constexpr int kGaussians = 3;

/// A server of the test character with one frame, in a thread of its own.
class ViewServerTest : public testing::Test {
 protected:
  ViewServerTest() : server_(subject(), 0), thread_([this] { server_.serve(); }) {
    const std::string url = server_.url();
    const std::size_t colon = url.rfind(':'), slash = url.find('/', colon);
    port_ = std::stoi(url.substr(colon + 1, slash - colon - 1));
    query_ = url.substr(url.find("token="));
    while (!client().Get("/")) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ~ViewServerTest() override {
    server_.stop();
    thread_.join();
  }

  static ViewSubject subject() {
    ViewSubject result;
    result.character = make_test_character();
    result.motion = {{result.character.rest_dofs}, {0}};
    result.stages = {
        {"skinning", 0, [surface = CharacterSurface(result.character)](const torch::Tensor& window) mutable {
           return surface->skinned(window.select(1, window.size(1) - 1));
         }}};
    result.stages.push_back({"textured",
                             0,
                             result.stages[0].vertices,
                             [](const auto&, const auto&, const auto&) {
                               return torch::full({1, 2, 2, 3}, 0.5);
                             },
                             2,
                             {},
                             0,
                             "skinning"});
    const auto gaussians = [](const auto&, const auto& camera, const auto& vertices) {
      return gaussian_rows(camera, vertices);
    };
    result.stages.push_back({"gaussians", 0, result.stages[0].vertices, {}, 0, gaussians, kGaussians, "skinning"});
    return result;
  }
  /// Made-up Gaussians at the first vertices; the other numbers of a row are those of the camera. @return [B,P,14]
  static torch::Tensor gaussian_rows(const torch::Tensor& camera, const torch::Tensor& vertices) {
    const torch::Tensor rest = camera.flatten(1).narrow(1, 0, 11).unsqueeze(1).expand({-1, kGaussians, -1});
    return torch::cat({vertices.narrow(1, 0, kGaussians), rest}, 2);
  }
  /// The rest pose as a tracker sends it.
  static std::string pose_bytes() {
    const std::vector<double> dofs = make_test_character().rest_dofs;
    const std::vector<float> pose(dofs.begin(), dofs.end());
    return {reinterpret_cast<const char*>(pose.data()), 4 * pose.size()};
  }
  httplib::Client client() const {
    httplib::Client result("127.0.0.1", port_);
    result.set_read_timeout(20);
    return result;
  }
  int status(const std::string& path) const { return client().Get(path)->status; }
  std::string with_token(const std::string& path) const {
    return path + (path.find('?') == std::string::npos ? "?" : "&") + query_;
  }

  ViewServer server_;
  std::thread thread_;
  int port_ = 0;
  std::string query_;
};

TEST_F(ViewServerTest, RefusesRequestsWithoutTheToken) {
  for (const char* path : {"/", "/double/description.json",
                           "/double/description.json?token=", "/double/description.json?token=0", "/none.js"})
    EXPECT_EQ(status(path), 403) << path;
  EXPECT_EQ(status(with_token("/double/description.json")), 200);
}

TEST_F(ViewServerTest, RefusesAnotherHost) {
  const auto answer = client().Get(with_token("/double/description.json"), {{"Host", "example.org"}});
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 403);
}

/// What browsers send about the page that asks.
TEST_F(ViewServerTest, RefusesPagesOfOtherSitesAndPorts) {
  const std::string body = pose_bytes(), type = "application/octet-stream", token = query_.substr(6);
  const httplib::Headers foreign[] = {{{"Origin", "http://127.0.0.1:1"}},  {{"Origin", "http://localhost"}},
                                      {{"Origin", "https://example.org"}}, {{"Origin", "null"}},
                                      {{"Sec-Fetch-Site", "same-site"}},   {{"Sec-Fetch-Site", "cross-site"}}};
  for (httplib::Headers headers : foreign) {
    const std::string& name = headers.begin()->second;
    headers.emplace("Doppel-Token", token);
    const auto data = client().Get(with_token("/double/description.json"), headers);
    const auto pose = client().Post(with_token("/api/live?tracked=1"), headers, body, type);
    const auto motion = client().Post(with_token("/api/motion?name=walk.motion"), headers, body, type);
    for (const auto& answer : {&data, &pose, &motion}) {
      ASSERT_TRUE(*answer) << name;
      EXPECT_EQ((*answer)->status, 403) << name;
      EXPECT_EQ((*answer)->body.rfind("A page of another site or port has sent this request; ", 0), 0) << name;
    }
    const httplib::Result question = client().Options("/api/live", headers);
    EXPECT_EQ(question->status, 403) << name;
    EXPECT_FALSE(question->has_header("Access-Control-Allow-Origin")) << name;
  }
  EXPECT_EQ(client().Get(with_token("/api/live?after=0&stage=skinning"))->body, "") << "a pose was taken";
}

TEST_F(ViewServerTest, AnotherSiteMayLinkToThePage) {
  httplib::Headers link = {{"Sec-Fetch-Site", "cross-site"}, {"Sec-Fetch-Mode", "navigate"}};
  EXPECT_EQ(client().Get(with_token("/"), link)->status, 200);
  EXPECT_EQ(client().Get("/", link)->status, 403);
  EXPECT_EQ(client().Post(with_token("/api/live?tracked=1"), link, pose_bytes(), "text/plain")->status, 403);
}

/// Programs give the token in the address or in the header; a page gives it in the header.
TEST_F(ViewServerTest, PostsOfABrowserNeedTheHeader) {
  const std::string own = "http://127.0.0.1:" + std::to_string(port_), token = query_.substr(6);
  const auto post = [&](const std::string& path, const httplib::Headers& headers) {
    return client().Post(path, headers, pose_bytes(), "application/octet-stream")->status;
  };
  const std::string path = "/api/live?tracked=1";
  EXPECT_EQ(post(with_token(path), {}), 200);
  EXPECT_EQ(post(path, {{"Doppel-Token", token}}), 200);
  EXPECT_EQ(post(path, {{"Origin", own}, {"Doppel-Token", token}}), 200);
  EXPECT_EQ(post(path, {{"Sec-Fetch-Site", "same-origin"}, {"Doppel-Token", token}}), 200);
  EXPECT_EQ(post(with_token(path), {{"Origin", own}}), 403);
  EXPECT_EQ(post(with_token(path), {{"Sec-Fetch-Site", "same-origin"}}), 403);
  EXPECT_EQ(post(with_token(path), {{"Doppel-Token", "0"}}), 403);
  EXPECT_EQ(post(path, {{"Doppel-Token", ""}}), 403);
  EXPECT_EQ(post(path, {}), 403);
  EXPECT_EQ(client().Post(path, pose_bytes(), "text/plain")->get_header_value("Connection"), "close");
}

/// A browser would send a cookie to the servers of other ports, so there is none.
TEST_F(ViewServerTest, KeepsTheTokenOutOfCookies) {
  const auto page = client().Get(with_token("/"));
  ASSERT_EQ(page->status, 200);
  EXPECT_FALSE(page->has_header("Set-Cookie"));
  EXPECT_NE(page->body.find("src=\"./assets/page.js?" + query_ + "\""), std::string::npos);
  EXPECT_NE(page->body.find("href=\"./assets/page.css?" + query_ + "\""), std::string::npos);
  const httplib::Headers cookie = {{"Cookie", "doppel_view_" + std::to_string(port_) + "=" + query_.substr(6)}};
  for (const char* path : {"/", "/assets/page.js", "/double/description.json"}) {
    EXPECT_EQ(client().Get(path, cookie)->status, 403) << path;
    EXPECT_FALSE(client().Get(with_token(path))->has_header("Set-Cookie")) << path;
  }
}

TEST_F(ViewServerTest, LeadsToNoFile) {
  for (const char* path : {"/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/assets/..%2f..%2fetc/passwd"})
    EXPECT_EQ(status(with_token(path)), 404) << path;
}

TEST_F(ViewServerTest, RefusesALargeBodyAndStillServes) {
  const auto answer = client().Post(with_token("/api/pose?stage=skinning"), std::string(3 << 20, 'x'), "text/plain");
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 413);
  EXPECT_EQ(status(with_token("/double/description.json")), 200);
}

TEST_F(ViewServerTest, AnswersWhileOtherConnectionsStandStill) {
  const auto start = std::chrono::steady_clock::now();
  std::vector<std::unique_ptr<httplib::Client>> idle;
  for (int i = 0; i < 6; ++i) {  // as many as a browser opens
    idle.push_back(std::make_unique<httplib::Client>("127.0.0.1", port_));
    idle.back()->set_keep_alive(true);
    idle.back()->set_read_timeout(20);
    ASSERT_TRUE(idle.back()->Get(with_token("/double/description.json")));
  }
  EXPECT_EQ(status(with_token("/double/description.json")), 200);
  EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(), 1.0);
}

TEST_F(ViewServerTest, FrameIsTheSkinnedSurfaceAndTheJoints) {
  const Character character = make_test_character();
  const auto answer = client().Get(with_token("/api/frame?i=0&stage=skinning"));
  ASSERT_EQ(answer->status, 200);
  const std::size_t vertices = 3 * static_cast<std::size_t>(character.num_vertices());
  ASSERT_EQ(answer->body.size(), 4 * (vertices + 3 * character.skeleton.joints.size()));
  CharacterSurface surface(character);
  const torch::Tensor rest = torch::tensor(character.rest_dofs, torch::kFloat32).unsqueeze(0);
  const torch::Tensor expected = surface->skinned(rest).detach().contiguous();
  std::vector<float> found(vertices);
  std::memcpy(found.data(), answer->body.data(), 4 * vertices);
  for (std::size_t i = 0; i < vertices; ++i) ASSERT_NEAR(found[i], expected.data_ptr<float>()[i], 1e-6);
}

/// The skinned surface and the joints come first, then the Gaussians for the camera of the request.
TEST_F(ViewServerTest, GaussiansFollowTheSurfaceAndTheJoints) {
  const Character character = make_test_character();
  const std::string numbers = "500,1,320,2,3,510,240,4,5,6,1,7", query = "stage=gaussians&projection=" + numbers;
  const torch::Tensor camera = torch::tensor({500, 1, 320, 2, 3, 510, 240, 4, 5, 6, 1, 7}, torch::kFloat32);
  CharacterSurface surface(character);
  const torch::NoGradGuard no_grad;
  const torch::Tensor rest = torch::tensor(character.rest_dofs, torch::kFloat32).unsqueeze(0);
  const torch::Tensor expected = gaussian_rows(camera.view({1, 3, 4}), surface->skinned(rest)).contiguous();
  const std::string plain = client().Get(with_token("/api/frame?i=0&stage=skinning"))->body;
  const std::string pose(static_cast<const char*>(rest.data_ptr()), rest.nbytes());
  const auto frame = client().Get(with_token("/api/frame?i=0&" + query));
  const auto posed = client().Post(with_token("/api/pose?" + query), pose, "application/octet-stream");
  for (const auto& answer : {&frame, &posed}) {
    ASSERT_EQ((*answer)->status, 200) << (*answer)->body;
    const std::string& body = (*answer)->body;
    ASSERT_EQ(body.size(), plain.size() + 4 * kGaussians * 14);
    EXPECT_EQ(body.substr(0, plain.size()), plain);
    std::vector<float> rows(kGaussians * 14);
    std::memcpy(rows.data(), body.data() + plain.size(), 4 * rows.size());
    EXPECT_LT((torch::tensor(rows) - expected.flatten()).abs().max().item<float>(), 1e-6);
  }
  EXPECT_EQ(status(with_token("/api/frame?i=0&stage=gaussians")), 400) << "without a camera";
  const auto stages = nlohmann::json::parse(client().Get(with_token("/double/description.json"))->body)["stages"];
  EXPECT_EQ(stages[0]["gaussians"], 0);
  EXPECT_EQ(stages[2]["gaussians"], kGaussians);
  EXPECT_EQ(stages[2]["geometry"], "skinning");
}

/// A live pose is answered in the same way, behind its number, whether the person is seen, and its DoFs.
TEST_F(ViewServerTest, GaussiansOfALivePose) {
  const std::string body = pose_bytes();
  ASSERT_EQ(client().Post(with_token("/api/live?tracked=1"), body, "application/octet-stream")->status, 200);
  const std::string query = "stage=gaussians&projection=1,0,0,0,0,1,0,0,0,0,1,3";
  const auto live = client().Get(with_token("/api/live?after=0&" + query));
  ASSERT_EQ(live->status, 200) << live->body;
  EXPECT_EQ(live->body.substr(8), body + client().Get(with_token("/api/frame?i=0&" + query))->body);
}

TEST_F(ViewServerTest, RefusesFramesStagesAndPosesThatDoNotExist) {
  for (const char* path : {"/api/frame?i=1&stage=skinning", "/api/frame?i=-1&stage=skinning", "/api/frame?i=0&stage=no",
                           "/api/frame?i=x&stage=skinning", "/api/frame"})
    EXPECT_EQ(status(with_token(path)), 400) << path;
  EXPECT_EQ(client().Post(with_token("/api/pose?stage=skinning"), "abc", "text/plain")->status, 400);
  EXPECT_EQ(client().Post(with_token("/api/joints"), "abc", "text/plain")->status, 400);
}

TEST_F(ViewServerTest, JointsOfSeveralPoses) {
  const Character character = make_test_character();
  std::vector<float> poses;
  for (const float shift : {0.0f, 0.1f})
    for (const double value : character.rest_dofs) poses.push_back(static_cast<float>(value) + shift);
  const std::string body(reinterpret_cast<const char*>(poses.data()), poses.size() * sizeof(float));
  const auto answer = client().Post(with_token("/api/joints"), body, "application/octet-stream");
  ASSERT_EQ(answer->status, 200);
  Kinematics kinematics(character);
  const torch::Tensor dofs = torch::tensor(poses).view({2, character.num_dofs()});
  const torch::Tensor expected = kinematics->joints(dofs).select(-1, 3).contiguous();
  ASSERT_EQ(answer->body.size(), expected.nbytes());
  EXPECT_EQ(std::memcmp(answer->body.data(), expected.data_ptr(), expected.nbytes()), 0);
}

TEST_F(ViewServerTest, PlaysAMotionOfTheVisitor) {
  const Character character = make_test_character();
  const support::TemporaryFolder folder;
  Motion motion;
  for (int frame = 0; frame < 3; ++frame) {
    motion.frames.push_back(character.rest_dofs);
    motion.frames.back()[0] += 0.25 * frame;
    motion.ids.push_back(frame);
  }
  write_motion(folder / "walk.motion", motion);
  const std::string bytes = read_file(folder / "walk.motion", 1 << 20);
  const auto answer = client().Post(with_token("/api/motion?name=walk.motion"), bytes, "application/octet-stream");
  ASSERT_EQ(answer->status, 200) << answer->body;
  EXPECT_EQ(nlohmann::json::parse(answer->body)["frames"], 3);
  EXPECT_EQ(nlohmann::json::parse(client().Get(with_token("/double/description.json"))->body)["frames"], 3);
  const auto rows = client().Get(with_token("/double/motion.bin"));
  ASSERT_EQ(rows->body.size(), 3 * 4 * character.rest_dofs.size());
  EXPECT_EQ(status(with_token("/api/frame?i=2&stage=skinning")), 200);
  EXPECT_EQ(status(with_token("/api/frame?i=3&stage=skinning")), 400);
  // A page that has opened none goes on with the motion of the subject, and the last four stay.
  const auto own = client().Get(with_token("/double/description.json?motion=0"));
  EXPECT_EQ(nlohmann::json::parse(own->body)["frames"], 1);
  EXPECT_EQ(client().Get(with_token("/double/motion.bin?motion=0"))->body.size(), 4 * character.rest_dofs.size());
  EXPECT_EQ(status(with_token("/api/frame?i=2&stage=skinning&motion=0")), 400);
  for (int more = 2; more <= 5; ++more) {
    EXPECT_EQ(status(with_token("/api/frame?i=2&stage=skinning&motion=1")), 200) << more;
    const auto taken = client().Post(with_token("/api/motion?name=walk.motion"), bytes, "application/octet-stream");
    EXPECT_EQ(nlohmann::json::parse(taken->body)["motion"], more);
  }
  EXPECT_EQ(status(with_token("/api/frame?i=2&stage=skinning&motion=1")), 400);
  EXPECT_EQ(status(with_token("/api/frame?i=2&stage=skinning&motion=5")), 200);
}

TEST_F(ViewServerTest, TakesWhatCurlCallsAForm) {
  std::string poses;
  while (poses.size() < 20000) poses += pose_bytes();
  const auto answer = client().Post(with_token("/api/joints"), poses, "application/x-www-form-urlencoded");
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->status, 200) << answer->body;
}

TEST_F(ViewServerTest, KeepsItsMotionWhenTheFileIsWrong) {
  for (const char* name :
       {"walk.motion", "walk", "walk.", "../../x.motion/", "a.b/c", "walk.bvh", "walk.glb", "w.npz"}) {
    const auto answer = client().Post(with_token("/api/motion?name=" + std::string(name)), "no motion", "text/plain");
    ASSERT_TRUE(answer) << name;
    EXPECT_EQ(answer->status, 400) << name;
  }
  const std::string huge(2 << 20, 'x');  // more than other requests may have
  EXPECT_EQ(client().Post(with_token("/api/motion?name=walk.bvh"), huge, "text/plain")->status, 400);
  EXPECT_EQ(nlohmann::json::parse(client().Get(with_token("/double/description.json"))->body)["frames"], 1);
  EXPECT_EQ(status(with_token("/api/frame?i=0&stage=skinning")), 200);
}

TEST_F(ViewServerTest, ATextureNeedsACamera) {
  const std::string numbers = "1,0,0,0,0,1,0,0,0,0,1,3", path = "/api/frame?i=0&stage=textured&projection=";
  const auto answer = client().Get(with_token(path + numbers));
  ASSERT_EQ(answer->status, 200);
  const std::string last = answer->body.substr(answer->body.size() - 16);
  EXPECT_EQ(last, std::string("\x80\x80\x80\xff\x80\x80\x80\xff\x80\x80\x80\xff\x80\x80\x80\xff"));
  for (const std::string& wrong : {std::string(), numbers + ",1", numbers + ",", std::string("1,2"),
                                   std::string("nan,0,0,0,0,1,0,0,0,0,1,3"), "x" + numbers})
    EXPECT_EQ(status(with_token(path + wrong)), 400) << wrong;
}

}  // namespace
}  // namespace doppel::view_server_test
