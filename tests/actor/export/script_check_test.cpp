// Files that are programs: what strangers may put into them is refused before it runs.
#include "doppel/actor/export/script_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <minizip/zip.h>
#include <torch/script.h>

#include "doppel/actor/export/script_file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::script_check_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::HasSubstr;

torch::jit::Module module_of_code(const std::string& code) {
  torch::jit::Module module("__torch__.doppel.Actor");
  module.define(code);
  return module;
}

std::string save_call(const std::filesystem::path& victim) {
  return "torch.save(torch.ones([3]), \"" + victim.string() + "\")";
}

TEST(ScriptFileRejects, MethodsThatRunWhileTheFileIsLoaded) {
  const TemporaryFolder folder;
  const auto victim = folder / "victim", path = folder / "actor.pt";
  module_of_code(
      "def forward(self, x):\n  return x\n"
      "def __getstate__(self) -> int:\n  return 3\n"
      "def __setstate__(self, state: int) -> None:\n  " +
      save_call(victim) + "\n")
      .save(path.string());
  EXPECT_THAT(message_of([&] { load_script_file(path, ScriptKind::actor); }), HasSubstr("__setstate__"));
  EXPECT_FALSE(std::filesystem::exists(victim));
  torch::jit::load(path.string());
  EXPECT_TRUE(std::filesystem::exists(victim)) << "without the check the file would have written";
}

TEST(ScriptFileRejects, FunctionsThatWriteFiles) {
  const TemporaryFolder folder;
  const auto victim = folder / "victim", path = folder / "actor.pt";
  for (const char* condition : {"", "if x.size(0) > 1:\n    "}) {
    module_of_code(std::string("def forward(self, x):\n  ") + condition + save_call(victim) + "\n  return x\n")
        .save(path.string());
    EXPECT_THAT(message_of([&] { load_script_file(path, ScriptKind::actor); }), HasSubstr("aten::save"));
  }
  EXPECT_FALSE(std::filesystem::exists(victim));
}

TEST(ScriptFileRejects, FunctionsOfParts) {
  const TemporaryFolder folder;
  torch::jit::Module outer = module_of_code("def forward(self, x):\n  return x\n");
  torch::jit::Module inner("__torch__.doppel.part", outer._ivalue()->compilation_unit());
  inner.define("def other(self, x):\n  " + save_call(folder / "victim") + "\n  return x\n");
  outer.register_module("part", inner);
  outer.save((folder / "actor.pt").string());
  EXPECT_THAT(message_of([&] { load_script_file(folder / "actor.pt", ScriptKind::actor); }), HasSubstr("aten::save"));
}

TEST(ScriptFileRejects, PartsThatWouldFillTheMemory) {
  const TemporaryFolder folder;
  const auto path = folder / "actor.pt";
  const zipFile archive = zipOpen64(path.c_str(), APPEND_STATUS_CREATE);
  ASSERT_NE(archive, nullptr);
  ASSERT_EQ(
      zipOpenNewFileInZip64(archive, "actor/code/big.py", nullptr, nullptr, 0, nullptr, 0, nullptr, Z_DEFLATED, 1, 0),
      ZIP_OK);
  const std::string megabyte(1 << 20, ' ');
  for (int i = 0; i < 300; ++i) ASSERT_EQ(zipWriteInFileInZip(archive, megabyte.data(), 1 << 20), ZIP_OK);
  zipCloseFileInZip(archive);
  zipClose(archive, nullptr);
  EXPECT_LT(std::filesystem::file_size(path), 4u << 20);
  EXPECT_THAT(message_of([&] { check_script_archive(path, path); }), HasSubstr("256 MB"));
}

TEST(ScriptOperators, AreThoseThatCompute) {
  for (const char* name : {"aten::add", "aten::matmul", "prim::GetAttr", "doppel::skinning"})
    EXPECT_TRUE(is_script_operator(name)) << name;
  for (const char* name : {"aten::save", "aten::from_file", "prim::PythonOp", "prim::CallFunction",
                           "aten::", "doppel::", "c10d::send", "add", ""})
    EXPECT_FALSE(is_script_operator(name)) << name;
}

}  // namespace
}  // namespace doppel::script_check_test
