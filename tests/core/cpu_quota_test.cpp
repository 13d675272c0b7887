#include "doppel/core/cpu_quota.h"

#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "doppel/core/scratch_folder.h"

namespace doppel::cpu_quota_test {
namespace {

/// A machine's control groups as files.
class Groups {
 public:
  explicit Groups(const std::string& list) { write("self", list); }
  void write(const std::string& name, const std::string& text) {
    std::filesystem::create_directories((folder_.path() / name).parent_path());
    std::ofstream(folder_.path() / name) << text;
  }
  int cores() const { return granted_cores(folder_.path() / "self", folder_.path() / "mounts"); }

 private:
  ScratchFolder folder_;
};

TEST(CpuQuotaReference, Version2) {
  Groups groups("0::/work/job\n");
  EXPECT_EQ(groups.cores(), 0);
  groups.write("mounts/work/job/cpu.max", "max 100000\n");
  EXPECT_EQ(groups.cores(), 0);
  groups.write("mounts/work/job/cpu.max", "250000 100000\n");
  EXPECT_EQ(groups.cores(), 3);  // two and a half, rounded up
  groups.write("mounts/work/cpu.max", "150000 100000\n");
  EXPECT_EQ(groups.cores(), 2);  // a group above grants less
  groups.write("mounts/cpu.max", "5000 100000\n");
  EXPECT_EQ(groups.cores(), 1);  // never none
}

TEST(CpuQuotaReference, Version1) {
  Groups groups("9:cpuset:/\n4:cpu,cpuacct:/box\n1:name=systemd:/x\n");
  groups.write("mounts/cpuset/cpu.cfs_quota_us", "100000\n");  // another controller's folder
  groups.write("mounts/cpuset/cpu.cfs_period_us", "100000\n");
  groups.write("mounts/cpu,cpuacct/box/cpu.cfs_quota_us", "-1\n");
  groups.write("mounts/cpu,cpuacct/box/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(groups.cores(), 0);
  groups.write("mounts/cpu,cpuacct/box/cpu.cfs_quota_us", "400000\n");
  EXPECT_EQ(groups.cores(), 4);
  groups.write("mounts/cpu/box/cpu.cfs_quota_us", "200000\n");  // the other name of the same mount
  groups.write("mounts/cpu/box/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(groups.cores(), 2);
}

TEST(CpuQuotaReference, DamagedFilesAreNoLimit) {
  for (const char* text : {"", "fast\n", "100000\n", "100000 0\n", "-5 100000\n", "nan 1\n", "1e300 1\n"}) {
    Groups groups("0::/\nnonsense\n");
    groups.write("mounts/cpu.max", text);
    EXPECT_EQ(groups.cores(), 0) << text;
  }
  EXPECT_EQ(granted_cores("/nonexistent", "/nonexistent"), 0);
}

TEST(CpuQuotaReference, ThisProcessHasACore) { EXPECT_GE(available_cores(), 1); }

}  // namespace
}  // namespace doppel::cpu_quota_test
