#include <chrono>
#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>
#include <thread>

#include "command.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "doppel/view/view_server.h"

namespace doppel::tools {
namespace {

struct ViewArguments {
  std::string target, motion, character, capture;
  int port = 0;
  bool no_open = false;
};

void announce(const std::string& url, const ViewArguments& arguments, const CommonOptions& common) {
  if (common.json)
    std::cout << nlohmann::json{{"url", url}}.dump() << std::endl;
  else
    std::cout << "open " << url << " in a browser; Ctrl-C ends" << std::endl;
  // The address is made of digits and letters of this program alone.
  if (!arguments.no_open && std::system(("xdg-open '" + url + "' >/dev/null 2>&1 &").c_str()) != 0)
    log::info("no browser was opened");
}

int run(const ViewArguments& arguments, const CommonOptions& common) {
  ViewOptions options;
  options.motion = arguments.motion;
  options.character = arguments.character;
  options.capture = arguments.capture;
  ViewServer server(open_view_subject(arguments.target, options), arguments.port);
  announce(server.url(), arguments, common);
  std::thread serving([&] { server.serve(); });
  while (!stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  server.stop();
  serving.join();
  return 0;
}

}  // namespace

Command add_view(CLI::App& program) {
  auto arguments = std::make_shared<ViewArguments>();
  CLI::App* app = program.add_subcommand(
      "view",
      "Show an actor in the browser: play its motion, pose it by hand; or a capture before its character is made");
  app->add_option("target", arguments->target,
                  "A run, an exported actor (.pt), a .character file, a capture (with or without a character) or a "
                  "prepared capture")
      ->required();
  app->add_option("--motion", arguments->motion,
                  "The motion to play, as for `doppel animate` (default: that of the capture)");
  app->add_option("--character", arguments->character, "The character of an exported actor");
  app->add_option("--capture", arguments->capture, "The prepared capture of a run, if it was moved");
  app->add_option("--port", arguments->port, "Port on 127.0.0.1; 0: any free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  app->add_flag("--no-open", arguments->no_open, "Open no browser");
  app->footer(
      "Examples:\n"
      "  doppel view runs/anna\n"
      "  doppel view anna/actor.character --motion walk.bvh\n"
      "  doppel view RUN --port 0 --no-open --json      # {\"url\": \"http://127.0.0.1:PORT/?token=...\"}");
  return {app, [arguments](const CommonOptions& common) { return run(*arguments, common); }};
}

}  // namespace doppel::tools
