// SPDX-License-Identifier: Apache-2.0
#include "apps/play/conversation.hpp"

#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "apps/play/frame_memory.hpp"
#include "base/error.hpp"

namespace slambed {

Conversation::Conversation() {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) {
    throw environment_error("no socket for the system's client: " + error_text(errno));
  }
  ours_ = FileDescriptor(ends[0]);
  theirs_ = FileDescriptor(ends[1]);
}

std::optional<Conversation::Packet> Conversation::next() {
  ssize_t bytes = 0;
  do {
    bytes = recv(ours_.get(), buffer_.data(), buffer_.size(), MSG_TRUNC);
  } while (bytes < 0 && errno == EINTR);
  if (bytes <= 0) return std::nullopt;
  const auto size = static_cast<std::size_t>(bytes);
  Packet packet;
  if (size >= sizeof packet.type) std::memcpy(&packet.type, buffer_.data(), sizeof packet.type);
  const bool pose = packet.type == SLAMBED_POSE || packet.type == SLAMBED_FINAL;
  const bool event = packet.type == SLAMBED_EVENT;
  const bool plain =
      packet.type == SLAMBED_HELLO || packet.type == SLAMBED_READY || packet.type == SLAMBED_NEXT;
  const bool whole = (pose && size == sizeof packet.pose) ||
                     (event && size > sizeof packet.type && size <= buffer_.size()) ||
                     (plain && size == sizeof packet.type);
  if (!whole) {
    throw bad_input("the system sent a packet of " + std::to_string(size) + " bytes, type " +
                    std::to_string(packet.type) +
                    ", which is none of the protocol; use slambed_client");
  }
  if (pose) std::memcpy(&packet.pose, buffer_.data(), sizeof packet.pose);
  if (event) packet.text = {buffer_.data() + sizeof packet.type, size - sizeof packet.type};
  return packet;
}

void Conversation::send_end() {
  const std::uint32_t type = SLAMBED_END;
  send(&type, sizeof type);
}

void Conversation::hang_up() { shutdown(ours_.get(), SHUT_RDWR); }

void Conversation::send(const void* packet, std::size_t bytes) {
  // Errors are ignored: next() notices that the client is gone.
  while (::send(ours_.get(), packet, bytes, MSG_NOSIGNAL) < 0 && errno == EINTR) {
  }
}

slambed_info describe(const PreparedSequence& sequence, double played_fps, std::size_t slot_bytes) {
  const Camera& camera = sequence.camera();
  slambed_info info{};
  info.sensor = sequence.sensor() == SensorKind::kRgbd     ? SLAMBED_RGBD
                : sequence.sensor() == SensorKind::kStereo ? SLAMBED_STEREO
                                                           : SLAMBED_MONO;
  info.width = static_cast<std::uint32_t>(camera.width);
  info.height = static_cast<std::uint32_t>(camera.height);
  info.slots = FrameMemory::kSlots;
  info.slot_bytes = slot_bytes;
  info.fx = camera.fx;
  info.fy = camera.fy;
  info.cx = camera.cx;
  info.cy = camera.cy;
  info.bf = camera.bf;
  std::copy(camera.distortion.begin(), camera.distortion.end(), info.distortion);
  info.depth_unit_m = sequence.depth_unit_m();
  info.fps = played_fps;
  return info;
}

}  // namespace slambed
