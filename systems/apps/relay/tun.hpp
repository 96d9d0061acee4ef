// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "apps/relay/config.hpp"
#include "base/fd.hpp"

namespace slambed::relay {

/// Packets that the kernel dropped between a socket and the relay, counted by the device.
struct DeviceDrops {
  std::int64_t rx = 0;
  std::int64_t tx = 0;
};

/// One end of the link: a TUN device inside a network namespace, up and with an address. The device
/// exists as long as this object.
class TunDevice {
 public:
  /// Enters the namespace only to open the device. Throws environment_error.
  TunDevice(const EndOptions& end, const RelayOptions& options);

  int fd() const { return tun_.get(); }
  const std::string& name() const { return name_; }
  DeviceDrops drops() const;

 private:
  std::string name_;
  FileDescriptor namespace_;
  FileDescriptor tun_;
};

}  // namespace slambed::relay
