#include "doppel/core/text_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/hostile_files.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace doppel::text_reader_test {
namespace {

using support::message_of;
using support::TemporaryFolder;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class TextReaderFile {
 public:
  TextReader read(const std::string& content) {
    support::write_bytes(folder_ / "t.txt", content);
    return TextReader(folder_ / "t.txt", "a test file");
  }

 private:
  TemporaryFolder folder_;
};

TEST(TextReaderReference, SplitsLinesOfEitherEnding) {
  TextReaderFile file;
  for (const char* text : {"head er\n\n\t a  b\tc \nlast", "\xEF\xBB\xBFhead er\r\n\r\n\t a  b\tc \r\nlast\r\n"}) {
    TextReader reader = file.read(text);
    ASSERT_TRUE(reader.next_line());
    EXPECT_EQ(reader.line(), "head er");
    ASSERT_TRUE(reader.next_line());
    EXPECT_THAT(reader.tokens(), ElementsAre("a", "b", "c"));
    EXPECT_EQ(reader.where().line, 3);
    ASSERT_TRUE(reader.next_line());
    EXPECT_EQ(reader.line(), "last");
    EXPECT_FALSE(reader.next_line());
  }
}

TEST(TextReaderReference, Numbers) {
  TextReaderFile file;
  TextReader reader = file.read("1 -8e-05 +2.5 -0 1e-400 7 12345678901234567890");
  reader.require_line("numbers");
  EXPECT_EQ(reader.number(0, "x"), 1.0);
  EXPECT_EQ(reader.number(1, "x"), -8e-05);
  EXPECT_EQ(reader.number(2, "x"), 2.5);
  EXPECT_EQ(reader.number(3, "x"), 0.0);
  EXPECT_EQ(reader.number(4, "x"), 0.0);
  EXPECT_EQ(reader.integer(5, "x", 0, 10), 7);
  EXPECT_THROW(reader.integer(6, "x", 0, 10), FileError);
}

TEST(TextReaderReference, Tables) {
  const TemporaryFolder folder;
  support::write_bytes(folder / "t.csv", "name, x_mm\r\nleft hand , 2.5\n\n,3\na,b,c\n");
  TextReader reader(folder / "t.csv", "a test table", Separator::comma);
  reader.require_header("name,x_mm");
  ASSERT_TRUE(reader.next_row(2));
  EXPECT_EQ(reader.tokens()[0], "left hand");
  EXPECT_EQ(reader.number(1, "x_mm"), 2.5);
  ASSERT_TRUE(reader.next_row(2));
  EXPECT_THAT(reader.tokens(), ElementsAre("", "3"));
  EXPECT_THAT(message_of<FileError>([&] { reader.next_row(2); }),
              AllOf(HasSubstr("t.csv:5: "), HasSubstr("3 columns"), HasSubstr("2")));
  EXPECT_FALSE(reader.next_row(2));
  TextReader other(folder / "t.csv", "a test table", Separator::comma);
  EXPECT_THAT(message_of<FileError>([&] { other.require_header("frame,x_mm"); }),
              AllOf(HasSubstr("'frame,x_mm'"), HasSubstr("'name, x_mm'")));
}

TEST(TextReaderRejects, TokensThatAreNoNumbers) {
  TextReaderFile file;
  TextReader reader = file.read("first\nnan inf 1.5x 0x10 - 1e999 1,5\n");
  reader.next_line();
  reader.next_line();
  for (std::size_t i = 0; i < reader.tokens().size(); ++i) {
    EXPECT_THROW(reader.number(i, "x"), FileError) << reader.tokens()[i];
    EXPECT_THROW(reader.integer(i, "x", -100, 100), FileError) << reader.tokens()[i];
  }
  EXPECT_THAT(message_of<FileError>([&] { reader.number(2, "the weight"); }),
              AllOf(HasSubstr("t.txt:2: "), HasSubstr("a test file"), HasSubstr("the weight"), HasSubstr("\"1.5x\"")));
  EXPECT_THAT(message_of<FileError>([&] { reader.number(7, "the weight"); }), HasSubstr("missing"));
}

TEST(TextReaderRejects, CountsThatCannotBe) {
  TextReaderFile file;
  TextReader reader = file.read("3 -1 99999 99999999999999999999 2.5\na b c\n");
  reader.next_line();
  EXPECT_EQ(reader.count(0, "items"), 3u);
  for (std::size_t token = 1; token < 5; ++token) EXPECT_THROW(reader.count(token, "items"), FileError) << token;
  EXPECT_THAT(message_of<FileError>([&] { reader.count(2, "items"); }),
              AllOf(HasSubstr("99999"), HasSubstr("bytes are left")));
}

TEST(TextReaderRejects, FilesThatAreNoText) {
  TextReaderFile file;
  EXPECT_THROW(file.read(""), FileError);
  EXPECT_THROW(file.read(" \r\n\t\n"), FileError);
  EXPECT_THROW(file.read("\xEF\xBB\xBF"), FileError);
  EXPECT_THAT(message_of<FileError>([&] { file.read(std::string("a\nb\0c\n", 6)); }), HasSubstr("t.txt:2: "));
  const TemporaryFolder folder;
  EXPECT_THROW(TextReader(folder / "absent.txt", "a test file"), FileError);
  EXPECT_THROW(TextReader(folder.path(), "a test file"), FileError);
}

TEST(TextReaderRejects, AnEarlyEnd) {
  TextReaderFile file;
  TextReader reader = file.read("only\n");
  reader.next_line();
  EXPECT_THAT(message_of<FileError>([&] { reader.require_line("the bones"); }),
              HasSubstr("ends where the bones should stand"));
}

TEST(TextReaderReference, PathsOfOtherSystems) {
  EXPECT_EQ(resolve_path("/a/b/x.character", ".\\meshes\\y.obj"), "/a/b/meshes/y.obj");
  EXPECT_EQ(resolve_path("/a/b/x.character", "./y.obj"), "/a/b/y.obj");
  EXPECT_EQ(resolve_path("x.character", "y.obj"), "y.obj");
  EXPECT_EQ(resolve_path("/a/x.character", "/c/y.obj"), "/c/y.obj");
}

}  // namespace
}  // namespace doppel::text_reader_test
