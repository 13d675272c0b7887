#include "doppel/core/npy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "doppel/core/atomic_file.h"
#include "doppel/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::npy_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using testing::HasSubstr;

TEST(NpyReference, KeepsShapeAndValues) {
  const TemporaryFolder folder;
  const std::vector<float> values{1.5f, -2.0f, 3.25f, 0.0f, 1e-30f, 6.0f};
  write_npy(folder / "a.npy", values.data(), {2, 3});
  const NpyArray array = read_npy(folder / "a.npy");
  EXPECT_EQ(array.type, "<f4");
  EXPECT_EQ(array.shape, (std::vector<std::int64_t>{2, 3}));
  EXPECT_EQ(array.as<float>(), values);
}

TEST(NpyReference, DataBeginsAtAMultipleOf64) {
  for (std::int64_t n : {1, 10, 100000}) {
    const std::vector<double> values(n, 1.0);
    EXPECT_EQ((npy_bytes(values.data(), "<f8", {n}).size() - 8 * values.size()) % 64, 0u) << n;
  }
}

TEST(NpyReference, AStreamEqualsOneWrite) {
  const TemporaryFolder folder;
  const std::vector<float> values{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
  NpyStream stream(folder / "s.npy", {2, 3});
  const std::span<const float> items(values);
  stream.append(items.first(6));
  stream.append(items.last(6));
  EXPECT_THAT(message_of<Error>([&] { stream.append(items); }), HasSubstr("6 values, received 12"));
  EXPECT_FALSE(std::filesystem::exists(folder / "s.npy"));
  stream.close();
  const NpyArray array = read_npy(folder / "s.npy");
  EXPECT_EQ(array.shape, (std::vector<std::int64_t>{2, 2, 3}));
  EXPECT_EQ(array.as<float>(), values);
}

TEST(NpyReference, AnUnfinishedStreamLeavesNothing) {
  const TemporaryFolder folder;
  { NpyStream stream(folder / "s.npy", {1}); }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(NpyRejects, IntegersThatDoNotFit) {
  const std::vector<std::int64_t> faces{0, 1, (std::int64_t{1} << 32) + 2};
  const NpyArray array = parse_npy(npy_bytes(faces.data(), "<i8", {1, 3}), {"faces.npy", 0});
  EXPECT_EQ(array.as<std::int64_t>(), faces);
  EXPECT_THROW(array.as<int>(), Error);
}

TEST(NpyItems, ReadsWhatTheStreamWroteInAnyOrder) {
  const TemporaryFolder folder;
  NpyStream stream(folder / "s.npy", {2, 3});
  for (int item = 0; item < 5; ++item) stream.append(std::vector<float>(6, static_cast<float>(item)));
  stream.close();
  NpyItems items(folder / "s.npy");
  ASSERT_EQ(items.size(), 5);
  for (const int item : {4, 0, 3}) EXPECT_EQ(items.read(item), std::vector<float>(6, static_cast<float>(item)));
  EXPECT_EQ(items.shape(), (std::vector<std::int64_t>{5, 2, 3}));
  EXPECT_THROW(items.read(5), Error);
  EXPECT_THROW(items.read(-1), Error);
  const std::vector<double> doubles{1, 2, 3, 4, 5, 6};
  write_npy(folder / "d.npy", doubles.data(), {2, 3});
  EXPECT_EQ(NpyItems(folder / "d.npy").read(1), (std::vector<float>{4, 5, 6}));
}

TEST(NpyItems, RefusesOtherTypesAndTruncatedFiles) {
  const TemporaryFolder folder;
  const std::vector<std::int32_t> values(6, 1);
  write_atomically(folder / "i.npy", npy_bytes(values.data(), "<i4", {2, 3}));
  EXPECT_THROW(NpyItems(folder / "i.npy"), FileError);
  const std::vector<float> floats(6, 1.0f);
  const std::string whole = npy_bytes(floats.data(), "<f4", {2, 3});
  write_atomically(folder / "t.npy", whole.substr(0, whole.size() - 1));
  EXPECT_THROW(NpyItems(folder / "t.npy"), FileError);
  EXPECT_THROW(NpyItems(folder / "missing.npy"), Error);
}

TEST(NpyRejects, EveryTruncation) {
  const TemporaryFolder folder;
  const std::vector<float> values(7, 1.0f);
  const std::string whole = npy_bytes(values.data(), "<f4", {7});
  for (std::size_t length = 0; length < whole.size(); ++length) {
    write_atomically(folder / "t.npy", whole.substr(0, length));
    EXPECT_THROW(read_npy(folder / "t.npy"), FileError) << length;
  }
  write_atomically(folder / "t.npy", whole + "x");
  EXPECT_THROW(read_npy(folder / "t.npy"), FileError);
}

TEST(NpyRejects, HeadersThatPromiseTheMoonOrSomethingElse) {
  const TemporaryFolder folder;
  const auto file = [&](std::string dictionary) {
    std::string bytes("\x93NUMPY\x01\x00", 8);
    bytes += static_cast<char>(dictionary.size());
    bytes += '\0';
    write_atomically(folder / "h.npy", bytes + dictionary);
    return folder / "h.npy";
  };
  EXPECT_THROW(read_npy(file("{'descr': '<f4', 'fortran_order': False, 'shape': (999999999999,9999999999999), }")),
               FileError);
  EXPECT_THROW(read_npy(file("{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999999999999,), }")),
               FileError);
  EXPECT_THROW(read_npy(file("{'descr': '<c8', 'fortran_order': False, 'shape': (0,), }")), FileError);
  EXPECT_THROW(read_npy(file("{'descr': '<f4', 'fortran_order': True, 'shape': (0,), }")), FileError);
  EXPECT_THROW(read_npy(file("{}")), FileError);
  EXPECT_NO_THROW(read_npy(file("{'descr': '<f4', 'fortran_order': False, 'shape': (0,), }")));
}

}  // namespace
}  // namespace doppel::npy_test
