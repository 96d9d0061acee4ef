// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "runtime/live/socket.hpp"
#include "sequence/prepared_sequence.hpp"

namespace slambed {

/// A ring of frames in shared memory, which the system maps read-only. It has only frames that were
/// already offered, so that the system cannot look ahead.
class FrameMemory {
 public:
  static constexpr std::uint32_t kSlots = 4;

  /// Throws environment_error if there is no memory.
  explicit FrameMemory(std::size_t slot_bytes);
  ~FrameMemory();
  FrameMemory(const FrameMemory&) = delete;
  FrameMemory& operator=(const FrameMemory&) = delete;

  /// Copies a frame into the next slot and returns that slot.
  std::uint32_t put(const PreparedSequence::Frame& frame);
  std::size_t slot_bytes() const { return slot_bytes_; }
  int fd() const { return fd_.get(); }

 private:
  std::size_t slot_bytes_;
  FileDescriptor fd_;
  std::uint8_t* data_ = nullptr;
  std::uint32_t next_ = 0;
};

/// Returns the size of a frame in a slot: the gray picture, then depth or the right picture.
std::size_t frame_bytes(const PreparedSequence& sequence);

}  // namespace slambed
