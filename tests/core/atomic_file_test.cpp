#include "doppel/core/atomic_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <thread>

#include "doppel/core/as_size.h"
#include "doppel/core/error.h"
#include "support/temporary_folder.h"

namespace doppel::atomic_file_test {
namespace {

namespace fs = std::filesystem;
using support::TemporaryFolder;

std::size_t files_in(const fs::path& folder) {
  return as_size(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(AtomicFileReference, WritesWhatItIsGivenAndNothingElse) {
  const TemporaryFolder folder;
  const std::string content("a\0b\r\n", 5);
  write_atomically(folder / "deep/er/x.bin", content);
  EXPECT_EQ(read_file(folder / "deep/er/x.bin"), content);
  write_atomically(folder / "deep/er/x.bin", std::string());
  EXPECT_EQ(read_file(folder / "deep/er/x.bin"), "");
  EXPECT_EQ(files_in(folder / "deep/er"), 1u);
}

TEST(AtomicFileReference, TheTemporaryFileKeepsTheExtension) {
  const TemporaryFolder folder;
  write_atomically(folder / "x.json", [&](const fs::path& temporary) {
    EXPECT_EQ(temporary.extension(), ".json");
    EXPECT_EQ(temporary.parent_path(), folder.path());
    std::ofstream(temporary) << "{}";
  });
  EXPECT_EQ(read_file(folder / "x.json"), "{}");
}

TEST(AtomicFileReference, ALinkStaysALink) {
  const TemporaryFolder folder;
  write_atomically(folder / "real.txt", std::string("old"));
  fs::create_symlink("real.txt", folder / "link.txt");
  write_atomically(folder / "link.txt", std::string("new"));
  EXPECT_TRUE(fs::is_symlink(folder / "link.txt"));
  EXPECT_EQ(read_file(folder / "real.txt"), "new");
}

TEST(AtomicFileReference, AReaderNeverSeesAPart) {
  const TemporaryFolder folder;
  const std::string a(300000, 'a'), b(200000, 'b');
  write_atomically(folder / "x", a);
  std::atomic<bool> done{false};
  std::thread writer([&] {
    for (int i = 0; i < 40; ++i) write_atomically(folder / "x", i % 2 ? a : b);
    done = true;
  });
  while (!done) {
    const std::string seen = read_file(folder / "x");
    if (seen != a && seen != b) ADD_FAILURE() << "saw " << seen.size() << " bytes";
  }
  writer.join();
}

TEST(AtomicFileRejects, AFailureInTheMiddleLeavesTheOldFile) {
  const TemporaryFolder folder;
  write_atomically(folder / "x.txt", std::string("old"));
  const auto half = [](const fs::path& temporary) {
    std::ofstream(temporary) << "half";
    throw std::runtime_error("the pen broke");
  };
  EXPECT_THROW(write_atomically(folder / "x.txt", half), std::runtime_error);
  EXPECT_THROW(write_atomically(folder / "x.txt", [](const fs::path&) {}), Error) << "nothing was written";
  EXPECT_EQ(read_file(folder / "x.txt"), "old");
  EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(AtomicFileRejects, PositionsThatCannotBeWritten) {
  const TemporaryFolder folder;
  write_atomically(folder / "file", std::string("x"));
  EXPECT_THROW(write_atomically(folder / "file/inside", std::string("y")), Error);
  EXPECT_THROW(write_atomically(folder.path(), std::string("y")), Error);
  EXPECT_THROW(write_atomically(fs::path(), std::string("y")), Error);
  EXPECT_EQ(read_file(folder / "file"), "x");
  EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(ReadFileRejects, MissingFoldersAndTooLargeOnes) {
  const TemporaryFolder folder;
  write_atomically(folder / "x", std::string(1000, 'x'));
  EXPECT_EQ(read_file(folder / "x", 1000).size(), 1000u);
  EXPECT_THROW(read_file(folder / "x", 999), FileError);
  EXPECT_THROW(read_file(folder / "absent"), FileError);
  EXPECT_THROW(read_file(folder.path()), FileError);
  EXPECT_THROW(read_file("/dev/zero", 100000), FileError) << "a file without a size must not fill the memory";
}

TEST(AtomicFile, RefusesAPipeWithoutWaitingForItsWriter) {
  const TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_THROW(read_file(folder / "pipe"), FileError);
}

}  // namespace
}  // namespace doppel::atomic_file_test
