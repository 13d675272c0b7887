#include "doppel/view/view_server.h"

#include <httplib.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>

#include "doppel/actor/export/animation.h"
#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "doppel/core/scratch_folder.h"
#include "doppel/layers/kinematics/kinematics.h"
#include "doppel/view/live_poses.h"
#include "doppel/view/view_connections.h"
#include "doppel/view/view_files.h"
#include "doppel/view/view_page.h"
#include "doppel/view/view_training.h"

namespace doppel {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxRequestBytes = 1 << 20, kMaxMotionBytes = 64 << 20;
constexpr std::size_t kMaxMotions = 4;  ///< of visitors, that are kept
constexpr std::chrono::milliseconds kLivePatience = kLiveBreak;
constexpr const char* kTokenHeader = "Doppel-Token";
// Scripts, images and data from this server alone. The page sets styles of its own elements.
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

/// Colours 0..1 as bytes. @param texture [1,T,T,3] @return [T,T,4], opaque
std::string texel_bytes(const torch::Tensor& texture) {
  const torch::Tensor bytes =
      torch::constant_pad_nd(texture[0].clamp(0.0, 1.0), {0, 1}, 1.0).mul(255.0).round().to(torch::kUInt8).contiguous();
  return {reinterpret_cast<const char*>(bytes.data_ptr<std::uint8_t>()), bytes.nbytes()};
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

/// The poses in a request's body. @return [B,D]
torch::Tensor poses_of(const httplib::Request& request, std::int64_t num_dofs) {
  const std::size_t row = as_size(num_dofs) * sizeof(float);
  if (request.body.empty() || request.body.size() % row != 0)
    fail<UsageError>("a pose is {} numbers of 4 bytes, found {} bytes", num_dofs, request.body.size());
  const auto poses = torch::empty({static_cast<std::int64_t>(request.body.size() / row), num_dofs});
  std::memcpy(poses.data_ptr<float>(), request.body.data(), request.body.size());
  if (!poses.isfinite().all().item<bool>()) fail<UsageError>("a number of the pose is not finite");
  return poses;
}

/// The camera of a request, `projection=` and twelve numbers with commas between them. @return [1,3,4]
torch::Tensor projection_of(const httplib::Request& request) {
  const std::string text = request.get_param_value("projection");
  std::vector<float> values;
  const char *at = text.data(), *const end = at + text.size();
  for (float value = 0.0f; at < end;) {
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc() || !std::isfinite(value) || (next != end && (*next != ',' || next + 1 == end))) break;
    values.push_back(value);
    at = next == end ? end : next + 1;
  }
  if (at != end || values.size() != 12)
    fail<UsageError>("the parameter `projection` is twelve numbers with commas between them");
  return torch::tensor(values).view({1, 3, 4});
}

/// The extension of a motion file's name, and nothing else of it, so that the name cannot lead anywhere.
std::string safe_extension(const std::string& name) {
  const std::string extension = fs::path(name).extension().string();
  const bool plain =
      extension.size() >= 2 && extension.size() <= 8 &&
      std::all_of(extension.begin() + 1, extension.end(), [](unsigned char c) { return std::isalnum(c); });
  if (!plain) fail<UsageError>("a motion file needs an extension such as .bvh or .motion");
  return extension;
}

/// How many poses the longest window of the stages has.
std::size_t longest_window(const std::vector<ViewStage>& stages) {
  int past = 0;
  for (const ViewStage& stage : stages) past = std::max(past, stage.past_frames);
  return as_size(past) + 1;
}

/// The newest poses as a motion window; before the first one, all rows are that one. @return [F+1,D]
torch::Tensor live_window(const std::vector<std::vector<float>>& rows, int past_frames) {
  std::vector<torch::Tensor> window;
  for (int back = past_frames; back >= 0; --back) {
    const std::size_t last = rows.size() - 1;
    window.push_back(torch::tensor(rows[last - std::min(last, as_size(back))]));
  }
  return torch::stack(window);
}

}  // namespace

struct ViewServer::State {
  /// A motion that is played, and the files that say so.
  struct Shown {
    int number = 0;  ///< 0: the subject's own motion
    Motion motion;
    std::vector<long> cuts;
    ViewFiles files;
  };
  using ShownPointer = std::shared_ptr<const Shown>;

  ViewSubject subject;
  Kinematics kinematics{nullptr};  ///< none without a character
  ShownPointer own;
  std::mutex motions;                    ///< guards `of_visitors` and `num_taken`
  std::deque<ShownPointer> of_visitors;  ///< the newest last
  int num_taken = 0;
  std::string token = random_token();
  ViewConnections server;
  LivePoses live;
  std::mutex networks;  ///< one request at a time runs the networks
  int port = 0;

  explicit State(ViewSubject given) : subject(std::move(given)), live(longest_window(subject.stages)) {
    if (!subject.sequence) kinematics = Kinematics(subject.character);
    own = std::make_shared<const Shown>(Shown{0, subject.motion, subject.cuts, view_files(subject, subject.motion)});
  }

  /// Each page plays its own motion, of which it names the number; without one, the newest motion is meant.
  ShownPointer shown_of(const httplib::Request& request) {
    const std::lock_guard lock(motions);
    if (!request.has_param("motion")) return of_visitors.empty() ? own : of_visitors.back();
    const int number = parameter<int>(request, "motion");
    if (number == 0) return own;
    for (const ShownPointer& shown : of_visitors)
      if (shown->number == number) return shown;
    fail<UsageError>("motion {} is no longer kept, because others were opened; open its file again", number);
  }

  ShownPointer keep(Motion motion) {
    const std::lock_guard lock(motions);
    const int number = ++num_taken;
    ViewFiles files = view_files(subject, motion, number);
    of_visitors.push_back(std::make_shared<const Shown>(Shown{number, std::move(motion), {}, std::move(files)}));
    if (of_visitors.size() > kMaxMotions) of_visitors.pop_front();
    return of_visitors.back();
  }

  /// The character, for requests that need one.
  const Character& character() const {
    if (subject.sequence) fail<UsageError>("{} has no character", subject.sequence->name);
    return subject.character;
  }

  const ViewStage& stage_of(const httplib::Request& request) const {
    character();
    const std::string name = request.get_param_value("stage");
    for (const ViewStage& stage : subject.stages)
      if (stage.name == name) return stage;
    fail<UsageError>("there is no such stage");
  }

  /// @param dofs [B,D] @return positions [B,J,3], world metres
  torch::Tensor joints(const torch::Tensor& dofs) { return kinematics->joints(dofs).select(-1, 3); }

  /// The answer for a motion window [F+1,D].
  std::string geometry(const ViewStage& stage, const httplib::Request& request, const torch::Tensor& window) {
    const torch::NoGradGuard no_grad;
    const std::lock_guard lock(networks);
    const torch::Tensor windows = window.unsqueeze(0);
    const torch::Tensor vertices = stage.vertices(windows);
    std::string bytes = bytes_of(vertices) + bytes_of(joints(window.narrow(0, window.size(0) - 1, 1)));
    if (stage.texture) bytes += texel_bytes(stage.texture(windows, projection_of(request), vertices));
    if (stage.gaussians) bytes += bytes_of(stage.gaussians(windows, projection_of(request), vertices));
    return bytes;
  }

  std::string frame(const httplib::Request& request) {
    const ViewStage& stage = stage_of(request);
    const int i = parameter<int>(request, "i");
    const ShownPointer shown = shown_of(request);
    if (i < 0 || i >= shown->motion.num_frames())
      fail<UsageError>("the motion has the frames 0..{}", shown->motion.num_frames() - 1);
    return geometry(stage, request, motion_window(shown->motion, i, stage.past_frames, shown->cuts));
  }

  /// @return [1,D]
  torch::Tensor one_pose(const httplib::Request& request) const {
    torch::Tensor row = poses_of(request, character().num_dofs());
    if (row.size(0) != 1) fail<UsageError>("one pose is needed, found {}", row.size(0));
    return row;
  }

  std::string pose(const httplib::Request& request) {
    const ViewStage& stage = stage_of(request);
    const torch::Tensor row = one_pose(request);
    return geometry(stage, request, row.repeat({stage.past_frames + 1, 1}));
  }

  std::string take_live(const httplib::Request& request) {
    const torch::Tensor row = one_pose(request);
    const float* values = row.data_ptr<float>();
    live.push({values, values + row.numel()}, parameter<int>(request, "tracked") != 0);
    return {};
  }

  std::string newest_live(const httplib::Request& request) {
    const ViewStage& stage = stage_of(request);
    const auto latest = live.newer_than(parameter<std::uint32_t>(request, "after"), kLivePatience);
    if (!latest) return {};
    const std::uint32_t head[] = {latest->number, latest->tracked};
    const std::vector<float>& dofs = latest->rows.back();
    std::string bytes(reinterpret_cast<const char*>(head), sizeof(head));
    bytes.append(reinterpret_cast<const char*>(dofs.data()), dofs.size() * sizeof(float));
    return bytes + geometry(stage, request, live_window(latest->rows, stage.past_frames));
  }

  std::string joint_bytes(const httplib::Request& request) {
    const torch::NoGradGuard no_grad;
    return bytes_of(joints(poses_of(request, character().num_dofs())));
  }

  ViewCameras& cameras() {
    if (!subject.cameras) fail<UsageError>("no camera filmed this motion");
    return *subject.cameras;
  }

  std::string image(const httplib::Request& request) {
    const long frame = parameter<long>(request, "frame");
    const long frames = subject.sequence ? subject.sequence->frames : subject.motion.num_frames();
    if (frame < 0 || frame >= frames) fail<UsageError>("the capture has the frames 0..{}", frames - 1);
    const long row = frame + (subject.sequence ? subject.sequence->first_row : 0);
    return cameras().image(parameter<int>(request, "camera"), row, parameter<int>(request, "mask") != 0);
  }

  const fs::path& run() const {
    if (subject.run.empty()) fail<UsageError>("no run is shown");
    return subject.run;
  }

  /// Plays the motion file of the request's body from now on.
  std::string take_motion(const httplib::Request& request) {
    character();
    const std::string name = request.get_param_value("name");
    const ScratchFolder folder;
    const fs::path file = folder.path() / ("motion" + safe_extension(name));
    std::ofstream(file, std::ios::binary) << request.body;
    try {
      Motion motion = motion_for(subject, file);
      if (motion.num_frames() == 0) fail("it has no frame");
      const ShownPointer shown = keep(std::move(motion));
      return nlohmann::json{{"frames", shown->motion.num_frames()}, {"motion", shown->number}}.dump();
    } catch (const std::exception& e) {
      fail<UsageError>("{} is not played: {}", name, e.what());
    }
  }

  /// Whether the browser says that a page of another site or port has sent the request. It may link to the address.
  static bool is_foreign(const httplib::Request& request) {
    const std::string origin = request.get_header_value("Origin"), site = request.get_header_value("Sec-Fetch-Site");
    if (!origin.empty()) return origin != "http://" + request.get_header_value("Host");
    const bool own = site.empty() || site == "same-origin" || site == "none";
    return !own && !(request.method == "GET" && request.get_header_value("Sec-Fetch-Mode") == "navigate");
  }

  /// Whether a request has the token. A browser sends a header to another site or port only when the site allows that,
  /// and this one does not, so what changes something needs the header where a browser asks.
  bool has_token(const httplib::Request& request) const {
    if (request.has_header(kTokenHeader)) return request.get_header_value(kTokenHeader) == token;
    const bool by_browser = request.has_header("Origin") || request.has_header("Sec-Fetch-Site");
    return !(by_browser && request.method == "POST") && request.get_param_value("token") == token;
  }

  /// Why a request is refused; empty: it is not. A page of another site that resolves its name to the loopback
  /// interface has another host.
  std::string refusal(const httplib::Request& request) const {
    // Clients leave out the port that is usual for HTTP.
    std::string host = request.get_header_value("Host"), colon = ":" + std::to_string(port);
    if (port == 80 && !host.ends_with(colon)) host += colon;
    if (host != "127.0.0.1" + colon && host != "localhost" + colon)
      return "This server is for 127.0.0.1 alone; open the address that `doppel view` prints.";
    if (is_foreign(request))
      return "A page of another site or port has sent this request; open the address that `doppel view` prints.";
    if (!has_token(request))
      return fmt::format(
          "This request needs the token of the address that `doppel view` prints, as `?token=` or, from "
          "a page that posts, in the header {}.",
          kTokenHeader);
    return {};
  }

  void answer(const char* path, bool post, const std::function<std::string(const httplib::Request&)>& body,
              const char* type = "application/octet-stream", std::size_t largest = kMaxRequestBytes) {
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
    if (!post) {
      server.Get(path, handler);
      return;
    }
    server.Post(path, [handler, largest](const httplib::Request& request, httplib::Response& response) {
      if (request.body.size() > largest) {
        response.status = 413;
        response.set_content(
            fmt::format("{} bytes are too many; at most {} are taken here", request.body.size(), largest),
            "text/plain");
      } else {
        handler(request, response);
      }
    });
  }

  /// The page names its script and its style; a browser loads them without a header, so their addresses get the token.
  std::string with_token(std::string page) const {
    for (const ViewPageFile& file : kViewPage) {
      const std::string address = fmt::format("\".{}", file.path);
      const std::size_t at = page.find(address + '"');
      if (at != std::string::npos) page.insert(at + address.size(), "?token=" + token);
    }
    return page;
  }

  void add_page() {
    for (const ViewPageFile& file : kViewPage) {
      const auto handler = [this, &file](const httplib::Request&, httplib::Response& response) {
        const std::string content(file.content);
        response.set_content(file.type == "text/html" ? with_token(content) : content, std::string(file.type));
      };
      server.Get(std::string(file.path), handler);
      if (file.path == "/index.html") server.Get("/", handler);
    }
  }

  void add_interface() {
    const auto file = [this](const char* path, std::string ViewFiles::*bytes, const char* type) {
      answer(
          path, false, [this, bytes](const auto& request) { return shown_of(request)->files.*bytes; }, type);
    };
    file("/double/description.json", &ViewFiles::description, "application/json");
    file("/double/mesh.bin", &ViewFiles::mesh, "application/octet-stream");
    file("/double/motion.bin", &ViewFiles::motion, "application/octet-stream");
    if (!own->files.texture.empty()) file("/double/texture.jpg", &ViewFiles::texture, "image/jpeg");
    if (subject.sequence) file("/double/points.bin", &ViewFiles::points, "application/octet-stream");
    answer("/api/frame", false, [this](const httplib::Request& request) { return frame(request); });
    answer("/api/pose", true, [this](const httplib::Request& request) { return pose(request); });
    answer("/api/joints", true, [this](const httplib::Request& request) { return joint_bytes(request); });
    answer("/api/live", true, [this](const httplib::Request& request) { return take_live(request); });
    answer("/api/live", false, [this](const httplib::Request& request) { return newest_live(request); });
    add_footage();
    answer(
        "/api/motion", true, [this](const httplib::Request& request) { return take_motion(request); },
        "application/json", kMaxMotionBytes);
  }

  /// Images of cameras, and the training of a run.
  void add_footage() {
    using Request = httplib::Request;
    answer(
        "/api/cameras", false, [this](const Request&) { return cameras().description(); }, "application/json");
    answer(
        "/api/picture", false, [this](const Request& request) { return image(request); }, "image/jpeg");
    answer(
        "/api/training", false, [this](const Request&) { return training_state(run()); }, "application/json");
    answer(
        "/api/training_image", false,
        [this](const Request& request) {
          return training_image(run(), parameter<int>(request, "stage"), parameter<int>(request, "image"));
        },
        "image/jpeg");
  }

  void set_up() {
    server.set_payload_max_length(kMaxMotionBytes);
    server.set_default_headers({{"Content-Security-Policy", kPolicy},
                                {"X-Content-Type-Options", "nosniff"},
                                {"Referrer-Policy", "no-referrer"},
                                {"Cache-Control", "no-store"}});
    server.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      const std::string reason = refusal(request);
      if (reason.empty()) return ViewConnections::HandlerResponse::Unhandled;
      response.status = 403;
      response.set_content(reason, "text/plain");
      if (request.method != "GET") response.set_header("Connection", "close");  // nobody reads its body
      return ViewConnections::HandlerResponse::Handled;
    });
    add_page();
    add_interface();
  }
};

ViewServer::ViewServer(ViewSubject subject, int port) : state_(std::make_unique<State>(std::move(subject))) {
  state_->set_up();
  const std::optional<int> bound = state_->server.bind(port);
  if (!bound) fail("viewing: port {} is taken or not allowed; --port 0 takes any free port", port);
  state_->port = *bound;
  url_ = fmt::format("http://127.0.0.1:{}/?token={}", state_->port, state_->token);
}

ViewServer::~ViewServer() = default;

void ViewServer::serve() { state_->server.serve(); }
void ViewServer::stop() {
  state_->live.close();
  state_->server.stop();
}

}  // namespace doppel
