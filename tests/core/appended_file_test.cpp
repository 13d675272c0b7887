#include "doppel/core/appended_file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <fstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "doppel/core/temporary_name.h"
#include "support/killed_process.h"
#include "support/temporary_folder.h"

namespace doppel::appended_file_test {
namespace {

namespace fs = std::filesystem;
using support::left_by_a_killed_process;
using support::TemporaryFolder;

/// Limits the size of files, as a full disk does.
class SmallDisk {
 public:
  explicit SmallDisk(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~SmallDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, SIG_DFL);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

 private:
  rlimit before_ = {};
};

TEST(AppendedFileReference, KeepsWhatIsThereAndAddsRecords) {
  const TemporaryFolder folder;
  for (const char* record : {"a\n", "b\n"}) AppendedFile(folder / "log").append(record);
  EXPECT_EQ(read_file(folder / "log"), "a\nb\n");
}

TEST(AppendedFileRecovers, WritesWhatAFullDiskRefusedWhenThereIsRoomAgain) {
  const TemporaryFolder folder;
  AppendedFile file(folder / "log");
  file.append("first\n");
  {
    const SmallDisk disk(8);
    EXPECT_NO_THROW(file.append("second\n")) << "the work beside it goes on";
    EXPECT_NO_THROW(file.append("third\n"));
    EXPECT_THROW(file.finish(), Error) << "at the end it is told";
  }
  EXPECT_EQ(read_file(folder / "log"), "first\nse");
  file.append("fourth\n");
  EXPECT_NO_THROW(file.finish());
  EXPECT_EQ(read_file(folder / "log"), "first\nsecond\nthird\nfourth\n");
}

TEST(AppendedFileRejects, WhatCannotBeOpened) {
  const TemporaryFolder folder;
  EXPECT_THROW(AppendedFile(folder / "absent/log"), Error);
}

TEST(TemporaryNameReference, OnlyThoseOfEndedProcessesAreRemoved) {
  const TemporaryFolder folder;
  const fs::path file = folder / "step-000500.pt", left = left_by_a_killed_process(file);
  const std::string foreign = "f" + left.filename().string().substr(1);
  const std::vector<std::string> kept = {"step-000500.pt",
                                         ".step-000500.4711-0.pt",
                                         ".backup.2024-05.tar",
                                         ".doppel-notes",
                                         ".doppel-00000000-1-0-step-000500.pt",
                                         foreign,
                                         temporary_beside(file).filename().string()};
  std::ofstream(left) << "half";
  for (const std::string& name : kept) std::ofstream(folder / name) << "mine";
  remove_temporaries(folder.path());
  EXPECT_FALSE(fs::exists(left));
  for (const std::string& name : kept) EXPECT_TRUE(fs::exists(folder / name)) << name;
  EXPECT_NO_THROW(remove_temporaries(folder / "absent"));
}

TEST(TemporaryNameReference, TheFirstOneInAFolderRemovesWhatIsLeft) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "inner");
  const fs::path file = folder / "inner/report.html", other = folder / "other.html";
  const fs::path left = folder / "inner" / left_by_a_killed_process(other).filename();
  std::ofstream(left) << "half";
  EXPECT_EQ(temporary_beside(file).parent_path(), folder / "inner");
  EXPECT_FALSE(fs::exists(left));
}

}  // namespace
}  // namespace doppel::appended_file_test
