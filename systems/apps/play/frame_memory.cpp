// SPDX-License-Identifier: Apache-2.0
#include "apps/play/frame_memory.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "base/error.hpp"

namespace slambed {
namespace {

template <typename Pixel>
std::uint8_t* copy(const ImageView<Pixel>& image, std::uint8_t* to) {
  const std::size_t row_bytes = static_cast<std::size_t>(image.width) * sizeof(Pixel);
  for (int y = 0; y < image.height; ++y, to += row_bytes) std::memcpy(to, image.row(y), row_bytes);
  return to;
}

}  // namespace

std::size_t frame_bytes(const PreparedSequence& sequence) {
  const std::size_t pixels =
      static_cast<std::size_t>(sequence.camera().width) * sequence.camera().height;
  switch (sequence.sensor()) {
    case SensorKind::kRgbd:
      return 3 * pixels;
    case SensorKind::kStereo:
      return 2 * pixels;
    case SensorKind::kMono:
      break;
  }
  return pixels;
}

FrameMemory::FrameMemory(std::size_t slot_bytes)
    : slot_bytes_((slot_bytes + 4095) / 4096 * 4096),
      fd_(static_cast<int>(memfd_create("slambed-frames", 0))) {
  const std::size_t bytes = kSlots * slot_bytes_;
  void* at = MAP_FAILED;
  if (fd_ && ftruncate(fd_.get(), static_cast<off_t>(bytes)) == 0) {
    at = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd_.get(), 0);
  }
  if (at == MAP_FAILED) {
    throw environment_error("no shared memory for the frames: " +
                            std::string(std::strerror(errno)) + "; give the node more memory");
  }
  data_ = static_cast<std::uint8_t*>(at);
}

FrameMemory::~FrameMemory() { munmap(data_, kSlots * slot_bytes_); }

std::uint32_t FrameMemory::put(const PreparedSequence::Frame& frame) {
  const std::uint32_t slot = next_;
  next_ = (next_ + 1) % kSlots;
  std::uint8_t* end = copy(frame.gray, data_ + slot * slot_bytes_);
  if (frame.depth.data != nullptr) copy(frame.depth, end);
  if (frame.right.data != nullptr) copy(frame.right, end);
  return slot;
}

}  // namespace slambed
