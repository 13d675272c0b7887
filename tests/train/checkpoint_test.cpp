#include "doppel/actor/checkpoint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/serialize.h>

#include <fstream>
#include <random>

#include "doppel/core/atomic_file.h"
#include "doppel/core/crc32c.h"
#include "doppel/core/error.h"
#include "support/killed_process.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "train/toy_stage.h"

namespace doppel::checkpoint_test {

using support::left_by_a_killed_process;
using support::message_of;
using support::TemporaryFolder;

namespace {

namespace fs = std::filesystem;

Checkpoint example(int number = 1) {
  Checkpoint checkpoint;
  checkpoint.set_text("step", std::to_string(number));
  checkpoint.set_text("odd", std::string("line\nwith \0 zero", 16));
  checkpoint.set_tensor("weights", torch::arange(12, torch::kFloat32).reshape({3, 4}) * number);
  checkpoint.set_tensor("count", torch::full({1}, number, torch::kInt64));
  checkpoint.set_tensor("empty", torch::empty({0, 3}));
  checkpoint.set_tensor("state", torch::arange(40, torch::kUInt8));
  return checkpoint;
}

void write(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

TEST(CheckpointRecovers, TensorsAndTextsRoundTrip) {
  const TemporaryFolder folder;
  const Checkpoint written = example();
  written.save(folder / "a.pt");
  const Checkpoint read = Checkpoint::load(folder / "a.pt");
  ASSERT_EQ(read.tensors().size(), written.tensors().size());
  for (const auto& [name, tensor] : written.tensors()) {
    EXPECT_EQ(read.tensor(name).scalar_type(), tensor.scalar_type());
    EXPECT_TRUE(torch::equal(read.tensor(name), tensor)) << name;
  }
  EXPECT_EQ(read.text("odd"), written.text("odd"));
  EXPECT_EQ(read.integer("step"), 1);
}

TEST(CheckpointRecovers, ViewsAreStoredAloneAndWithTheirLayout) {
  const TemporaryFolder folder;
  const auto large = torch::arange(1000000, torch::kFloat32).reshape({1000, 1000});
  Checkpoint checkpoint;
  checkpoint.set_tensor("part", large.slice(0, 3, 5).t());
  checkpoint.save(folder / "a.pt");
  EXPECT_LT(fs::file_size(folder / "a.pt"), 20000u);
  EXPECT_TRUE(torch::equal(Checkpoint::load(folder / "a.pt").tensor("part"), large.slice(0, 3, 5).t()));
}

TEST(CheckpointRecovers, EqualTensorsStoredOnce) {
  const TemporaryFolder folder;
  const auto values = torch::rand({100, 1000});
  Checkpoint checkpoint;
  checkpoint.set_tensor("a", values);
  checkpoint.set_tensor("b", values.clone());
  checkpoint.set_tensor("flat", values.flatten().clone());
  checkpoint.set_tensor("bits", values.view(torch::kInt32).clone());  // of another type
  auto other = values.clone();
  other[99][999] += 1.0;
  checkpoint.set_tensor("other", other);
  checkpoint.save(folder / "a.pt");
  EXPECT_LT(fs::file_size(folder / "a.pt"), 3 * values.nbytes() + 20000u);
  const Checkpoint read = Checkpoint::load(folder / "a.pt");
  for (const auto& [name, tensor] : checkpoint.tensors()) {
    EXPECT_EQ(read.tensor(name).scalar_type(), tensor.scalar_type());
    EXPECT_TRUE(torch::equal(read.tensor(name), tensor)) << name;
  }
}

TEST(CheckpointRecovers, ModulesWithBuffers) {
  testing::ToyModelImpl model, other;
  model.train();
  for (int i = 0; i < 3; ++i) model.forward(torch::rand({8, 6}));
  for (auto& parameter : model.parameters()) parameter.data().add_(0.5);
  Checkpoint checkpoint;
  save_module(model, "model.", checkpoint);
  load_module(other, "model.", checkpoint);
  for (const auto& item : model.named_parameters())
    EXPECT_TRUE(torch::equal(item.value(), other.named_parameters()[item.key()])) << item.key();
  for (const auto& item : model.named_buffers())
    EXPECT_TRUE(torch::equal(item.value(), other.named_buffers()[item.key()])) << item.key();
}

TEST(CheckpointRejects, AnotherShapeNamesBoth) {
  const Checkpoint checkpoint = example();
  const std::string text = message_of<Error>([&] { checkpoint.copy_tensor("weights", torch::zeros({3, 5})); });
  EXPECT_THAT(text, ::testing::AllOf(::testing::HasSubstr("weights"), ::testing::HasSubstr("[3,4]"),
                                     ::testing::HasSubstr("[3,5]")));
  EXPECT_THROW(checkpoint.copy_tensor("count", torch::zeros({1}, torch::kInt32)), Error);
  EXPECT_THROW(checkpoint.tensor("missing"), Error);
  EXPECT_THROW(checkpoint.number("odd"), Error);
}

TEST(CheckpointRejects, MissingEmptyTruncatedAndForeignFiles) {
  const TemporaryFolder folder;
  EXPECT_THROW(Checkpoint::load(folder / "none.pt"), FileError);
  EXPECT_THROW(Checkpoint::load(folder.path()), FileError);
  example().save(folder / "good.pt");
  const std::string good = read_file(folder / "good.pt");
  for (std::size_t size :
       {std::size_t{0}, std::size_t{3}, std::size_t{10}, good.size() / 4, good.size() / 2, good.size() - 1}) {
    write(folder / "bad.pt", good.substr(0, size));
    EXPECT_THROW(Checkpoint::load(folder / "bad.pt"), FileError) << size;
  }
  write(folder / "bad.pt", "step: 3\r\nweights: 1 2 3\r\n");
  EXPECT_THROW(Checkpoint::load(folder / "bad.pt"), FileError);
  const auto foreign = torch::pickle_save(torch::ones({3}));
  write(folder / "bad.pt", std::string(foreign.begin(), foreign.end()));
  EXPECT_THROW(Checkpoint::load(folder / "bad.pt"), FileError);
}

/// Gives a zip archive the comment that Checkpoint::load looks for.
std::string sealed(std::vector<char> archive) {
  archive[archive.size() - 2] = 22;
  const std::string bytes(archive.begin(), archive.end());
  return bytes + fmt::format("doppel crc32c {:08x}", crc32c(bytes.data(), bytes.size()));
}

TEST(CheckpointRejects, AnotherVersionAndOtherPickles) {
  const TemporaryFolder folder;
  c10::impl::GenericDict root(c10::StringType::get(), c10::AnyType::get());
  root.insert("format", std::string("doppel checkpoint 99"));
  write(folder / "new.pt", sealed(torch::pickle_save(root)));
  EXPECT_THAT(message_of<Error>([&] { Checkpoint::load(folder / "new.pt"); }),
              ::testing::HasSubstr("doppel checkpoint 99"));
  write(folder / "new.pt", sealed(torch::pickle_save(torch::ones({3}))));
  EXPECT_THAT(message_of<Error>([&] { Checkpoint::load(folder / "new.pt"); }),
              ::testing::HasSubstr("expected a mapping"));
  c10::impl::GenericDict nameless(c10::StringType::get(), c10::AnyType::get());
  nameless.insert("texts", std::string("none"));
  write(folder / "new.pt", sealed(torch::pickle_save(nameless)));
  EXPECT_THAT(message_of<Error>([&] { Checkpoint::load(folder / "new.pt"); }),
              ::testing::HasSubstr("not a checkpoint of Doppel"));
}

TEST(CheckpointRejects, EveryFlippedBit) {
  const TemporaryFolder folder;
  example().save(folder / "good.pt");
  const std::string good = read_file(folder / "good.pt");
  std::mt19937 random(5);
  for (int trial = 0; trial < 300; ++trial) {
    std::string bad = good;
    const std::size_t at = random() % bad.size();
    bad[at] = static_cast<char>(bad[at] ^ (1 << (random() % 8)));
    write(folder / "bad.pt", bad);
    EXPECT_THROW(Checkpoint::load(folder / "bad.pt"), FileError) << at;
  }
}

TEST(CheckpointRejects, RandomBytes) {
  const TemporaryFolder folder;
  std::mt19937 random(6);
  for (int trial = 0; trial < 50; ++trial) {
    std::string bytes = trial % 2 ? "PK\x03\x04" : "";
    for (std::size_t i = 0, n = random() % 4000; i < n; ++i) bytes.push_back(static_cast<char>(random()));
    write(folder / "bad.pt", bytes);
    EXPECT_THROW(Checkpoint::load(folder / "bad.pt"), FileError);
  }
}

TEST(CheckpointFolderReference, KeepsTheNewestAndMilestones) {
  const TemporaryFolder folder;
  CheckpointFolder checkpoints(folder / "checkpoints", 2, 100);
  EXPECT_FALSE(checkpoints.load_latest());
  for (int step : {50, 100, 150, 200, 250}) checkpoints.save(step, example(step));
  EXPECT_EQ(checkpoints.steps(), (std::vector<std::int64_t>{100, 200, 250}));
  EXPECT_EQ(read_file(folder / "checkpoints" / "latest"), "step-000250.pt\n");
  const auto latest = checkpoints.load_latest();
  EXPECT_EQ(latest->first, 250);
  EXPECT_EQ(latest->second.integer("step"), 250);
}

TEST(CheckpointFolderRecovers, FromADamagedNewestFileAndLeftovers) {
  const TemporaryFolder folder;
  const fs::path half = left_by_a_killed_process(folder / "step-000003.pt");
  CheckpointFolder checkpoints(folder.path(), 3);
  checkpoints.save(1, example(1));
  checkpoints.save(2, example(2));
  write(checkpoints.path(2), "PK");
  write(half, "half");
  write(folder / "notes.txt", "the user's own");
  EXPECT_EQ(checkpoints.load_latest()->first, 1);
  checkpoints.save(3, example(3));
  EXPECT_FALSE(fs::exists(half));
  EXPECT_TRUE(fs::exists(folder / "notes.txt"));
}

// A run killed while it names its last checkpoint saves no other one, which would remove the remains.
TEST(CheckpointFolderRecovers, FromAKillBetweenACheckpointAndItsName) {
  const TemporaryFolder folder;
  CheckpointFolder checkpoints(folder.path(), 3);
  checkpoints.save(1, example(1));
  example(2).save(checkpoints.path(2));
  const fs::path half = left_by_a_killed_process(folder / "latest");
  write(half, "step-000002.pt\n");
  write(folder / ".notes.4711-27", "not ours");
  checkpoints.note(2, example(2));
  EXPECT_EQ(read_file(folder / "latest"), "step-000002.pt\n");
  EXPECT_FALSE(fs::exists(half));
  EXPECT_TRUE(fs::exists(folder / ".notes.4711-27"));
}

TEST(CheckpointFolderRejects, NothingReadable) {
  const TemporaryFolder folder;
  CheckpointFolder checkpoints(folder.path());
  write(checkpoints.path(2), "PK");
  EXPECT_THAT(message_of<Error>([&] { checkpoints.load_latest(); }), ::testing::HasSubstr("--overwrite"));
}

}  // namespace
}  // namespace doppel::checkpoint_test
