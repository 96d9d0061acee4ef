// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "runtime/live/socket.hpp"
#include "sequence/prepared_sequence.hpp"

namespace slambed {

/// The pictures that a system gets to see: a ring of frames in memory that it maps read-only. It
/// holds no frame that was not offered yet, so that nobody looks ahead.
class FrameMemory {
 public:
  static constexpr std::uint32_t kSlots = 4;

  /// environment_error where the kernel gives no memory.
  explicit FrameMemory(std::size_t slot_bytes);
  ~FrameMemory();
  FrameMemory(const FrameMemory&) = delete;
  FrameMemory& operator=(const FrameMemory&) = delete;

  /// Copies a frame behind the last one; returns its slot.
  std::uint32_t put(const PreparedSequence::Frame& frame);
  std::size_t slot_bytes() const { return slot_bytes_; }
  int fd() const { return fd_.get(); }

 private:
  std::size_t slot_bytes_;
  FileDescriptor fd_;
  std::uint8_t* data_ = nullptr;
  std::uint32_t next_ = 0;
};

/// Bytes of a frame as the client finds them: the gray picture, then depth or the right picture.
std::size_t frame_bytes(const PreparedSequence& sequence);

}  // namespace slambed
