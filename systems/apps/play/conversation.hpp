// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "apps/play/client/slambed_client.h"
#include "node/playback.hpp"
#include "runtime/live/socket.hpp"
#include "sequence/prepared_sequence.hpp"

namespace slambed {

/// The player's end of its socket to a system's client.
class Conversation {
 public:
  /// One packet of the client.
  struct Packet {
    std::uint32_t type = 0;
    slambed_pose pose{};    ///< of SLAMBED_POSE and SLAMBED_FINAL
    std::string_view text;  ///< of SLAMBED_EVENT; valid until the next packet
  };

  Conversation();

  int client_fd() const { return theirs_.get(); }
  /// Closes the client's end once the client has inherited it, so that next() sees the client end.
  void forget_client() { theirs_.reset(); }

  /// Waits for a packet. Returns nothing when the client is gone. Throws bad_input for a packet
  /// that does not follow the protocol.
  std::optional<Packet> next();
  void send_info(const slambed_info& info) { send(&info, sizeof info); }
  void send_frame(const slambed_frame& frame) { send(&frame, sizeof frame); }
  void send_end();
  /// Wakes a thread that waits in next(). Callable from any thread.
  void hang_up();

 private:
  void send(const void* packet, std::size_t bytes);

  FileDescriptor ours_, theirs_;
  std::array<char, sizeof(std::uint32_t) + SLAMBED_EVENT_BYTES> buffer_{};
};

/// Returns the description of the sequence for the client.
slambed_info describe(const PreparedSequence& sequence, double played_fps, std::size_t slot_bytes);

}  // namespace slambed
