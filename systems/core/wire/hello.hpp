// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include "base/ids.hpp"
#include "features/feature_set.hpp"
#include "wire/byte_io.hpp"

namespace slambed::wire {

/// The mobile's camera as the edge must know it. Both nodes build the same Sensor from it.
struct SensorInfo {
  Camera camera;
  float close_depth_m = 0;
  int levels = 8;
  float scale_factor = 1.2f;
  double played_fps = 30;

  std::shared_ptr<const Sensor> make_sensor() const;
};
void put_sensor(ByteWriter& out, const SensorInfo& info);
/// Throws DecodeError.
SensorInfo get_sensor(ByteReader& in);

/// The greeting on every connection. It shows whether both nodes belong to the same run.
struct Hello {
  std::uint16_t wire_version = 0;
  NodeRole role = NodeRole::kMobile;
  std::string channel, run_key, system;
  std::optional<SensorInfo> sensor;  ///< sent by the mobile
};

Bytes encode(const Hello& hello);
/// Throws DecodeError.
Hello decode_hello(std::span<const std::uint8_t> bytes);
/// Returns the reason why `theirs` is not the expected peer of `ours`, or nothing if it is.
std::optional<std::string> mismatch(const Hello& ours, const Hello& theirs);

}  // namespace slambed::wire
