// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>

#include "runtime/channel.hpp"
#include "runtime/frame_header.hpp"
#include "runtime/live/socket.hpp"

namespace slambed {

/// Frames on one connected, non-blocking socket. Used by the I/O thread only.
class TcpConnection {
 public:
  /// Why a connection ends. rejected: the peer sent something invalid.
  struct End {
    bool rejected = false;
    std::string reason;
  };
  using Clock = std::function<RunTime()>;
  /// Handles a complete frame with a valid checksum. Returns the reason why it is refused, or
  /// nothing.
  using FrameHandler =
      std::function<std::optional<std::string>(const FrameHeader& header, Bytes payload)>;
  using MessageSource = std::function<std::optional<Message>()>;

  TcpConnection(FileDescriptor fd, std::size_t max_payload, RunTime opened);

  int fd() const { return fd_.get(); }
  RunTime opened() const { return opened_; }
  bool greeted() const { return greeted_; }
  bool wants_write() const { return sending_.has_value(); }
  bool sending() const { return sending_.has_value(); }

  /// Queues our greeting. Messages wait until the peer's greeting is accepted.
  void greet(std::uint64_t session_id, Bytes payload);

  /// Sends a heartbeat unless another frame is being sent.
  void send_heartbeat(const Clock& clock);
  /// When bytes were last received or sent; CLOCK_MONOTONIC.
  RunTime last_received() const { return last_received_; }
  RunTime last_sent() const { return last_sent_; }
  /// Bytes that the peer's kernel has acknowledged.
  std::uint64_t acknowledged() const { return written_ - unacknowledged_bytes(fd()); }

  /// Announces the end of the connection to the peer once all messages are sent.
  void begin_close() { closing_ = true; }
  bool close_sent() const { return close_sent_; }      ///< true once the announcement is queued
  bool peer_closing() const { return peer_closing_; }  ///< then its end is not a loss

  std::optional<End> read_some(const FrameHandler& on_greeting, const FrameHandler& on_message);
  std::optional<End> write_some(const Clock& clock, const MessageSource& next);
  /// Takes the message that was not completely handed to the kernel.
  std::optional<Message> take_unfinished();

 private:
  /// Returns nothing if no bytes are available, or if the connection ended and `end` is set.
  std::optional<std::size_t> receive(std::uint8_t* into, std::size_t want, std::optional<End>& end);
  std::optional<End> begin_payload();
  std::optional<End> finish_frame(const FrameHandler& on_greeting, const FrameHandler& on_message);
  void load(const Clock& clock, Message message, std::uint8_t flags);

  FileDescriptor fd_;
  std::size_t max_payload_;
  RunTime opened_;
  RunTime last_received_, last_sent_;
  bool greeted_ = false;

  std::array<std::uint8_t, FrameHeader::kSize> header_bytes_{};
  std::size_t header_read_ = 0;
  std::optional<FrameHeader> header_;
  Bytes payload_;
  std::size_t payload_read_ = 0;

  bool closing_ = false, close_sent_ = false, peer_closing_ = false;
  std::optional<Message> sending_;
  std::uint8_t sending_flags_ = 0;
  std::array<std::uint8_t, FrameHeader::kSize> sending_header_{};
  std::size_t sent_ = 0;       ///< bytes of the frame being sent
  std::uint64_t written_ = 0;  ///< bytes of all frames
};

}  // namespace slambed
