#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "doppel/core/error.h"

/// What broken disks, wrong programs and other people's files do to a valid file.
///
/// Usage:
/// @code
///   doppel::support::expect_survives_hostile_files(folder.path() / "x.skeleton", valid_text,
///                                                  [](const auto& path) { read_skeleton(path); });
/// @endcode
namespace doppel::support {

struct HostileFile {
  std::string what;  ///< how it was made, for messages
  std::string content;
};

inline std::string with_crlf(const std::string& text) {
  std::string out;
  for (char c : text) {
    if (c == '\r') continue;
    if (c == '\n') out += '\r';
    out += c;
  }
  return out;
}

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("the test's file does not hold \"" + from + "\"");
  return text.replace(at, from.size(), to);
}

/// The tokens of a text: (position, length).
inline std::vector<std::pair<std::size_t, std::size_t>> token_ranges(const std::string& text) {
  std::vector<std::pair<std::size_t, std::size_t>> ranges;
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t begin = text.find_first_not_of(" \t\r\n,:[]{}", i);
    if (begin == std::string::npos) break;
    const std::size_t end = std::min(text.find_first_of(" \t\r\n,:[]{}", begin), text.size());
    ranges.emplace_back(begin, end - begin);
    i = end;
  }
  return ranges;
}

inline void add_truncations(const std::string& valid, std::size_t most, std::vector<HostileFile>& files) {
  const std::size_t step = std::max<std::size_t>(1, valid.size() / most);
  for (std::size_t n = 0; n < valid.size(); n += step) {
    files.push_back({"cut after " + std::to_string(n) + " bytes", valid.substr(0, n)});
  }
}

/// Every token (or an even choice of them) becomes something a careless reader trusts.
inline void add_bad_tokens(const std::string& valid, std::size_t most, std::vector<HostileFile>& files) {
  static const char* const kBad[] = {"nan", "-inf", "-1", "0", "999999999", "99999999999999999999", "1e400", "x", ""};
  const auto ranges = token_ranges(valid);
  const std::size_t step = std::max<std::size_t>(1, ranges.size() / most);
  for (std::size_t i = 0; i < ranges.size(); i += step) {
    for (const char* bad : kBad) {
      std::string text = valid;
      text.replace(ranges[i].first, ranges[i].second, bad);
      files.push_back({"token " + std::to_string(i) + " replaced by \"" + bad + "\"", text});
    }
  }
}

inline void add_random_bytes(const std::string& valid, std::vector<HostileFile>& files) {
  std::mt19937 generator(20210917);
  const auto byte = [&] { return static_cast<char>(generator() & 0xff); };
  for (int round = 0; round < 40; ++round) {
    std::string text = valid;
    for (std::size_t changes = 1 + generator() % 8; changes > 0 && !text.empty(); --changes) {
      text[generator() % text.size()] = byte();
    }
    files.push_back({"random bytes, round " + std::to_string(round), text});
  }
  for (std::size_t size : {1u, 7u, 64u, 1000u, 20000u}) {
    std::string noise(size, '\0');
    for (char& c : noise) c = byte();
    files.push_back({"noise of " + std::to_string(size) + " bytes", noise});
    files.push_back({"noise behind the header", valid.substr(0, valid.find('\n') + 1) + noise});
  }
}

/// Variants of a valid file, always the same ones. `density`: about how many positions are cut or changed.
inline std::vector<HostileFile> hostile_variants(const std::string& valid, std::size_t density = 60) {
  std::vector<HostileFile> files;
  add_truncations(valid, density, files);
  add_bad_tokens(valid, density, files);
  add_random_bytes(valid, files);
  files.push_back({"CRLF", with_crlf(valid)});
  files.push_back({"byte order mark", "\xEF\xBB\xBF" + valid});
  files.push_back({"twice", valid + valid});
  files.push_back({"blanks only", " \r\n\t\n"});
  files.push_back({"one line of a million characters", std::string(1000000, '7')});
  std::string nul = valid;
  nul.insert(nul.size() / 2, 1, '\0');
  files.push_back({"NUL byte", nul});
  return files;
}

inline void write_bytes(const std::filesystem::path& path, const std::string& content) {
  // Some file systems wait for the disk when a file is overwritten, but not when it is new.
  std::filesystem::remove(path);
  std::ofstream file(path, std::ios::binary);
  file.write(content.data(), static_cast<std::streamsize>(content.size()));
  if (!file.flush()) throw std::runtime_error("cannot write " + path.string());
}

/// A reader may take a file or refuse it with a doppel::Error that says something; anything else is a failure.
/// @return the message, or "" when the file was read
inline std::string expect_rejects_or_reads(const std::string& what, const std::function<void()>& read) {
  try {
    read();
    return "";
  } catch (const Error& e) {
    const std::string message = e.what();
    EXPECT_GT(message.size(), 10u) << what << ": the message says nothing";
    return message;
  } catch (const std::exception& e) {
    ADD_FAILURE() << what << ": threw another exception than doppel::Error: " << e.what();
    return e.what();
  }
}

/// Writes every variant of `valid` to `path` and reads it. The valid file itself must be read, an empty one refused,
/// and so must at least a quarter of the variants, or the reader does not look at its input.
inline void expect_survives_hostile_files(const std::filesystem::path& path, const std::string& valid,
                                          const std::function<void(const std::filesystem::path&)>& read,
                                          std::size_t density = 60) {
  write_bytes(path, valid);
  EXPECT_NO_THROW(read(path)) << "the valid file";
  write_bytes(path, "");
  EXPECT_THROW(read(path), Error) << "the empty file";
  const std::vector<HostileFile> files = hostile_variants(valid, density);
  std::size_t refused = 0;
  for (const HostileFile& file : files) {
    write_bytes(path, file.content);
    const std::string message = expect_rejects_or_reads(file.what, [&] { read(path); });
    refused += !message.empty();
    if (!message.empty()) {
      EXPECT_NE(message.find(path.filename().string()), std::string::npos)
          << file.what << ": the message does not name the file: " << message;
    }
  }
  EXPECT_GT(4 * refused, files.size()) << "only " << refused << " of " << files.size() << " broken files were refused";
  std::filesystem::remove(path);
  EXPECT_THROW(read(path), Error) << "the missing file";
}

}  // namespace doppel::support
