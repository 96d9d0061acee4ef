// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <filesystem>
#include <functional>
#include <thread>
#include <vector>

#include "wire/byte_io.hpp"

namespace slambed::testing {

/// A segmenter in this process. The test defines every byte of its answers, including the length.
/// An empty answer closes the connection.
class SegmenterServer {
 public:
  using Bytes = wire::Bytes;
  using Answer = std::function<Bytes(const Bytes& question)>;

  SegmenterServer(const std::filesystem::path& place, Answer answer) : answer_(std::move(answer)) {
    door_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string name = place.filename().string();
    std::memcpy(address.sun_path, name.data(), name.size());
    const auto before = std::filesystem::current_path();
    std::filesystem::current_path(place.parent_path());  // addresses hold at most 107 characters
    EXPECT_EQ(::bind(door_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    std::filesystem::current_path(before);
    EXPECT_EQ(::listen(door_, 1), 0);
    thread_ = std::thread([this] { serve(); });
  }
  ~SegmenterServer() {
    ::shutdown(door_, SHUT_RDWR);
    ::shutdown(caller_, SHUT_RDWR);
    thread_.join();
    ::close(door_);
  }
  SegmenterServer(const SegmenterServer&) = delete;
  SegmenterServer& operator=(const SegmenterServer&) = delete;

  int calls() const { return calls_; }

  static Bytes holding(const Bytes& block) {
    wire::ByteWriter out;
    out.u32(static_cast<std::uint32_t>(block.size()));
    for (const std::uint8_t byte : block) out.u8(byte);
    return out.take();
  }

 private:
  void serve() {
    for (;;) {
      const int caller = ::accept(door_, nullptr, nullptr);
      if (caller < 0) return;
      ++calls_;
      caller_ = caller;
      while (const auto question = read(caller)) {
        const Bytes answer = answer_(*question);
        if (answer.empty()) break;
        if (::send(caller, answer.data(), answer.size(), MSG_NOSIGNAL) < 0) break;
      }
      caller_ = -1;
      ::close(caller);
    }
  }

  static std::optional<Bytes> read(int caller) {
    std::uint32_t size = 0;
    if (::recv(caller, &size, sizeof size, MSG_WAITALL) != sizeof size) return std::nullopt;
    Bytes question(size);
    const auto came = ::recv(caller, question.data(), size, MSG_WAITALL);
    return came == ssize_t{size} ? std::optional(question) : std::nullopt;
  }

  Answer answer_;
  int door_ = -1;
  std::atomic<int> caller_{-1}, calls_{0};
  std::thread thread_;
};

}  // namespace slambed::testing
