// SPDX-License-Identifier: Apache-2.0
/// Tests a pipe between two socket pairs that stand in for the TUN devices.
#include "apps/relay/pipe.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>

#include "apps/relay/clock.hpp"
#include "base/error.hpp"

namespace slambed::relay {
namespace {

constexpr std::int64_t kMs = 1'000'000;
using Packet = std::vector<std::uint8_t>;

struct SocketPair {
  SocketPair() { EXPECT_EQ(socketpair(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0, ends), 0); }
  ~SocketPair() {
    close(ends[0]);
    close(ends[1]);
  }
  int ends[2] = {-1, -1};
};

Packet ipv4(std::uint8_t protocol, std::size_t size = 60) {
  Packet packet(size, 0);
  packet[0] = 0x45;
  packet[9] = protocol;
  return packet;
}

Packet echo_request(std::uint16_t sequence) {
  Packet packet = ipv4(1);
  packet[20] = 8;
  packet[26] = static_cast<std::uint8_t>(sequence >> 8);
  packet[27] = static_cast<std::uint8_t>(sequence);
  return packet;
}

class PipeTest : public testing::Test {
 protected:
  PipeTest()
      : log_path_(std::filesystem::temp_directory_path() /
                  ("relay_pipe_" + std::to_string(getpid()) + ".bin")),
        log_(std::make_unique<PacketLog>(log_path_.string())) {}
  ~PipeTest() override { std::filesystem::remove(log_path_); }

  Pipe pipe(const DirectionOptions& options) {
    return {options, 1, 0, from_.ends[0], to_.ends[0], *log_};
  }
  void send(const Packet& packet) {
    ASSERT_EQ(write(from_.ends[1], packet.data(), packet.size()),
              static_cast<ssize_t>(packet.size()));
  }
  std::size_t receive() {
    const ssize_t size = ::read(to_.ends[1], buffer_.data(), buffer_.size());
    return size < 0 ? 0 : static_cast<std::size_t>(size);
  }

  /// Closes the log and reads it back.
  std::vector<PacketRecord> logged() {
    log_.reset();
    std::ifstream file(log_path_, std::ios::binary);
    std::vector<PacketRecord> records;
    for (PacketRecord record; file.read(reinterpret_cast<char*>(&record), sizeof record);) {
      records.push_back(record);
    }
    return records;
  }

  SocketPair from_, to_;
  std::filesystem::path log_path_;
  std::unique_ptr<PacketLog> log_;
  std::array<std::uint8_t, 2048> buffer_{};
};

TEST_F(PipeTest, HandsPacketsOverAtOnceWhenThereIsNoDelay) {
  Pipe pipe = this->pipe({});
  send(ipv4(17, 100));
  send(echo_request(0x1234));
  EXPECT_EQ(pipe.take(8, buffer_), 2);
  EXPECT_EQ(receive(), 100U);
  EXPECT_EQ(receive(), 60U);
  const auto records = logged();
  ASSERT_EQ(records.size(), 2U);
  EXPECT_EQ(records[0].tag, 0);
  EXPECT_EQ(records[1].tag, 0x1234);
  EXPECT_GE(records[1].out_ns, records[1].in_ns);
}

TEST_F(PipeTest, HoldsPacketsUntilTheyAreDueAndInOrder) {
  DirectionOptions options;
  options.delays_ns = {5 * kMs};
  Pipe pipe = this->pipe(options);
  pipe.model().apply_profile();
  const std::int64_t before_ns = monotonic_ns();
  for (std::size_t size = 40; size < 48; ++size) send(ipv4(6, size));
  EXPECT_EQ(pipe.take(32, buffer_), 8);
  EXPECT_EQ(receive(), 0U);
  ASSERT_GE(pipe.next_due_ns(), before_ns + 5 * kMs);
  while (pipe.next_due_ns() != Pipe::kNothingDue) pipe.deliver_due();
  EXPECT_GE(monotonic_ns(), before_ns + 5 * kMs);
  for (std::size_t size = 40; size < 48; ++size) EXPECT_EQ(receive(), size);
  for (const auto& record : logged()) {
    EXPECT_GE(record.out_ns, record.due_ns);
    EXPECT_EQ(record.profile_ns, 5 * kMs);
  }
}

TEST_F(PipeTest, ProbesAndDataAreEachInOrder) {
  DirectionOptions options;
  options.delays_ns = {2 * kMs};
  options.jitter = link::JitterOptions{
      .shape = link::JitterShape::kPareto, .scale_ns = 3.0 * kMs, .max_ns = 20.0 * kMs};
  Pipe pipe = this->pipe(options);
  pipe.model().apply_profile();
  for (int i = 1; i <= 20; ++i) {
    send(ipv4(6, 40));
    send(echo_request(static_cast<std::uint16_t>(i)));
  }
  EXPECT_EQ(pipe.take(64, buffer_), 40);
  while (pipe.next_due_ns() != Pipe::kNothingDue) pipe.deliver_due();
  std::int64_t due[2] = {0, 0};
  int count[2] = {0, 0};
  for (const auto& record : logged()) {
    const int lane = record.tag != 0;
    EXPECT_GE(record.due_ns, due[lane]);  // in order within its lane
    due[lane] = record.due_ns;
    ++count[lane];
  }
  EXPECT_EQ(count[0], 20);
  EXPECT_EQ(count[1], 20);
}

TEST_F(PipeTest, CarriesIpv4Only) {
  Pipe pipe = this->pipe({});
  Packet ipv6(60, 0);
  ipv6[0] = 0x60;
  send(ipv6);
  send(Packet(3, 0x45));
  EXPECT_EQ(pipe.take(8, buffer_), 2);
  EXPECT_EQ(receive(), 0U);
  EXPECT_EQ(pipe.counters().packets, 0);
}

TEST_F(PipeTest, ATruncatedEchoIsJustAPacket) {
  Pipe pipe = this->pipe({});
  Packet packet = ipv4(1, 22);
  packet[0] = 0x4f;  // claims a header longer than the packet
  send(packet);
  pipe.take(1, buffer_);
  EXPECT_EQ(receive(), 22U);
  EXPECT_EQ(logged().at(0).tag, 0);
}

TEST_F(PipeTest, LogsWhatItDrops) {
  DirectionOptions options;
  options.loss = link::LossOptions{.loss_good = 1.0};
  Pipe pipe = this->pipe(options);
  pipe.model().apply_profile();
  for (int i = 0; i < 600; ++i) {  // more than one batch of the log
    send(ipv4(17));
    pipe.take(1, buffer_);
  }
  EXPECT_EQ(receive(), 0U);
  const auto records = logged();
  ASSERT_EQ(records.size(), 600U);
  for (const auto& record : records) {
    EXPECT_EQ(record.fate, static_cast<std::uint8_t>(Fate::kLost));
    EXPECT_EQ(record.out_ns, 0);
  }
}

TEST_F(PipeTest, ADeviceThatGoesAwayIsAnErrorOfThePeer) {
  PacketLog log("");
  Pipe pipe({}, 1, 1, -1, to_.ends[0], log);
  try {
    pipe.take(1, buffer_);
    FAIL() << "read from a closed device";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kPeer);
    EXPECT_NE(std::string(error.what()).find("edge side"), std::string::npos);
  }
}

TEST(PacketLog, AFileThatCannotBeWrittenIsNamed) {
  EXPECT_THROW(PacketLog("/nowhere/packets.bin"), Error);
}

TEST(PacketLog, AFullDiskIsToldWhenItIsClosed) {
  PacketLog log("/dev/full");
  log.append({});
  try {
    log.close();
    FAIL() << "wrote to a full disk";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kEnvironment);
    EXPECT_NE(std::string(error.what()).find("No space left"), std::string::npos);
  }
  log.close();
}

}  // namespace
}  // namespace slambed::relay
