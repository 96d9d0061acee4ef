// SPDX-License-Identifier: Apache-2.0
#include "run/segmenter_client.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>

#include "base/fd.hpp"
#include "sequence/frame_file.hpp"
#include "wire/byte_io.hpp"
#include "wire/mask_codec.hpp"

namespace slambed {
namespace {

/// The masks of any image are smaller, so a longer answer did not come from a segmenter.
constexpr std::uint32_t kLargestAnswer = 16 << 20;

/// Thrown with the reason why an image has no masks.
struct Failure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

[[noreturn]] void fail_with_errno(const std::string& what) {
  throw Failure(what + ": " + error_text(errno));
}

/// Connects without waiting. Returns false and sets errno on failure. Uses the folder's descriptor
/// because a socket address is limited to 107 characters, and paths of run folders are longer.
bool connect_to(int fd, const std::filesystem::path& socket) {
  const FileDescriptor folder(
      ::open(socket.parent_path().c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
  if (!folder) return false;
  const std::string path =
      "/proc/self/fd/" + std::to_string(folder.get()) + "/" + socket.filename().string();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const bool fits = path.size() < sizeof address.sun_path;
  std::copy_n(path.c_str(), fits ? path.size() : 0, address.sun_path);
  errno = ENAMETOOLONG;
  return fits && ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

}  // namespace

Segmentation SegmenterClient::masks(std::uint64_t, std::span<const std::uint8_t> jpeg,
                                    double threshold) {
  deadline_ = Clock::now() + std::chrono::duration_cast<Clock::duration>(options_.time_limit);
  try {
    return {answered(jpeg, threshold), {}};
  } catch (const Failure& failure) {
    fd_.reset();
    return {std::nullopt, failure.what()};
  } catch (const wire::DecodeError& error) {
    fd_.reset();
    return {std::nullopt, std::string("nonsense was answered: ") + error.what()};
  }
}

FrameMasks SegmenterClient::answered(std::span<const std::uint8_t> jpeg, double threshold) {
  const auto sensor = sensor_();
  if (!sensor) throw Failure("the camera is unknown");
  if (!fd_) call();
  wire::ByteWriter question;
  question.u32(static_cast<std::uint32_t>(sizeof(float) + jpeg.size()));
  question.f32(static_cast<float>(threshold));
  send(question.take());
  send(jpeg);
  const auto head = receive(sizeof(std::uint32_t));
  const std::uint32_t size = wire::ByteReader(head).u32();
  if (size == 0) throw Failure("the segmenter refused the picture");
  if (size > kLargestAnswer)
    throw Failure("nonsense was answered: " + std::to_string(size) + " bytes are to follow");
  const auto bytes = receive(size);
  const auto block = FrameFile::parse(bytes);
  if (!block) throw Failure("nonsense was answered: it does not fit its checksum");
  return wire::decode_segmentation(block->count, block->bytes, sensor->camera.width,
                                   sensor->camera.height);
}

void SegmenterClient::call() {
  fd_ = FileDescriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!fd_) fail_with_errno("no socket");
  if (!connect_to(fd_.get(), options_.socket)) fail_with_errno("no segmenter answers");
}

void SegmenterClient::send(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(sent));
    } else if (errno == EAGAIN) {
      wait_for(POLLOUT);
    } else if (errno != EINTR) {
      fail_with_errno("the segmenter was lost");
    }
  }
}

std::vector<std::uint8_t> SegmenterClient::receive(std::size_t size) {
  std::vector<std::uint8_t> bytes(size);
  std::size_t have = 0;
  while (have < size) {
    const ssize_t came = ::recv(fd_.get(), bytes.data() + have, size - have, 0);
    if (came > 0) {
      have += static_cast<std::size_t>(came);
    } else if (came == 0) {
      throw Failure("the segmenter was lost: it hung up");
    } else if (errno == EAGAIN) {
      wait_for(POLLIN);
    } else if (errno != EINTR) {
      fail_with_errno("the segmenter was lost");
    }
  }
  return bytes;
}

void SegmenterClient::wait_for(short what) const {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline_ - Clock::now());
  pollfd polled{.fd = fd_.get(), .events = what, .revents = 0};
  if (left.count() <= 0 || ::poll(&polled, 1, static_cast<int>(left.count())) == 0)
    throw Failure("the segmenter took longer than " +
                  std::to_string(std::chrono::milliseconds(
                                     std::chrono::duration_cast<std::chrono::milliseconds>(
                                         options_.time_limit))
                                     .count()) +
                  " ms");
}

}  // namespace slambed
