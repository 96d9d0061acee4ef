// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <span>

#include "wire/byte_io.hpp"

namespace slambed::wire {

struct Target {
  const char* name;
  Bytes valid;
  std::function<void(std::span<const std::uint8_t>)> decode;
};

}  // namespace slambed::wire
