#include "program.h"

#include <ATen/Parallel.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <new>
#include <opencv2/core/utility.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "doppel/core/config.h"
#include "doppel/core/error.h"
#include "doppel/core/isa_choice.h"
#include "doppel/core/log.h"
#include "doppel/core/process.h"
#include "number_checks.h"

namespace doppel::tools {
namespace {

void add_common_options(Command& command, CommonOptions& common, std::string& shard) {
  command.app->add_option("--threads", common.threads, "Threads to use (0: OMP_NUM_THREADS, or the granted cores)")
      ->capture_default_str();
  command.app->add_flag("--json", common.json, "Print results to stdout as one JSON object");
  command.app->add_option("--log-level", common.log_level, "trace, debug, info, warn, error or off")
      ->capture_default_str();
  if (command.in_shards)
    command.app->add_option("--shard", shard,
                            "Do part i of n of the work, i from 0, e.g. 0/4; each into its own --out; `doppel merge` "
                            "joins them (docs/clusters.md)");
  for (Command& subcommand : command.subcommands) add_common_options(subcommand, common, shard);
}

/// The command, or its subcommand, that the command line names.
const Command& parsed_command(const std::vector<Command>& commands) {
  const auto found = std::find_if(commands.begin(), commands.end(), [](const Command& c) { return c.app->parsed(); });
  const auto& inner = found->subcommands;
  return std::any_of(inner.begin(), inner.end(), [](const Command& c) { return c.app->parsed(); })
             ? parsed_command(inner)
             : *found;
}

/// The commands and what one command line says.
class Program {
 public:
  Program() {
    app_.set_version_flag("--version", DOPPEL_VERSION);
    app_.require_subcommand(1);
    commands_ = {add_make(app_),    add_synth(app_),    add_calibrate(app_), add_capture(app_), add_character(app_),
                 add_prepare(app_), add_detect(app_),   add_doctor(app_),    add_track(app_),   add_train(app_),
                 add_adapt(app_),   add_evaluate(app_), add_merge(app_),     add_compare(app_), add_animate(app_),
                 add_export(app_),  add_view(app_),     add_info(app_)};
    for (Command& command : commands_) add_common_options(command, common_, shard_);
    refuse_not_finite(app_);
  }

  /// @throws CLI::ParseError
  void parse(int argc, const char* const* argv) {
    app_.parse(argc, argv);
    common_.words.assign(argv + 1, argv + argc);
  }
  /// @throws UsageError when --shard is wrong
  int run() {
    if (!shard_.empty()) common_.shard = parse_shard(shard_);
    setup_logging(common_.log_level);
    check_isa();
    const int threads = resolve_threads(common_.threads);
    at::set_num_threads(threads);
    cv::setNumThreads(threads);
    const Command& command = parsed_command(commands_);
    if ((common_.shard || !common_.merged.empty()) && !command.in_shards)
      fail<UsageError>("--shard: the work of `doppel {} {}` is not cut into shards; leave --shard out",
                       command.app->get_parent()->get_name(), command.app->get_name());
    return command.run(common_);
  }

  /// Names the commands that know options which another one was given.
  std::string hint() const {
    const CLI::App* command = app_.get_subcommands().front();
    std::vector<const CLI::App*> known = command->get_subcommands({});
    known.push_back(command);
    std::string text;
    for (const std::string& word : app_.remaining(true)) {
      const std::string option = word.substr(0, word.find('='));
      if (option.rfind("--", 0) != 0) continue;
      for (const CLI::App* app : known)
        if (app->get_option_no_throw(option))
          text += fmt::format("{} is an option of `doppel {}{}`\n", option,
                              app == command ? "" : command->get_name() + " ", app->get_name());
    }
    return text;
  }

  /// What is wrong with a word that stands where a command should; empty when there is no such word.
  std::string wrong_command(int argc, const char* const* argv) const {
    const CLI::App* app = &app_;
    std::string line = "doppel";
    for (int i = 1; i < argc && argv[i][0] != '-'; ++i) {
      const std::vector<const CLI::App*> commands = app->get_subcommands({});
      const auto next = std::find_if(commands.begin(), commands.end(),
                                     [&](const CLI::App* command) { return command->check_name(argv[i]); });
      if (next == commands.end() && app->get_require_subcommand_min() > 0) {
        std::vector<std::string> known;
        for (const CLI::App* command : commands) known.push_back(command->get_name());
        const std::string hint = nearest_word_hint(argv[i], known);
        return fmt::format("`{} {}`: there is no such command{}", line, argv[i],
                           hint.empty() ? "; `" + line + " --help` lists them" : hint);
      }
      if (next == commands.end()) break;
      app = *next;
      line += std::string(" ") + argv[i];
    }
    return "";
  }

  CLI::App& app() { return app_; }
  CommonOptions& common() { return common_; }

 private:
  CLI::App app_{"Doppel turns calibrated multi-view video of a person into an actor", "doppel"};
  CommonOptions common_;
  std::string shard_;
  std::vector<Command> commands_;
};

/// A message without control characters: names and lines of files from outside stand in it, and a terminal obeys them.
std::string printable(std::string_view message) {
  std::string text;
  for (const char c : message) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte < 0x20 && c != '\n' && c != '\t') || byte == 0x7f)
      text += fmt::format("\\x{:02x}", byte);
    else
      text += c;
  }
  return text;
}

void print_error(const std::exception& e) { std::fprintf(stderr, "doppel: %s\n", printable(e.what()).c_str()); }

int parse_and_run(int argc, const char* const* argv) {
  Program program;
  try {
    program.parse(argc, argv);
  } catch (const CLI::ExtrasError& e) {
    program.app().exit(e);
    std::fputs(printable(program.hint()).c_str(), stderr);
    return 2;
  } catch (const CLI::RequiredError& e) {
    const std::string wrong = program.wrong_command(argc, argv);
    if (!wrong.empty()) fail<UsageError>("{}", wrong);
    return program.app().exit(e) == 0 ? 0 : 2;
  } catch (const CLI::ParseError& e) {
    return program.app().exit(e) == 0 ? 0 : 2;
  }
  return program.run();
}

}  // namespace

int run_program(int argc, const char* const* argv) {
  try {
    return parse_and_run(argc, argv);
  } catch (const UsageError& e) {
    print_error(e);
    return 2;
  } catch (const std::bad_alloc&) {
    std::fputs("doppel: the memory is not enough for this work\n", stderr);
    return 1;
  } catch (const std::exception& e) {
    print_error(e);
    return 1;
  }
}

int run_on_shards(const ShardSet& shards, const std::filesystem::path& out, const CommonOptions& common) {
  std::vector<std::string> words{"doppel"};
  const std::vector<std::string>& arguments = shards.files.at(0).arguments;
  words.insert(words.end(), arguments.begin(), arguments.end());
  for (const std::string& word : {std::string("--out"), out.string(), std::string("--threads"),
                                  std::to_string(common.threads), std::string("--log-level"), common.log_level})
    words.push_back(word);
  std::vector<const char*> argv;
  for (const std::string& word : words) argv.push_back(word.c_str());
  Program program;
  try {
    program.parse(static_cast<int>(argv.size()), argv.data());
  } catch (const CLI::ParseError& e) {
    fail<UsageError>("{}: the arguments of the shard cannot be read: {}", shards.folders.at(0).string(), e.what());
  }
  program.common().merged = shards;
  return program.run();
}

}  // namespace doppel::tools
