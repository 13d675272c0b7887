#include "versions.h"

#include <ATen/Parallel.h>
#include <dlfcn.h>
#include <fmt/format.h>
#include <spdlog/version.h>
#include <torch/version.h>

#include <Eigen/Core>
#include <opencv2/core/utility.hpp>
#include <string>

#include "doppel/core/cpu_dispatch.h"

namespace doppel::tools {
namespace {

/// What OpenBLAS says of itself, core included, e.g. "OpenBLAS 0.3.21 NO_LAPACKE DYNAMIC_ARCH NO_AFFINITY SkylakeX
/// MAX_THREADS=64". LibTorch works with any BLAS, so OpenBLAS is asked only where it is loaded.
std::string describe_blas() {
  using Config = const char* (*)();
  const auto config = reinterpret_cast<Config>(dlsym(RTLD_DEFAULT, "openblas_get_config"));
  return config ? config() : "not OpenBLAS";
}

std::string compiler() {
#if defined(__clang__)
  return "Clang " __clang_version__;
#else
  return "GCC " __VERSION__;
#endif
}

}  // namespace

nlohmann::ordered_json describe_versions() {
  return {{"doppel", DOPPEL_VERSION},
          {"libtorch", TORCH_VERSION},
          {"opencv", cv::getVersionString()},
          {"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
          {"yaml_cpp", DOPPEL_YAML_CPP_VERSION},
          {"spdlog", fmt::format("{}.{}.{}", SPDLOG_VER_MAJOR, SPDLOG_VER_MINOR, SPDLOG_VER_PATCH)},
          {"blas", describe_blas()},
          {"compiler", compiler()},
          {"instruction_set", isa_name(cpu_isa())},
          {"threads", at::get_num_threads()}};
}

}  // namespace doppel::tools
