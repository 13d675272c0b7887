#include "doppel/view/view_server.h"

#include <httplib.h>

#include <charconv>
#include <cmath>
#include <cstring>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/export/animation.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/view/inverse_kinematics.h"
#include "doppel/view/view_mesh.h"
#include "doppel/view/view_page.h"

namespace doppel {
namespace {

constexpr std::size_t kLargestRequest = 1 << 20;
constexpr int kSecondsToWait = 5, kSecondsKeptAlive = 2;
constexpr std::size_t kConnections = 32;  // a browser opens six
// Scripts, pictures and data from this server alone. The page sets styles of its own elements.
constexpr const char* kPolicy =
    "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'";

/// 128 random bits in hexadecimal digits.
std::string random_token() {
  std::random_device source;
  std::string token;
  for (int i = 0; i < 4; ++i) token += fmt::format("{:08x}", source());
  return token;
}

std::string bytes_of(const torch::Tensor& values) {
  const torch::Tensor plain = values.to(torch::kFloat32).contiguous();
  return {reinterpret_cast<const char*>(plain.data_ptr<float>()), plain.nbytes()};
}

template <typename Number>
Number parameter(const httplib::Request& request, const char* name) {
  const std::string text = request.get_param_value(name);
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    fail<UsageError>("the parameter `{}` must be a number", name);
  return value;
}

/// The pose of a request's body. @return [D]
std::vector<double> pose_of(const httplib::Request& request, int num_dofs) {
  if (request.body.size() != as_size(num_dofs) * sizeof(float))
    fail<UsageError>("a pose is {} numbers of 4 bytes, found {} bytes", num_dofs, request.body.size());
  std::vector<float> values(as_size(num_dofs));
  std::memcpy(values.data(), request.body.data(), request.body.size());
  for (const float value : values)
    if (!std::isfinite(value)) fail<UsageError>("a number of the pose is not finite");
  return {values.begin(), values.end()};
}

}  // namespace

struct ViewServer::State {
  ViewSubject subject;
  Kinematics kinematics;
  std::string token = random_token(), mesh, texture;
  httplib::Server server;
  std::mutex networks;  ///< one request at a time runs the networks
  int port = 0;

  explicit State(ViewSubject given) : subject(std::move(given)), kinematics(subject.character) {
    mesh = view_mesh_bytes(split_at_seams(subject.character.mesh));
    std::vector<std::uint8_t> jpeg;
    if (!subject.character.mesh.texture.empty() && cv::imencode(".jpg", subject.character.mesh.texture, jpeg))
      texture.assign(jpeg.begin(), jpeg.end());
  }

  /// Browsers share cookies between ports, so each server has a name of its own.
  std::string cookie() const { return fmt::format("doppel_view_{}", port); }

  nlohmann::json description() const {
    const Skeleton& skeleton = subject.character.skeleton;
    nlohmann::json dofs = nlohmann::json::array(), joints = dofs, stages = dofs;
    for (const Dof& dof : skeleton.dofs) {
      nlohmann::json entry{{"name", dof.name}};
      if (dof.limits) entry["limits"] = {(*dof.limits)[0], (*dof.limits)[1]};
      dofs.push_back(std::move(entry));
    }
    for (const Joint& joint : skeleton.joints) joints.push_back({{"name", joint.name}, {"parent", joint.parent}});
    for (const ViewStage& stage : subject.stages) stages.push_back(stage.name);
    return {{"name", subject.character.name},
            {"vertices", subject.character.num_vertices()},
            {"frames", subject.motion.num_frames()},
            {"frames_per_second", subject.frames_per_second},
            {"textured", !texture.empty()},
            {"rest", subject.character.rest_dofs},
            {"dofs", dofs},
            {"joints", joints},
            {"stages", stages}};
  }

  const ViewStage& stage_of(const httplib::Request& request) const {
    const std::string name = request.get_param_value("stage");
    for (const ViewStage& stage : subject.stages)
      if (stage.name == name) return stage;
    fail<UsageError>("there is no such stage");
  }

  /// Vertices and joints of a motion window [F+1,D].
  std::string geometry(const ViewStage& stage, const torch::Tensor& window) {
    const torch::NoGradGuard no_grad;
    const std::lock_guard lock(networks);
    const torch::Tensor joints = kinematics->joints(window.narrow(0, window.size(0) - 1, 1)).select(-1, 3);
    return bytes_of(stage.vertices(window.unsqueeze(0))) + bytes_of(joints);
  }

  std::string frame(const httplib::Request& request) {
    const ViewStage& stage = stage_of(request);
    const int i = parameter<int>(request, "i");
    if (i < 0 || i >= subject.motion.num_frames())
      fail<UsageError>("the motion has the frames 0..{}", subject.motion.num_frames() - 1);
    return geometry(stage, motion_window(subject.motion, i, stage.past_frames));
  }

  std::string pose(const httplib::Request& request) {
    const ViewStage& stage = stage_of(request);
    const torch::Tensor row = torch::tensor(pose_of(request, subject.character.num_dofs()), torch::kFloat32);
    return geometry(stage, row.unsqueeze(0).repeat({stage.past_frames + 1, 1}));
  }

  std::string reached(const httplib::Request& request) {
    const Eigen::Vector3d target(parameter<double>(request, "x"), parameter<double>(request, "y"),
                                 parameter<double>(request, "z"));
    const std::lock_guard lock(networks);
    ReachResult result = reach(subject.character, pose_of(request, subject.character.num_dofs()),
                               parameter<int>(request, "joint"), target);
    result.dofs.push_back(result.distance);
    return bytes_of(torch::tensor(result.dofs, torch::kFloat64));
  }

  std::string motion_bytes() const {
    std::vector<torch::Tensor> rows;
    for (int f = 0; f < subject.motion.num_frames(); ++f) rows.push_back(motion_window(subject.motion, f, 0));
    return bytes_of(torch::cat(rows));
  }

  /// Whether a request has the token and comes to this address. A page of another site that resolves its name to the
  /// loopback interface has another host.
  bool allowed(const httplib::Request& request) const {
    const std::string host = request.get_header_value("Host"), colon = ":" + std::to_string(port);
    if (host != "127.0.0.1" + colon && host != "localhost" + colon) return false;
    if (request.get_param_value("token") == token) return true;
    return request.get_header_value("Cookie").find(cookie() + "=" + token) != std::string::npos;
  }

  void answer(const char* path, bool post, std::function<std::string(const httplib::Request&)> body,
              const char* type = "application/octet-stream") {
    const auto handler = [body, type](const httplib::Request& request, httplib::Response& response) {
      try {
        response.set_content(body(request), type);
      } catch (const UsageError& e) {
        response.status = 400;
        response.set_content(e.what(), "text/plain");
      } catch (const std::exception& e) {
        response.status = 500;
        response.set_content(e.what(), "text/plain");
      }
    };
    if (post)
      server.Post(path, handler);
    else
      server.Get(path, handler);
  }

  void add_page() {
    for (const ViewPageFile& file : kViewPage) {
      const auto handler = [this, &file](const httplib::Request&, httplib::Response& response) {
        response.set_header("Set-Cookie", fmt::format("{}={}; HttpOnly; SameSite=Strict; Path=/", cookie(), token));
        response.set_content(file.content.data(), file.content.size(), std::string(file.type).c_str());
      };
      server.Get(std::string(file.path), handler);
      if (file.path == "/index.html") server.Get("/", handler);
    }
  }

  void add_interface() {
    answer(
        "/api/description", false, [this](const auto&) { return description().dump(); }, "application/json");
    answer("/api/mesh", false, [this](const auto&) { return mesh; });
    answer("/api/motion", false, [this](const auto&) { return motion_bytes(); });
    answer("/api/frame", false, [this](const httplib::Request& request) { return frame(request); });
    answer("/api/pose", true, [this](const httplib::Request& request) { return pose(request); });
    answer("/api/reach", true, [this](const httplib::Request& request) { return reached(request); });
    if (!texture.empty())
      answer(
          "/api/texture", false, [this](const auto&) { return texture; }, "image/jpeg");
  }

  void set_up() {
    // The library's default lets a second program share the port.
    server.set_socket_options([](socket_t socket) {
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    server.set_payload_max_length(kLargestRequest);
    server.set_read_timeout(kSecondsToWait);
    server.set_write_timeout(kSecondsToWait);
    server.set_keep_alive_timeout(kSecondsKeptAlive);
    server.new_task_queue = [] { return new httplib::ThreadPool(kConnections); };
    server.set_default_headers({{"Content-Security-Policy", kPolicy},
                                {"X-Content-Type-Options", "nosniff"},
                                {"Referrer-Policy", "no-referrer"},
                                {"Cache-Control", "no-store"}});
    server.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      if (allowed(request)) return httplib::Server::HandlerResponse::Unhandled;
      response.status = 403;
      response.set_content("This page needs the token of its address; see the output of `doppel view`.", "text/plain");
      return httplib::Server::HandlerResponse::Handled;
    });
    add_page();
    add_interface();
  }
};

ViewServer::ViewServer(ViewSubject subject, int port) : state_(std::make_unique<State>(std::move(subject))) {
  state_->set_up();
  if (port == 0)
    state_->port = state_->server.bind_to_any_port("127.0.0.1");
  else if (state_->server.bind_to_port("127.0.0.1", port))
    state_->port = port;
  if (state_->port <= 0) fail("viewing: port {} is taken or not allowed; --port 0 takes any free port", port);
  url_ = fmt::format("http://127.0.0.1:{}/?token={}", state_->port, state_->token);
}

ViewServer::~ViewServer() = default;

void ViewServer::serve() { state_->server.listen_after_bind(); }
void ViewServer::stop() { state_->server.stop(); }

}  // namespace doppel
