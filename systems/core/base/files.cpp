// SPDX-License-Identifier: Apache-2.0
#include "base/files.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <utility>

#include "base/fd.hpp"

namespace slambed {
namespace {

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

bool write_all(const std::filesystem::path& path,
               std::initializer_list<std::span<const std::uint8_t>> parts) {
  File file(std::fopen(path.c_str(), "wb"), &std::fclose);
  if (!file) return false;
  for (const auto part : parts) {
    if (part.empty()) continue;  // data() may be null, which fwrite does not accept
    if (std::fwrite(part.data(), 1, part.size(), file.get()) != part.size()) return false;
  }
  return std::fclose(file.release()) == 0;
}

}  // namespace

Error cannot_write(const std::filesystem::path& path) {
  const std::string why = errno == 0 ? "" : ": " + error_text(errno);
  return environment_error(path.string() + ": cannot be written" + why +
                           "; check the folder's rights and the free space");
}

void write_whole(const std::filesystem::path& path,
                 std::initializer_list<std::span<const std::uint8_t>> parts) {
  // The process id keeps two processes that write the same file apart.
  const std::filesystem::path part = path.string() + "." + std::to_string(::getpid()) + ".part";
  errno = 0;
  if (write_all(part, parts) && ::rename(part.c_str(), path.c_str()) == 0) return;
  const int reason = errno;
  std::error_code ignored;
  std::filesystem::remove(part, ignored);
  errno = reason;
  throw cannot_write(path);
}

void write_whole(const std::filesystem::path& path, const std::string& text) {
  write_whole(path, {{reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}});
}

std::vector<std::uint8_t> read_whole(const std::filesystem::path& path, const std::string& what,
                                     std::uintmax_t most) {
  const std::string name = what + " " + path.string();
  std::ifstream in(path, std::ios::binary);
  if (!in) throw bad_input(name + ": cannot be opened; check the path");
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error || size > most) throw bad_input(name + ": has an impossible size");
  std::vector<std::uint8_t> bytes(size);
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!in) throw bad_input(name + ": cannot be read");
  return bytes;
}

TextFile::TextFile(std::filesystem::path path)
    : path_(std::move(path)), file_(std::fopen(path_.c_str(), "w"), &std::fclose) {
  check(file_ != nullptr);
}

MappedFile MappedFile::open(const std::filesystem::path& path) {
  MappedFile file;
  const FileDescriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (!fd || ::fstat(fd.get(), &status) != 0) return file;
  if (status.st_size > 0) {
    const auto size = static_cast<std::size_t>(status.st_size);
    void* data = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, fd.get(), 0);
    if (data == MAP_FAILED) return file;
    file.bytes_ = {static_cast<const std::uint8_t*>(data), size};
  }
  file.there_ = true;
  return file;
}

MappedFile::MappedFile(MappedFile&& other) noexcept
    : there_(std::exchange(other.there_, false)), bytes_(std::exchange(other.bytes_, {})) {}

MappedFile& MappedFile::operator=(MappedFile&& other) noexcept {
  std::swap(there_, other.there_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

MappedFile::~MappedFile() {
  if (!bytes_.empty()) ::munmap(const_cast<std::uint8_t*>(bytes_.data()), bytes_.size());
}

void MappedFile::read_ahead() const {
  if (!bytes_.empty())
    ::madvise(const_cast<std::uint8_t*>(bytes_.data()), bytes_.size(), MADV_SEQUENTIAL);
}

}  // namespace slambed
