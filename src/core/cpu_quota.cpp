#include "doppel/core/cpu_quota.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <string>
#include <thread>

#if defined(__linux__)
#include <sched.h>
#endif

namespace doppel {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

/// Cores that a quota per period comes to.
double cores_of(double quota, double period) { return quota > 0.0 && period > 0.0 ? quota / period : kNoLimit; }

/// The quota of one group; a file of version 2 says "max" where there is none, one of version 1 says -1.
double quota_of(const std::filesystem::path& group) {
  double quota = 0.0, period = 0.0;
  if (std::ifstream both(group / "cpu.max"); both >> quota >> period) return cores_of(quota, period);
  std::ifstream quotas(group / "cpu.cfs_quota_us"), periods(group / "cpu.cfs_period_us");
  return quotas >> quota && periods >> period ? cores_of(quota, period) : kNoLimit;
}

/// The least quota of `group` and of all groups above it. In a container the path might be that of the host; the
/// folders that then do not exist count as no limit.
double least_quota(const std::filesystem::path& mount, std::filesystem::path group) {
  double least = quota_of(mount);
  for (; group.has_relative_path(); group = group.parent_path())
    least = std::min(least, quota_of(mount / group.relative_path()));
  return least;
}

/// Whether `controllers`, such as "cpu,cpuacct", names the controller of time.
bool has_cpu(const std::string& controllers) { return ("," + controllers + ",").find(",cpu,") != std::string::npos; }

int affinity_cores() {
#if defined(__linux__)
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof(set), &set) == 0 && CPU_COUNT(&set) > 0) return CPU_COUNT(&set);
#endif
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

}  // namespace

int granted_cores(const std::filesystem::path& groups, const std::filesystem::path& mounts) {
  double least = kNoLimit;
  std::ifstream lines(groups);
  for (std::string number, controllers, group;
       std::getline(lines, number, ':') && std::getline(lines, controllers, ':') && std::getline(lines, group);) {
    if (controllers.empty()) least = std::min(least, least_quota(mounts, group));
    if (!has_cpu(controllers)) continue;
    least = std::min({least, least_quota(mounts / controllers, group), least_quota(mounts / "cpu", group)});
  }
  return least < 1e6 ? std::max(1, static_cast<int>(std::ceil(least))) : 0;
}

int available_cores() {
  const int granted = granted_cores("/proc/self/cgroup", "/sys/fs/cgroup"), cores = affinity_cores();
  return granted > 0 ? std::min(granted, cores) : cores;
}

}  // namespace doppel
