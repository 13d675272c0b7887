#pragma once

#include <filesystem>

namespace doppel {

/// Cores' worth of time that control groups grant, rounded up: the least quota of the process's group and of the groups
/// above it, by `cpu.max` (version 2) or `cpu.cfs_quota_us` and `cpu.cfs_period_us` (version 1). Files that are missing
/// or unreadable, and quotas of none, count as no limit.
/// @param groups the file that lists the groups of the process, /proc/self/cgroup
/// @param mounts the folder in which the groups are mounted, /sys/fs/cgroup
/// @return 0 where there is no limit
int granted_cores(const std::filesystem::path& groups, const std::filesystem::path& mounts);

/// The cores that the process may use, at least 1: those of its affinity mask (`taskset`, cpusets), and no more than
/// its control groups grant.
int available_cores();

}  // namespace doppel
