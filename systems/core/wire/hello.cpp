// SPDX-License-Identifier: Apache-2.0
#include "wire/hello.hpp"

#include "wire/message_type.hpp"

namespace slambed::wire {
namespace {

constexpr std::size_t kMaxText = 200;
/// No known camera exceeds these limits; they bound the sizes that derive from them.
constexpr std::uint32_t kMaxPixels = 1 << 14;
constexpr std::uint32_t kMaxLevels = 16;

}  // namespace

void put_sensor(ByteWriter& out, const SensorInfo& info) {
  const Camera& camera = info.camera;
  out.varint(static_cast<std::uint64_t>(camera.width));
  out.varint(static_cast<std::uint64_t>(camera.height));
  for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy, camera.bf}) out.f64(value);
  for (const double value : camera.distortion) out.f64(value);
  out.f32(info.close_depth_m);
  out.varint(static_cast<std::uint64_t>(info.levels));
  out.f32(info.scale_factor);
  out.f64(info.played_fps);
}

SensorInfo get_sensor(ByteReader& in) {
  SensorInfo info;
  Camera& camera = info.camera;
  const std::uint32_t width = in.varint32(), height = in.varint32();
  if (width == 0 || height == 0 || width > kMaxPixels || height > kMaxPixels) {
    throw DecodeError("image size is out of range");
  }
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy, &camera.bf}) {
    *value = in.f64();
  }
  for (double& value : camera.distortion) value = in.f64();
  if (camera.fx <= 0 || camera.fy <= 0 || camera.bf < 0) throw DecodeError("camera is impossible");
  info.close_depth_m = in.f32();
  const std::uint32_t levels = in.varint32();
  info.scale_factor = in.f32();
  info.played_fps = in.f64();
  if (levels == 0 || levels > kMaxLevels || !(info.scale_factor > 1 && info.scale_factor < 4)) {
    throw DecodeError("pyramid is out of range");
  }
  if (!(info.played_fps > 0)) throw DecodeError("frame rate is not positive");
  info.levels = static_cast<int>(levels);
  return info;
}

std::shared_ptr<const Sensor> SensorInfo::make_sensor() const {
  OrbOptions options;
  options.levels = levels;
  options.scale_factor = scale_factor;
  return std::make_shared<const Sensor>(Sensor{.camera = camera,
                                               .bounds = undistorted_bounds(camera),
                                               .pyramid = ScalePyramid(options),
                                               .close_depth_m = close_depth_m});
}

Bytes encode(const Hello& hello) {
  ByteWriter out;
  out.u16(hello.wire_version);
  out.u8(static_cast<std::uint8_t>(hello.role));
  out.text(hello.channel);
  out.text(hello.run_key);
  out.text(hello.system);
  out.u8(hello.sensor ? 1 : 0);
  if (hello.sensor) put_sensor(out, *hello.sensor);
  return out.take();
}

Hello decode_hello(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  Hello hello;
  hello.wire_version = in.u16();
  if (hello.wire_version != kWireVersion) {
    throw DecodeError("peer has wire version " + std::to_string(hello.wire_version) + ", not " +
                      std::to_string(kWireVersion));
  }
  const std::uint8_t role = in.u8();
  if (role != 1 && role != 2) throw DecodeError("unknown role");
  hello.role = static_cast<NodeRole>(role);
  hello.channel = in.text(kMaxText);
  hello.run_key = in.text(kMaxText);
  hello.system = in.text(kMaxText);
  if (in.flag()) hello.sensor = get_sensor(in);
  in.expect_end();
  return hello;
}

std::optional<std::string> mismatch(const Hello& ours, const Hello& theirs) {
  if (theirs.role == ours.role) return "both nodes have the same role";
  if (theirs.run_key != ours.run_key) return "peer belongs to another run";
  if (theirs.system != ours.system) return "peer runs another system";
  if (theirs.channel != ours.channel) return "peer wants another channel";
  if (theirs.role == NodeRole::kMobile && !theirs.sensor) return "mobile did not name its camera";
  return std::nullopt;
}

}  // namespace slambed::wire
