// SPDX-License-Identifier: Apache-2.0
#include "apps/relay/tun.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/if_tun.h>
#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <utility>

#include "base/error.hpp"

namespace slambed::relay {
namespace {

[[noreturn]] void refuse(const std::string& what, const std::string& where,
                         const std::string& advice) {
  throw environment_error(what + ": " + std::strerror(errno) + ", " + where + ", " + advice);
}

/// Moves the calling thread into another network namespace for the lifetime of this object.
class NamespaceVisit {
 public:
  explicit NamespaceVisit(int target)
      : home_(open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC)) {
    if (home_.get() < 0 || setns(target, CLONE_NEWNET) != 0) {
      refuse("cannot enter the network namespace", "setns", "run as root or with CAP_SYS_ADMIN");
    }
  }
  ~NamespaceVisit() { [[maybe_unused]] const int result = setns(home_.get(), CLONE_NEWNET); }
  NamespaceVisit(const NamespaceVisit&) = delete;
  NamespaceVisit& operator=(const NamespaceVisit&) = delete;

 private:
  FileDescriptor home_;
};

FileDescriptor open_namespace(const EndOptions& end) {
  FileDescriptor fd(open(end.network_namespace.c_str(), O_RDONLY | O_CLOEXEC));
  if (fd.get() < 0) {
    refuse("cannot open the network namespace", end.network_namespace,
           "start the node first and run as root");
  }
  return fd;
}

ifreq request_for(const std::string& name) {
  ifreq request{};
  std::memcpy(request.ifr_name, name.c_str(), name.size());  // length checked by read_config
  return request;
}

sockaddr ipv4(std::uint32_t network_order) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = network_order;
  sockaddr generic{};
  std::memcpy(&generic, &address, sizeof(address));
  return generic;
}

void set(int socket_fd, unsigned long code, ifreq request, const char* what,
         const std::string& name) {
  if (ioctl(socket_fd, code, &request) != 0) {
    refuse(std::string("cannot set ") + what, "device " + name,
           "run as root or with CAP_NET_ADMIN");
  }
}

/// Prevents router solicitations of the kernel, which would count as packets of the link.
void disable_ipv6(const std::string& name) {
  std::ofstream("/proc/sys/net/ipv6/conf/" + name + "/disable_ipv6") << "1";
}

void configure(const EndOptions& end, const RelayOptions& options) {
  const FileDescriptor control(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (control.get() < 0) refuse("cannot open a socket", "device " + end.device, "run as root");
  disable_ipv6(end.device);
  ifreq request = request_for(end.device);
  request.ifr_mtu = options.mtu;
  set(control.get(), SIOCSIFMTU, request, "the MTU", end.device);
  request = request_for(end.device);
  request.ifr_qlen = options.tx_queue_packets;
  set(control.get(), SIOCSIFTXQLEN, request, "the queue length", end.device);
  request = request_for(end.device);
  in_addr address{};
  inet_pton(AF_INET, end.address.c_str(), &address);
  request.ifr_addr = ipv4(address.s_addr);
  set(control.get(), SIOCSIFADDR, request, "the address", end.device);
  request = request_for(end.device);
  request.ifr_netmask = ipv4(htonl(0xffffffffU << (32 - options.prefix_length)));
  set(control.get(), SIOCSIFNETMASK, request, "the network mask", end.device);
  request = request_for(end.device);
  request.ifr_flags = IFF_UP | IFF_RUNNING | IFF_POINTOPOINT | IFF_NOARP;
  set(control.get(), SIOCSIFFLAGS, request, "the device up", end.device);
}

}  // namespace

TunDevice::TunDevice(const EndOptions& end, const RelayOptions& options)
    : name_(end.device), namespace_(open_namespace(end)) {
  const NamespaceVisit visit(namespace_.get());
  // Opened after setns, because a TUN file belongs to the namespace in which it was opened.
  tun_ = FileDescriptor(open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC));
  if (tun_.get() < 0) {
    refuse("cannot open /dev/net/tun", end.network_namespace,
           "load the tun module and run as root, or use link backend netem");
  }
  ifreq request = request_for(end.device);
  request.ifr_flags = IFF_TUN | IFF_NO_PI;
  if (ioctl(tun_.get(), TUNSETIFF, &request) != 0) {
    refuse("cannot make the TUN device " + end.device, end.network_namespace,
           "remove a device of that name and run with CAP_NET_ADMIN");
  }
  configure(end, options);
}

DeviceDrops TunDevice::drops() const {
  DeviceDrops drops;
  const NamespaceVisit visit(namespace_.get());
  std::ifstream file("/proc/thread-self/net/dev");
  for (std::string line; std::getline(file, line);) {
    std::replace(line.begin(), line.end(), ':', ' ');
    std::istringstream words(line);
    std::string device;
    // Columns: rx bytes packets errs drop fifo frame compressed multicast, then the same for tx.
    std::int64_t column[16] = {};
    words >> device;
    if (device != name_) continue;
    for (auto& value : column) words >> value;
    drops = {column[3], column[11]};
  }
  return drops;
}

}  // namespace slambed::relay
