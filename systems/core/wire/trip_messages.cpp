// SPDX-License-Identifier: Apache-2.0
#include "wire/trip_messages.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "wire/id_codec.hpp"
#include "wire/unit_rotation.hpp"

namespace slambed::wire {
namespace {

constexpr std::array kParts = {&PoseAnswer::up, &PoseAnswer::wait, &PoseAnswer::match,
                               &PoseAnswer::bundle};

std::uint32_t microseconds(Duration time) {
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(time).count();
  return static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(us, 0, std::numeric_limits<std::uint32_t>::max()));
}

/// Accepts any 32 bits; defect() finds numbers that are not finite.
double read_float(ByteReader& in) { return std::bit_cast<float>(in.u32()); }

}  // namespace

Bytes encode(const PoseAnswer& message) {
  ByteWriter out;
  IdStream().put(out, message.keyframe);
  out.u16(message.matches);
  const SE3 T_wc = message.T_cw.inverse();
  const Eigen::Quaterniond q = T_wc.quaternion();
  for (const double value : {T_wc.t.x(), T_wc.t.y(), T_wc.t.z(), q.w(), q.x(), q.y(), q.z()})
    out.u32(std::bit_cast<std::uint32_t>(static_cast<float>(value)));
  out.time(message.sent);
  for (const auto part : kParts) out.u32(microseconds(message.*part));
  return out.take();
}

PoseAnswer decode_pose_answer(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  PoseAnswer message;
  message.keyframe = IdStream().get<KeyFrameId>(in);
  message.matches = in.u16();
  std::array<double, 7> v{};
  for (double& value : v) value = read_float(in);
  message.sent = in.time();
  for (const auto part : kParts) message.*part = std::chrono::microseconds(in.u32());
  in.expect_end();
  // Other quaternions are kept as received, so that defect() finds them.
  const Eigen::Quaterniond q(v[3], v[4], v[5], v[6]);
  const Eigen::Matrix3d R = (is_unit(q) ? q.normalized() : q).toRotationMatrix();
  message.T_cw = SE3(R, {v[0], v[1], v[2]}).inverse();
  return message;
}

std::optional<std::string_view> defect(const PoseAnswer& message) {
  if (!message.T_cw.R.allFinite() || !message.T_cw.t.allFinite()) return "not_finite";
  const Eigen::Matrix3d error =
      message.T_cw.R * message.T_cw.R.transpose() - Eigen::Matrix3d::Identity();
  if (error.norm() > kUnitTolerance || message.T_cw.R.determinant() < 0) return "not_a_rotation";
  return std::nullopt;
}

Bytes fill_up(Bytes own, std::size_t size) {
  ByteWriter out;
  const std::size_t needed = own.size() + 2 * sizeof(std::uint32_t);
  const std::size_t filler = std::max(size, needed) - needed;
  out.u32(static_cast<std::uint32_t>(own.size()));
  out.u32(static_cast<std::uint32_t>(filler));
  Bytes filled = out.take();
  filled.reserve(needed + filler);
  filled.insert(filled.end(), own.begin(), own.end());
  filled.resize(needed + filler);
  return filled;
}

std::span<const std::uint8_t> without_filler(std::span<const std::uint8_t> bytes) {
  ByteReader in(bytes);
  const std::uint32_t size = in.u32(), filler = in.u32();
  const auto own = in.take(size);
  in.take(filler);
  in.expect_end();
  return own;
}

}  // namespace slambed::wire
