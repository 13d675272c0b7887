#pragma once

#include <gtest/gtest.h>

#include <iomanip>
#include <sstream>
#include <string>
#include <vector>

#include "program.h"

namespace doppel::tools {

struct Outcome {
  int code;
  std::string out, err;
};

/// Runs a command of `doppel` in this process. @param words without the program's name
inline Outcome run_words(std::vector<std::string> words) {
  words.insert(words.begin(), "doppel");
  std::vector<const char*> argv;
  for (const std::string& word : words) argv.push_back(word.c_str());
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  const int code = run_program(static_cast<int>(argv.size()), argv.data());
  const std::string out = ::testing::internal::GetCapturedStdout();
  return {code, out, ::testing::internal::GetCapturedStderr()};
}
/// @param arguments as in a shell; single quotes hold a word with spaces together
inline Outcome run(const std::string& arguments) {
  std::istringstream stream(arguments);
  std::vector<std::string> words;
  for (std::string word; stream >> std::quoted(word, '\'');) words.push_back(word);
  return run_words(words);
}
/// Runs a command that must succeed.
inline Outcome step(const std::string& line) {
  const Outcome outcome = run(line);
  EXPECT_EQ(outcome.code, 0) << "doppel " << line << "\n" << outcome.err;
  return outcome;
}
/// What the program says about wrong use.
inline std::string complaint_about(const std::string& line) {
  const Outcome outcome = run(line);
  EXPECT_EQ(outcome.code, 2) << line << "\n" << outcome.out << outcome.err;
  return outcome.err;
}

}  // namespace doppel::tools
