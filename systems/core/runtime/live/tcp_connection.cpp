// SPDX-License-Identifier: Apache-2.0
#include "runtime/live/tcp_connection.hpp"

#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <cerrno>

#include "runtime/live/live_runtime.hpp"

namespace slambed {
namespace {

/// A greeting is small. An unknown peer must not make us allocate more.
constexpr std::size_t kMaxGreeting = 4096;
/// The buffer of a payload grows as bytes arrive, so that a forged length costs no memory.
constexpr std::size_t kGrowStep = 1 << 20;
/// Bytes read from one connection before the others get their turn.
constexpr std::size_t kReadShare = 1 << 20;

}  // namespace

TcpConnection::TcpConnection(FileDescriptor fd, std::size_t max_payload, RunTime opened)
    : fd_(std::move(fd)),
      max_payload_(max_payload),
      opened_(opened),
      last_received_(opened),
      last_sent_(opened) {}

void TcpConnection::greet(std::uint64_t session_id, Bytes payload) {
  Message message;
  message.sequence = session_id;
  message.payload = std::move(payload);
  load([] { return RunTime{}; }, std::move(message), FrameHeader::kGreetingFlag);
}

void TcpConnection::send_heartbeat(const Clock& clock) {
  if (greeted_ && !sending_ && !close_sent_) load(clock, {}, FrameHeader::kAliveFlag);
}

void TcpConnection::load(const Clock& clock, Message message, std::uint8_t flags) {
  message.sent = clock();
  FrameHeader header;
  header.type = message.type;
  header.flags = flags;
  header.sequence = message.sequence;
  header.queued = message.queued;
  header.sent = message.sent;
  header.length = static_cast<std::uint32_t>(message.payload.size());
  header.payload_crc = checksum(message.payload);
  sending_header_ = header.encode();
  sending_ = std::move(message);
  sending_flags_ = flags;
  sent_ = 0;
}

std::optional<std::size_t> TcpConnection::receive(std::uint8_t* into, std::size_t want,
                                                  std::optional<End>& end) {
  for (;;) {
    const ssize_t got = ::recv(fd_.get(), into, want, 0);
    if (got > 0) return static_cast<std::size_t>(got);
    if (got == 0) {
      end = End{false, "closed by the peer"};
      return std::nullopt;
    }
    if (errno == EINTR) continue;
    if (errno != EAGAIN && errno != EWOULDBLOCK) end = End{false, error_text(errno)};
    return std::nullopt;
  }
}

std::optional<TcpConnection::End> TcpConnection::begin_payload() {
  auto decoded = FrameHeader::decode(header_bytes_);
  if (auto* reason = std::get_if<std::string>(&decoded)) return End{true, *reason};
  header_ = std::get<FrameHeader>(decoded);
  if (header_->greeting() == greeted_) {
    return End{true, greeted_ ? "second greeting" : "message before the greeting"};
  }
  const std::size_t limit = greeted_ ? max_payload_ : std::min(kMaxGreeting, max_payload_);
  if (header_->length > limit) {
    return End{true, "payload of " + std::to_string(header_->length) +
                         " bytes is over the limit of " + std::to_string(limit)};
  }
  payload_.clear();
  payload_read_ = 0;
  return std::nullopt;
}

std::optional<TcpConnection::End> TcpConnection::finish_frame(const FrameHandler& on_greeting,
                                                              const FrameHandler& on_message) {
  if (checksum(payload_) != header_->payload_crc) return End{true, "payload checksum is wrong"};
  std::optional<std::string> refused;
  if (header_->closes()) {
    peer_closing_ = true;
  } else if (header_->greeting()) {
    refused = on_greeting(*header_, std::move(payload_));
    if (!refused) greeted_ = true;
  } else if (!header_->alive()) {
    refused = on_message(*header_, std::move(payload_));
  }
  header_.reset();
  header_read_ = 0;
  payload_ = {};
  if (refused) return End{true, *refused};
  return std::nullopt;
}

std::optional<TcpConnection::End> TcpConnection::read_some(const FrameHandler& on_greeting,
                                                           const FrameHandler& on_message) {
  std::optional<End> end;
  std::size_t taken = 0;
  while (taken < kReadShare) {
    if (!header_) {
      const auto got =
          receive(header_bytes_.data() + header_read_, FrameHeader::kSize - header_read_, end);
      if (!got) break;
      taken += *got;
      header_read_ += *got;
      if (header_read_ < FrameHeader::kSize) continue;
      if ((end = begin_payload())) return end;
    }
    if (payload_read_ < header_->length) {
      if (payload_read_ == payload_.size()) {
        payload_.resize(std::min<std::size_t>(header_->length, payload_read_ + kGrowStep));
      }
      const auto got =
          receive(payload_.data() + payload_read_, payload_.size() - payload_read_, end);
      if (!got) break;
      taken += *got;
      payload_read_ += *got;
      if (payload_read_ < header_->length) continue;
    }
    if ((end = finish_frame(on_greeting, on_message))) return end;
  }
  if (taken > 0) {
    last_received_ = monotonic_now();
    acknowledge_now(fd_.get());
  }
  return end;
}

std::optional<TcpConnection::End> TcpConnection::write_some(const Clock& clock,
                                                            const MessageSource& next) {
  for (;;) {
    if (!sending_) {
      if (!greeted_) return std::nullopt;
      if (auto message = next()) {
        load(clock, std::move(*message), 0);
      } else if (closing_ && !close_sent_) {
        load(clock, {}, FrameHeader::kCloseFlag);
        close_sent_ = true;
      } else {
        return std::nullopt;
      }
    }
    const std::size_t total = FrameHeader::kSize + sending_->payload.size();
    while (sent_ < total) {
      std::array<iovec, 2> parts{};
      int count = 0;
      std::size_t in_payload = 0;
      if (sent_ < FrameHeader::kSize) {
        parts[count++] = {sending_header_.data() + sent_, FrameHeader::kSize - sent_};
      } else {
        in_payload = sent_ - FrameHeader::kSize;
      }
      if (in_payload < sending_->payload.size()) {
        parts[count++] = {sending_->payload.data() + in_payload,
                          sending_->payload.size() - in_payload};
      }
      msghdr header{};
      header.msg_iov = parts.data();
      header.msg_iovlen = static_cast<std::size_t>(count);
      const ssize_t written = ::sendmsg(fd_.get(), &header, MSG_NOSIGNAL);
      if (written < 0) {
        if (errno == EINTR) continue;
        if (errno == EAGAIN || errno == EWOULDBLOCK) return std::nullopt;
        return End{false, error_text(errno)};
      }
      sent_ += static_cast<std::size_t>(written);
      written_ += static_cast<std::uint64_t>(written);
      last_sent_ = monotonic_now();
    }
    sending_.reset();
  }
}

std::optional<Message> TcpConnection::take_unfinished() {
  if (sending_flags_ != 0) return std::nullopt;
  return std::exchange(sending_, std::nullopt);
}

}  // namespace slambed
