// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/error.hpp"

namespace slambed {

/// To throw where a file cannot be written: names it, and says what errno does.
Error cannot_write(const std::filesystem::path& path);

/// Writes a file whole or not at all: its parts one after the other, into another one beside it
/// that then takes the name. Throws cannot_write.
void write_whole(const std::filesystem::path& path,
                 std::initializer_list<std::span<const std::uint8_t>> parts);
void write_whole(const std::filesystem::path& path, const std::string& text);

/// All bytes of a file. what: for the complaint ("map"). Throws Error(kBadInput) where there is
/// none, or more than so many bytes.
std::vector<std::uint8_t> read_whole(const std::filesystem::path& path, const std::string& what,
                                     std::uintmax_t most);

/// A text file that is written line by line. All but the destructor throw cannot_write.
class TextFile {
 public:
  explicit TextFile(std::filesystem::path path);
  template <typename... Values>
  void print(const char* format, Values... values) {
    check(std::fprintf(file_.get(), format, values...) >= 0);
  }
  /// What was printed is with the kernel then.
  void flush() { check(std::fflush(file_.get()) == 0); }
  void close() { check(std::fclose(file_.release()) == 0); }

 private:
  void check(bool good) const {
    if (!good) throw cannot_write(path_);
  }
  std::filesystem::path path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

/// A file in memory, as long as this lives.
class MappedFile {
 public:
  MappedFile() = default;
  /// Nothing where it cannot be had, and errno says why; an empty file has no bytes.
  static MappedFile open(const std::filesystem::path& path);
  MappedFile(MappedFile&& other) noexcept;
  MappedFile& operator=(MappedFile&& other) noexcept;
  ~MappedFile();

  explicit operator bool() const { return there_; }
  std::span<const std::uint8_t> bytes() const { return bytes_; }
  /// For who reads it from its beginning to its end.
  void read_ahead() const;

 private:
  bool there_ = false;
  std::span<const std::uint8_t> bytes_;
};

}  // namespace slambed
