// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace slambed::relay {

/// One packet in the log, little-endian, 48 bytes; times on CLOCK_MONOTONIC.
/// `harness/slambed/link/packets.py` reads it: keep both in step.
struct PacketRecord {
  std::int64_t in_ns;         ///< read from the sender's device
  std::int64_t due_ns;        ///< when the model wanted it out; 0 when dropped
  std::int64_t out_ns;        ///< written to the receiver's device; 0 when dropped
  std::int64_t profile_ns;    ///< the profile's part of the delay
  std::uint32_t queue_bytes;  ///< waiting for the rate when it came
  std::uint32_t bytes;
  std::uint16_t tag;       ///< ICMP echo sequence number, else 0
  std::uint8_t direction;  ///< 0 up, 1 down
  std::uint8_t fate;
  std::uint8_t protocol;  ///< of the IPv4 header
  std::uint8_t padding[3];
};
static_assert(sizeof(PacketRecord) == 48);

/// Packet records to a file. `append` never waits for the disk: a second thread writes.
class PacketLog {
 public:
  /// An empty path logs nothing. Throws environment_error.
  explicit PacketLog(const std::string& path);
  ~PacketLog();
  PacketLog(const PacketLog&) = delete;
  PacketLog& operator=(const PacketLog&) = delete;

  void append(const PacketRecord& record);

  /// Everything to the file; after it, nothing is logged any more. Throws environment_error when a
  /// record could not be written. Calling it twice is harmless.
  void close();

 private:
  void end_writer();
  void write_until_closed();
  bool write(const std::vector<PacketRecord>& records);

  struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  std::string path_;
  std::unique_ptr<std::FILE, CloseFile> file_;
  std::vector<PacketRecord> filling_;  ///< only the relay's thread touches it
  std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<PacketRecord> handed_over_;
  bool closed_ = false;
  int error_ = 0;  ///< errno of the first write that failed; the writer's until it has ended
  std::thread writer_;
};

}  // namespace slambed::relay
