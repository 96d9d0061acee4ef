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

/// Returns the error to throw when a file cannot be written: its path and the text of errno.
Error cannot_write(const std::filesystem::path& path);

/// Writes a file atomically: concatenates the parts into a temporary file in the same folder and
/// renames it. Throws cannot_write.
void write_whole(const std::filesystem::path& path,
                 std::initializer_list<std::span<const std::uint8_t>> parts);
void write_whole(const std::filesystem::path& path, const std::string& text);

/// Returns all bytes of a file. Throws Error(kBadInput) when it cannot be read or is larger than
/// `most` bytes; `what` names the kind of file in the message ("map").
std::vector<std::uint8_t> read_whole(const std::filesystem::path& path, const std::string& what,
                                     std::uintmax_t most);

/// A text file that is written line by line. Everything but the destructor throws cannot_write.
class TextFile {
 public:
  explicit TextFile(std::filesystem::path path);
  template <typename... Values>
  void print(const char* format, Values... values) {
    check(std::fprintf(file_.get(), format, values...) >= 0);
  }
  /// Hands everything printed so far to the kernel.
  void flush() { check(std::fflush(file_.get()) == 0); }
  void close() { check(std::fclose(file_.release()) == 0); }

 private:
  void check(bool good) const {
    if (!good) throw cannot_write(path_);
  }
  std::filesystem::path path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

/// A read-only memory mapping of a file.
class MappedFile {
 public:
  MappedFile() = default;
  /// Returns a false object and sets errno when the file cannot be mapped. An empty file is valid.
  static MappedFile open(const std::filesystem::path& path);
  MappedFile(MappedFile&& other) noexcept;
  MappedFile& operator=(MappedFile&& other) noexcept;
  ~MappedFile();

  explicit operator bool() const { return there_; }
  std::span<const std::uint8_t> bytes() const { return bytes_; }
  /// Tells the kernel that the file will be read from start to end.
  void read_ahead() const;

 private:
  bool there_ = false;
  std::span<const std::uint8_t> bytes_;
};

}  // namespace slambed
