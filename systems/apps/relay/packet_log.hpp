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
/// `harness/slambed/link/packets.py` reads it and must be changed together with this.
struct PacketRecord {
  std::int64_t in_ns;         ///< read from the sender's device
  std::int64_t due_ns;        ///< delivery time by the link model; 0 if dropped
  std::int64_t out_ns;        ///< written to the receiver's device; 0 if dropped
  std::int64_t profile_ns;    ///< the profile's part of the delay
  std::uint32_t queue_bytes;  ///< bytes in the rate limiter's queue when it arrived
  std::uint32_t bytes;
  std::uint16_t tag;       ///< ICMP echo sequence number, else 0
  std::uint8_t direction;  ///< 0 up, 1 down
  std::uint8_t fate;
  std::uint8_t protocol;  ///< of the IPv4 header
  std::uint8_t padding[3];
};
static_assert(sizeof(PacketRecord) == 48);

/// Writes packet records to a file. append() never waits for the disk, because another thread
/// writes.
class PacketLog {
 public:
  /// With an empty path nothing is logged. Throws environment_error if the file cannot be opened.
  explicit PacketLog(const std::string& path);
  ~PacketLog();
  PacketLog(const PacketLog&) = delete;
  PacketLog& operator=(const PacketLog&) = delete;

  void append(const PacketRecord& record);

  /// Writes all records and closes the file; later records are dropped. Throws environment_error if
  /// a record could not be written. A second call does nothing harmful.
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
  std::vector<PacketRecord> filling_;  ///< used by the relay's thread only
  std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<PacketRecord> handed_over_;
  bool closed_ = false;
  int error_ = 0;  ///< errno of the first failed write; used by the writer thread until it ends
  std::thread writer_;
};

}  // namespace slambed::relay
