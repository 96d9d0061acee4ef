// SPDX-License-Identifier: Apache-2.0
#include "base/fd.hpp"

#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace slambed {

void FileDescriptor::reset() {
  if (fd_ < 0) return;
  const int saved = errno;  // close() must not hide the errno of an earlier failure
  ::close(fd_);
  errno = saved;
  fd_ = -1;
}

std::string error_text(int error_number) { return std::system_category().message(error_number); }

}  // namespace slambed
