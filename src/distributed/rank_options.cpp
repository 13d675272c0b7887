#include "doppel/distributed/rank_options.h"

#include <charconv>
#include <cstdlib>
#include <vector>

#include "doppel/core/error.h"

namespace doppel {

namespace {

constexpr int kMaxRanks = 4096;

/// The names under which a launcher gives rank and world.
struct Names {
  const char *rank, *world;
};
constexpr Names kLaunchers[] = {
    {"RANK", "WORLD_SIZE"}, {"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"}, {"SLURM_PROCID", "SLURM_NTASKS"}};

int whole_number(const std::string& name, const std::string& text, int low, int high) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < low || value > high)
    fail<UsageError>("{} is `{}`; it must be a whole number from {} to {}", name, text, low, high);
  return value;
}

void read_nodes(const std::string& nodes, RankOptions& options) {
  const auto colon = nodes.rfind(':');
  if (colon == std::string::npos || colon == 0)
    fail<UsageError>("--nodes {}: it must be HOST:PORT of rank 0, for example --nodes 10.0.0.1:29500", nodes);
  options.host = nodes.substr(0, colon);
  options.port = whole_number("--nodes: the port", nodes.substr(colon + 1), 1, 65535);
}

void set_rank(RankOptions& options, int rank, int world, const std::string& rank_name, const std::string& world_name) {
  if (rank >= world)
    fail<UsageError>("{} is {} and {} is {}; ranks are counted from 0, so the last one is {}", rank_name, rank,
                     world_name, world, world - 1);
  options.rank = rank;
  options.world = world;
}

void read_flags(const RankFlags& flags, RankOptions& options) {
  if (!flags.rank || !flags.world || (flags.nodes.empty() && *flags.world > 1))
    fail<UsageError>("several ranks need --nodes HOST:PORT, --rank and --world together");
  if (*flags.world < 1 || *flags.world > kMaxRanks || *flags.rank < 0)
    fail<UsageError>("--rank {} --world {}: there are 1 to {} ranks, counted from 0", *flags.rank, *flags.world,
                     kMaxRanks);
  set_rank(options, *flags.rank, *flags.world, "--rank", "--world");
  if (!flags.nodes.empty()) read_nodes(flags.nodes, options);
}

void read_master(const Environment& environment, const Names& names, RankOptions& options) {
  const auto host = environment("MASTER_ADDR"), port = environment("MASTER_PORT");
  if (!host || host->empty())
    fail<UsageError>(
        "{} is {}, so this is rank {} of {}, and MASTER_ADDR is not set; set it to the name or address of the machine "
        "of rank 0, or train alone with --rank 0 --world 1",
        names.world, options.world, options.rank, options.world);
  options.host = *host;
  if (port) options.port = whole_number("MASTER_PORT", *port, 1, 65535);
  options.keeps_notes = environment("TORCHELASTIC_USE_AGENT_STORE").value_or("") != "True";
  options.attempt = environment("TORCHELASTIC_RESTART_COUNT").value_or("0");
}

}  // namespace

std::optional<std::string> process_environment(const char* name) {
  const char* value = std::getenv(name);
  return value ? std::optional<std::string>(value) : std::nullopt;
}

RankOptions read_rank_options(const RankFlags& flags, const Environment& environment) {
  RankOptions options;
  if (flags.rank || flags.world || !flags.nodes.empty()) {
    read_flags(flags, options);
    return options;
  }
  for (const Names& names : kLaunchers) {
    const auto rank = environment(names.rank), world = environment(names.world);
    if (!rank || !world) continue;
    set_rank(options, whole_number(names.rank, *rank, 0, kMaxRanks - 1),
             whole_number(names.world, *world, 1, kMaxRanks), names.rank, names.world);
    if (options.world > 1) read_master(environment, names, options);
    return options;
  }
  return options;
}

}  // namespace doppel
