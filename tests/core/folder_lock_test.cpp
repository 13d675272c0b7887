#include "doppel/core/folder_lock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "doppel/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::folder_lock_test {
namespace {

namespace fs = std::filesystem;
using support::TemporaryFolder;
using ::testing::HasSubstr;

/// A process that holds the lock of a folder until it is killed.
class Owner {
 public:
  explicit Owner(const fs::path& folder) {
    int ends[2];
    if (pipe(ends) != 0) ADD_FAILURE() << "pipe";
    process_ = fork();
    if (process_ == 0) {
      const FolderLock lock(folder);
      (void)!write(ends[1], "x", 1);
      pause();
      _exit(0);
    }
    char ready = 0;
    EXPECT_EQ(read(ends[0], &ready, 1), 1);
    close(ends[0]);
    close(ends[1]);
  }
  ~Owner() { end(); }
  Owner(const Owner&) = delete;
  Owner& operator=(const Owner&) = delete;

  void end() {
    if (process_ <= 0) return;
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
    process_ = 0;
  }
  pid_t process() const { return process_; }

 private:
  pid_t process_ = 0;
};

TEST(FolderLockReference, LeavesNothingBehind) {
  const TemporaryFolder folder;
  const fs::path run = folder / "a/run";
  {
    const FolderLock lock(run);
    EXPECT_TRUE(fs::is_directory(run));
    EXPECT_TRUE(is_unused_folder(run)) << "only the lock is in it";
    std::ofstream(run / "result.txt") << "x";
    EXPECT_FALSE(is_unused_folder(run));
  }
  EXPECT_TRUE(fs::exists(run / "result.txt"));
  EXPECT_EQ(std::distance(fs::directory_iterator(run), {}), 1);
  { const FolderLock lock(folder / "empty"); }
  EXPECT_FALSE(fs::exists(folder / "empty")) << "a folder in which nothing was written does not stay";
  fs::create_directory(folder / "mine");
  { const FolderLock lock(folder / "mine"); }
  EXPECT_TRUE(fs::exists(folder / "mine"));
}

TEST(FolderLockRejects, ASecondWriterAndNamesTheFirst) {
  const TemporaryFolder folder;
  Owner owner(folder.path());
  char host[256] = {};
  ASSERT_EQ(gethostname(host, sizeof(host) - 1), 0);
  const std::string message = support::message_of([&] { const FolderLock lock(folder.path()); });
  EXPECT_THAT(message, HasSubstr("process " + std::to_string(owner.process()) + " on " + host));
  EXPECT_THAT(message, HasSubstr("another --out"));
  owner.end();
  EXPECT_NO_THROW(FolderLock lock(folder.path())) << "a killed process holds no lock";
}

TEST(FolderLockRejects, WhatIsNoFolder) {
  const TemporaryFolder folder;
  std::ofstream(folder / "file") << "x";
  EXPECT_THROW(FolderLock lock(folder / "file"), UsageError);
  EXPECT_THROW(FolderLock lock(folder / "file/inside"), Error);
}

}  // namespace
}  // namespace doppel::folder_lock_test
