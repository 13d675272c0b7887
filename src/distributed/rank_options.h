#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>

namespace doppel {

/// Which rank of how many this process is, and where the ranks meet.
struct RankOptions {
  int rank = 0, world = 1;
  std::string host;                               ///< of rank 0
  int port = 29500;                               ///< on which rank 0 keeps the notes of the ranks
  bool keeps_notes = true;                        ///< rank 0 opens the port; false: the launcher did (torchrun)
  std::string attempt = "0";                      ///< tells a restart by the launcher from the attempt before
  std::chrono::milliseconds join_limit{300'000};  ///< how long ranks wait for each other at the start
  std::chrono::milliseconds dead_after{30'000};   ///< a rank without a sign of life for so long is taken for dead
};

/// What the command line says about ranks; empty: nothing.
struct RankFlags {
  std::string nodes;  ///< host:port of rank 0
  std::optional<int> rank, world;
};

/// The value of an environment variable; nothing when it is not set.
using Environment = std::function<std::optional<std::string>(const char*)>;
/// That of this process.
std::optional<std::string> process_environment(const char* name);

/// The first of these that is there: the flags; RANK and WORLD_SIZE (torchrun); OMPI_COMM_WORLD_RANK and
/// OMPI_COMM_WORLD_SIZE (mpirun); SLURM_PROCID and SLURM_NTASKS (srun). Without flags, MASTER_ADDR and MASTER_PORT say
/// where rank 0 is. One rank, if nothing is there.
/// @throws UsageError naming the flag or variable
RankOptions read_rank_options(const RankFlags& flags, const Environment& environment = process_environment);

}  // namespace doppel
