// SPDX-License-Identifier: Apache-2.0
#include "sequence/frame_file.hpp"

#include <unistd.h>
#include <zlib.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "base/error.hpp"

namespace slambed {
namespace {

constexpr std::size_t kHeaderBytes = 20, kBlockHeadBytes = 8;

template <typename T>
T read_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

template <typename T>
void append(std::vector<std::uint8_t>& bytes, const T* values, std::size_t count) {
  const std::size_t at = bytes.size();
  bytes.resize(at + count * sizeof(T));
  if (count > 0) std::memcpy(bytes.data() + at, values, count * sizeof(T));
}

std::uint32_t crc(std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(::crc32_z(0, bytes.data(), bytes.size()));
}

void write(std::ofstream& file, std::span<const std::uint8_t> bytes) {
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

}  // namespace

FrameFile::FrameFile(Kind kind, std::filesystem::path path, std::uint64_t frames)
    : kind_(std::move(kind)), path_(std::move(path)), frames_(frames) {}

void FrameFile::open_or_make(const std::string& key, const Make& make) {
  if (open(key)) return;
  make_all(key, make);
  if (!open(key)) {
    throw environment_error(kind_.name + " " + path_.string() + ": cannot be read back; remove it");
  }
}

void FrameFile::make_all(const std::string& key, const Make& make) const {
  errno = 0;
  const std::filesystem::path part = path_.string() + "." + std::to_string(::getpid());
  std::ofstream file(part, std::ios::binary);
  std::vector<std::uint8_t> head;
  const std::uint32_t magic[2] = {kind_.magic, kind_.version};
  const auto key_length = static_cast<std::uint32_t>(key.size());
  append(head, magic, 2);
  append(head, &frames_, 1);
  append(head, &key_length, 1);
  append(head, key.data(), key.size());
  head.resize((head.size() + 7) / 8 * 8);
  std::vector<std::uint64_t> offsets{head.size() + (frames_ + 1) * sizeof(std::uint64_t)};
  file.seekp(static_cast<std::streamoff>(offsets.front()));
  for (std::uint64_t frame = 0; frame < frames_ && file; ++frame) {
    const OwnedBlock block = make(frame);
    const std::uint32_t block_head[2] = {block.count, crc(block.bytes)};
    std::vector<std::uint8_t> bytes;
    append(bytes, block_head, 2);
    write(file, bytes);
    write(file, block.bytes);
    offsets.push_back(offsets.back() + kBlockHeadBytes + block.bytes.size());
  }
  append(head, offsets.data(), offsets.size());
  file.seekp(0);
  write(file, head);
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(part, path_, error);
  if (!file || error) {
    const int saved = errno;
    std::filesystem::remove(part, error);
    errno = saved;
    throw cannot_write(path_);
  }
}

bool FrameFile::open(const std::string& key) {
  mapped_ = MappedFile::open(path_);
  file_ = mapped_.bytes();
  const std::size_t size = file_.size();
  offsets_at_ = (kHeaderBytes + key.size() + 7) / 8 * 8;
  const std::size_t table_bytes = (frames_ + 1) * sizeof(std::uint64_t);
  const bool good = size >= offsets_at_ + table_bytes &&
                    read_at<std::uint32_t>(file_, 0) == kind_.magic &&
                    read_at<std::uint32_t>(file_, 4) == kind_.version &&
                    read_at<std::uint64_t>(file_, 8) == frames_ &&
                    read_at<std::uint32_t>(file_, 16) == key.size() &&
                    std::memcmp(file_.data() + kHeaderBytes, key.data(), key.size()) == 0 &&
                    offset(frames_) == size;
  if (good) return true;
  file_ = {};
  mapped_ = {};
  return false;
}

std::uint64_t FrameFile::offset(std::uint64_t frame) const {
  return read_at<std::uint64_t>(file_, offsets_at_ + frame * sizeof(std::uint64_t));
}

void FrameFile::refuse(std::uint64_t frame, const std::string& what) const {
  throw bad_input(kind_.name + " " + path_.string() + ": frame " + std::to_string(frame) + " " +
                  what + "; remove the file, it is made anew");
}

FrameFile::Block FrameFile::block(std::uint64_t frame) const {
  if (frame >= frames_) refuse(frame, "is not in it");
  const std::uint64_t begin = offset(frame), end = offset(frame + 1);
  if (end < begin || end > file_.size()) refuse(frame, "is damaged");
  const auto block = parse(file_.subspan(begin, end - begin));
  if (!block) refuse(frame, "is damaged");
  return *block;
}

std::optional<FrameFile::Block> FrameFile::parse(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < kBlockHeadBytes) return std::nullopt;
  const auto body = bytes.subspan(kBlockHeadBytes);
  if (crc(body) != read_at<std::uint32_t>(bytes, 4)) return std::nullopt;
  return Block{read_at<std::uint32_t>(bytes, 0), body};
}

}  // namespace slambed
