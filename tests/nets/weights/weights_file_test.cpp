#include "doppel/nets/weights/weights_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/nn/modules/batchnorm.h>
#include <torch/types.h>

#include <cstdlib>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "nets/weights_fixture.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::weights_file_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using test::Pickle;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using torch::Tensor;

class WeightsFile : public ::testing::Test {
 protected:
  std::filesystem::path file(const std::string& name = "weights") const { return folder_.path() / name; }

  /// What reading a file complains of.
  std::string complaint() const {
    return message_of<FileError>([&] { read_weights(file()); });
  }
  std::string complaint(const std::string& pickle, const std::vector<Tensor>& storages = {}) const {
    test::write_archive(file(), pickle, storages);
    return complaint();
  }
  std::string complaint_of_header(const std::string& header, const std::string& data) const {
    test::write_safetensors(file(), header, data);
    return complaint();
  }
  /// Reading every beginning of the file either works or ends in a FileError.
  void expect_truncation_is_told() const {
    std::ifstream stream(file(), std::ios::binary);
    const std::string whole((std::istreambuf_iterator<char>(stream)), {});
    const size_t step = std::max<size_t>(1, whole.size() / 97);
    for (size_t size = 0; size < whole.size(); size += step) {
      std::ofstream(file("part"), std::ios::binary).write(whole.data(), static_cast<std::streamsize>(size));
      EXPECT_THROW(read_weights(file("part")), FileError) << size << " of " << whole.size() << " bytes";
    }
  }

  TemporaryFolder folder_;
};

NamedWeights some_weights() {
  return {{"conv1.weight", torch::arange(24, torch::kFloat32).view({2, 3, 2, 2})},
          {"bn1.bias", torch::tensor({0.5, -2.0}, torch::kFloat16)},
          {"bn1.num_batches_tracked", torch::tensor(70000, torch::kInt64)},
          {"empty", torch::empty({0, 4})}};
}

void expect_same(const NamedWeights& found, const NamedWeights& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].first, expected[i].first);
    EXPECT_EQ(found[i].second.scalar_type(), expected[i].second.scalar_type());
    EXPECT_TRUE(torch::equal(found[i].second, expected[i].second)) << found[i].first;
  }
}

TEST_F(WeightsFile, ReadsWhatTorchSaveWrites) {
  test::write_torch_weights(file(), some_weights());
  expect_same(read_weights(file()), some_weights());
  expect_truncation_is_told();
}

TEST_F(WeightsFile, ReadsSafetensors) {
  test::write_safetensors(file(), some_weights());
  expect_same(read_weights(file()), some_weights());
  expect_truncation_is_told();
}

TEST_F(WeightsFile, WrittenSafetensorsAreReadBack) {
  NamedWeights weights = some_weights();
  weights.emplace_back("transposed", torch::arange(6, torch::kInt32).view({2, 3}).t());
  weights.emplace_back("nothing", torch::zeros({0, 3}));
  write_safetensors(file(), weights, {{"about", "a \"test\""}});
  expect_same(read_weights(file()), weights);
  const std::string bytes = read_file(file());
  EXPECT_EQ(static_cast<unsigned char>(bytes[0]) % 8, 0);  // the header's length
  EXPECT_NE(bytes.find(R"("__metadata__":{"about":"a \"test\""})"), std::string::npos);
  weights.emplace_back("nothing", torch::zeros({1}));
  EXPECT_THROW(write_safetensors(file(), weights), Error);
  EXPECT_EQ(read_file(file()), bytes);
}

TEST_F(WeightsFile, ReadsViewsOfOneStorage) {
  // Two tensors share numbers; one is transposed and starts in the middle; a parameter wraps a tensor.
  Pickle pickle;
  pickle.raw("}(").text("part").tensor("DoubleStorage", "0", 8, 2, {2, 3}, {1, 2}).text("whole");
  pickle.function("torch._utils", "_rebuild_parameter").raw("(");
  pickle.tensor("DoubleStorage", "0", 8, 0, {8}, {1}).raw("\x88").ordered_dict().raw("tRu.");
  const Tensor numbers = torch::arange(8, torch::kFloat64);
  test::write_archive(file(), pickle.bytes(), {numbers});
  const NamedWeights found = read_weights(file());
  ASSERT_EQ(found.size(), 2u);
  EXPECT_TRUE(torch::equal(found[0].second, torch::tensor({{2, 4, 6}, {3, 5, 7}}, torch::kFloat64)));
  EXPECT_TRUE(torch::equal(found[1].second, numbers));
}

TEST_F(WeightsFile, ReadsWhatPythonWrote) {
  const std::string python = "/usr/bin/python3";
  if (std::system((python + " -c 'import torch' 2> /dev/null").c_str()) != 0)
    GTEST_SKIP() << python << " has no torch (Debian: python3-torch): a file written by it was NOT read";
  write_atomically(file("write.py"), R"(
import sys, torch
torch.manual_seed(3)
model = torch.nn.Sequential(torch.nn.Conv2d(3, 4, 3), torch.nn.BatchNorm2d(4), torch.nn.Linear(5, 2).double())
for p in model.parameters(): torch.nn.init.constant_(p, p.numel())
model[0].weight.data = torch.arange(108.).view(3, 4, 3, 3).transpose(0, 1)
torch.save(model.state_dict(), sys.argv[1])
torch.save(model, sys.argv[1] + '.model')
torch.save(model.state_dict(), sys.argv[1] + '.old', _use_new_zipfile_serialization=False)
)");
  ASSERT_EQ(std::system((python + " " + file("write.py").string() + " " + file().string()).c_str()), 0);
  const NamedWeights found = read_weights(file());
  std::vector<std::string> names;
  for (const auto& [name, tensor] : found) names.push_back(name);
  EXPECT_THAT(names, testing::ElementsAre("0.weight", "0.bias", "1.weight", "1.bias", "1.running_mean", "1.running_var",
                                          "1.num_batches_tracked", "2.weight", "2.bias"));
  EXPECT_TRUE(torch::equal(found[0].second, torch::arange(108, torch::kFloat32).view({3, 4, 3, 3}).transpose(0, 1)));
  EXPECT_TRUE(torch::equal(found[6].second, torch::tensor(0, torch::kInt64)));
  EXPECT_TRUE(torch::equal(found[7].second, torch::full({2, 5}, 10.0, torch::kFloat64)));
  EXPECT_THAT(message_of<FileError>([&] { read_weights(file("weights.model")); }),
              AllOf(HasSubstr("not executed"), HasSubstr("model.state_dict()")));
  EXPECT_THAT(message_of<FileError>([&] { read_weights(file("weights.old")); }), HasSubstr("before 1.6"));
}

TEST_F(WeightsFile, ExecutesNothing) {
  EXPECT_THAT(complaint(Pickle().function("os", "system").raw("(").text("touch found").raw("tR.").bytes()),
              AllOf(HasSubstr("os.system"), HasSubstr("not executed")));
  EXPECT_THAT(complaint(Pickle().function("builtins", "object").raw(")\x81.").bytes()), HasSubstr("0x81"));
}

TEST_F(WeightsFile, SurvivesHostilePickles) {
  const Tensor numbers = torch::zeros({4});
  const std::string huge =
      Pickle().raw("}").text("x").tensor("FloatStorage", "0", 4, 0, {1 << 30, 1 << 30}, {4, 4}).raw("s.").bytes();
  EXPECT_THAT(complaint(huge, {numbers}), AllOf(HasSubstr("'x'"), HasSubstr("beyond its 4 numbers")));
  const auto shaped = [](int64_t offset, at::IntArrayRef shape, at::IntArrayRef stride) {
    return Pickle().raw("}").text("x").tensor("FloatStorage", "0", 4, offset, shape, stride).raw("s.").bytes();
  };
  EXPECT_THAT(complaint(shaped(1, {4}, {1}), {numbers}), HasSubstr("beyond"));
  EXPECT_THAT(complaint(shaped(-1, {1}, {1}), {numbers}), HasSubstr("beyond"));
  EXPECT_THAT(complaint(shaped(0, {-2}, {1}), {numbers}), HasSubstr("beyond"));
  EXPECT_THAT(complaint(shaped(0, {2, 2}, {1}), {numbers}), HasSubstr("differ in length"));
  EXPECT_THAT(complaint(shaped(0, {4}, {1}), {}), HasSubstr("'data/0' is missing"));
  EXPECT_THAT(
      complaint(Pickle().raw("}").text("x").tensor("OddStorage", "0", 4, 0, {4}, {1}).raw("s.").bytes(), {numbers}),
      HasSubstr("'OddStorage'"));
  for (const std::string bytes :
       {"R.", "s.", "t.", "h\x07.", "b.", "a.", "u.", "Q.", "q", "X\xff\xff\xff\xff", "c", ".", "(((t.", "}(K\x01u.",
        "NK\x01"
        "a.",
        "(K\x01\x85R.", "\x8a\xff"})
    EXPECT_THAT(complaint(Pickle().raw(bytes).bytes()), Not(HasSubstr("nothing was thrown"))) << bytes;
  // A list in a list in a list ..., and one that holds itself.
  std::string deep;
  for (int i = 0; i < 200000; ++i) deep += "]";
  for (int i = 1; i < 200000; ++i) deep += "a";
  EXPECT_THAT(complaint(Pickle().raw(deep + ".").bytes()), HasSubstr("expected a mapping"));
  EXPECT_THAT(complaint(Pickle()
                            .raw("]q\x01h\x01"
                                 "a.")
                            .bytes()),
              HasSubstr("expected a mapping"));
}

TEST_F(WeightsFile, LimitsWhatAPickleMayTake) {
  const Tensor numbers = torch::zeros({4});
  const auto entry = [](const std::string& name, at::IntArrayRef shape, at::IntArrayRef stride) {
    return Pickle().raw("").text(name).tensor("FloatStorage", "0", 4, 0, shape, stride).bytes().substr(2);
  };
  EXPECT_THAT(complaint(Pickle().raw(std::string(2'000'001, 'N') + ".").bytes()), HasSubstr("2000000 values"));
  const std::vector<std::int64_t> many(17, 1);
  EXPECT_THAT(complaint(Pickle().raw("}" + entry("x", many, many) + "s.").bytes(), {numbers}), HasSubstr("17 axes"));
  // A view that repeats its numbers would become large where it is copied.
  EXPECT_THAT(complaint(Pickle().raw("}" + entry("x", {1 << 20}, {0}) + "s.").bytes(), {numbers}), HasSubstr("beyond"));
  const std::string twice = "}" + entry("x", {4}, {1}) + "s" + entry("x", {4}, {1}) + "s.";
  EXPECT_THAT(complaint(Pickle().raw(twice).bytes(), {numbers}), HasSubstr("two values with the name 'x'"));
  const std::string shared = Pickle().raw("}}q\x01(").text("a").raw("h\x01").text("b").raw("h\x01u.").bytes();
  EXPECT_THAT(complaint(shared), HasSubstr("expected a mapping"));
  // A long text that is named again and again: 32 kB became gigabytes.
  Pickle long_texts;
  long_texts.text(std::string(1 << 20, 'a')).raw("q\x01}(");
  for (int i = 0; i < 100; ++i) long_texts.text("n" + std::to_string(i)).raw("h\x01");
  long_texts.raw("u.");
  EXPECT_THAT(complaint(long_texts.bytes()), HasSubstr("67108864 bytes"));
}

TEST_F(WeightsFile, TakesNoCompressedParts) {
  test::write_torch_weights(file(), some_weights());
  std::string bytes = read_file(file());
  const auto set_method = [&](const char* signature, std::size_t offset) {
    for (std::size_t at = bytes.find(signature); at != std::string::npos; at = bytes.find(signature, at + 1))
      bytes[at + offset] = 8;
  };
  set_method("PK\x03\x04", 8);
  set_method("PK\x01\x02", 10);
  write_atomically(file(), bytes);
  EXPECT_THAT(complaint(), HasSubstr("compressed"));
}

TEST_F(WeightsFile, WantsTensorsByNameAndNothingElse) {
  EXPECT_THAT(complaint(Pickle().raw("}.").bytes()), HasSubstr("found none"));
  EXPECT_THAT(complaint(Pickle().raw("}").text("epoch").number(3).raw("s.").bytes()),
              AllOf(HasSubstr("'epoch'"), HasSubstr("state_dict")));
}

TEST_F(WeightsFile, ChecksTheHeaderOfSafetensors) {
  const std::string data(16, '\0');
  const auto tensor = [](const std::string& name, const std::string& type, const std::string& shape, int from, int to) {
    return "\"" + name + "\":{\"dtype\":\"" + type + "\",\"shape\":" + shape + ",\"data_offsets\":[" +
           std::to_string(from) + "," + std::to_string(to) + "]}";
  };
  EXPECT_THAT(complaint_of_header("{" + tensor("a", "F32", "[2,2]", 0, 16) + "}", data),
              HasSubstr("nothing was thrown"));
  EXPECT_THAT(complaint_of_header("[]", data), HasSubstr("JSON object"));
  EXPECT_THAT(complaint_of_header("{\"a\":" + std::string(100'000, '['), data), HasSubstr("nested"));
  EXPECT_THAT(complaint_of_header("{" + tensor("a", "F32", "[1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,4]", 0, 16) + "}", data),
              HasSubstr("16 sizes"));
  EXPECT_THAT(complaint_of_header("{\"a\"", data), HasSubstr("JSON object"));
  EXPECT_THAT(complaint_of_header("{\"a\":{\"dtype\":\"F32\"}}", data), HasSubstr("data_offsets"));
  EXPECT_THAT(complaint_of_header("{" + tensor("a", "F8", "[16]", 0, 16) + "}", data), HasSubstr("'F8'"));
  EXPECT_THAT(complaint_of_header("{" + tensor("a", "F32", "[2,3]", 0, 16) + "}", data), HasSubstr("does not fill"));
  EXPECT_THAT(complaint_of_header("{" + tensor("a", "F32", "[-4]", 0, 16) + "}", data), HasSubstr("needs dtype"));
  EXPECT_THAT(complaint_of_header("{" + tensor("a", "F32", "[4]", 16, 0) + "}", data), HasSubstr("does not fill"));
  EXPECT_THAT(complaint_of_header("{" + tensor("a", "F32", "[65536,65536,65536,65536]", 0, 0) + "}", data),
              HasSubstr("does not fill"));
  EXPECT_THAT(
      complaint_of_header("{" + tensor("a", "F32", "[3]", 0, 12) + "," + tensor("b", "F32", "[2]", 8, 16) + "}", data),
      AllOf(HasSubstr("'b'"), HasSubstr("starts at byte 8")));
  EXPECT_THAT(complaint_of_header("{" + tensor("a", "F32", "[2]", 4, 12) + "}", data), HasSubstr("starts at byte 4"));
  EXPECT_THAT(complaint_of_header("{" + tensor("a", "F32", "[2]", 0, 8) + "}", data), HasSubstr("end at byte 8 of 16"));
}

TEST_F(WeightsFile, OtherFilesAreNamed) {
  EXPECT_THAT(complaint(), HasSubstr("cannot read this file"));
  write_atomically(file(), "");
  EXPECT_THAT(complaint(), HasSubstr("too few"));
  write_atomically(file(), "version https://git-lfs.example\r\noid 1234\r\n");
  EXPECT_THAT(complaint(), HasSubstr("neither"));
  write_atomically(file(), "PK\x03\x04 and nothing more");
  EXPECT_THAT(complaint(), HasSubstr("zip"));
}

TEST_F(WeightsFile, FitsAModuleNameByName) {
  torch::nn::BatchNorm2d norm(3), other(3);
  other->weight.data().copy_(torch::tensor({1.0, 2.0, 3.0}));
  other->running_mean.fill_(0.25);
  NamedWeights weights = test::weights_of(*other);
  weights.emplace_back("fc.weight", torch::zeros({2}));
  load_weights(*norm, weights, "norm.pth", {"fc."});
  EXPECT_TRUE(torch::equal(norm->weight, other->weight));
  EXPECT_TRUE(torch::equal(norm->running_mean, other->running_mean));

  // Old files hold no counter; numbers of another type are converted.
  weights = {{"weight", torch::zeros({3}, torch::kFloat64)},
             {"bias", torch::ones({3})},
             {"running_mean", torch::zeros({3})},
             {"running_var", torch::ones({3})}};
  load_weights(*norm, weights, "norm.pth");
  EXPECT_TRUE(torch::equal(norm->weight, torch::zeros({3})));
}

TEST_F(WeightsFile, OfAnotherNetworkLeaveTheModuleAlone) {
  torch::nn::BatchNorm2d norm(3);
  const NamedWeights weights{{"weight", torch::zeros({3})}, {"bias", torch::zeros({4})}, {"gamma", torch::zeros({3})}};
  EXPECT_THAT(
      message_of<FileError>([&] { load_weights(*norm, weights, "norm.pth"); }),
      AllOf(HasSubstr("norm.pth: "), HasSubstr("another network"), HasSubstr("missing: running_mean, running_var"),
            HasSubstr("unexpected: gamma"), HasSubstr("bias [4] instead of [3]")));
  EXPECT_TRUE(torch::equal(norm->weight, torch::ones({3})));
}

}  // namespace
}  // namespace doppel::weights_file_test
