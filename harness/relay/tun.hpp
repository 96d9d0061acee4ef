// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "config.hpp"

namespace slambed::relay {

/// A file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int fd = -1) : fd_(fd) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept : fd_(other.fd_) { other.fd_ = -1; }
  Descriptor& operator=(Descriptor&& other) noexcept;
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

/// What the kernel threw away between a socket and us, counted by the device.
struct DeviceDrops {
  std::int64_t rx = 0;
  std::int64_t tx = 0;
};

/// One end of the link: a TUN device inside a network namespace, up and addressed. The device lives
/// as long as this object.
class TunDevice {
 public:
  /// Enters the namespace only while it opens the device. Throws environment_error.
  TunDevice(const EndOptions& end, const RelayOptions& options);

  int fd() const { return tun_.get(); }
  const std::string& name() const { return name_; }
  DeviceDrops drops() const;

 private:
  std::string name_;
  Descriptor namespace_;
  Descriptor tun_;
};

}  // namespace slambed::relay
