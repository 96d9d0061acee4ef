// SPDX-License-Identifier: Apache-2.0
// A map file with a valid checksum and any content must give a usable map or be refused.
#include <zlib.h>

#include "base/error.hpp"
#include "base/tests/fuzz_edits.hpp"
#include "map/map_snapshot.hpp"
#include "map/tests/map_fixture.hpp"
#include "store/map_file.hpp"

namespace slambed::testing {
namespace {

constexpr std::size_t kHeaderBytes = 20, kSizeAt = 8, kChecksumAt = 16;

wire::Bytes valid_file() {
  Map map;
  MapDelta delta;
  for (std::uint64_t n = 1; n <= 30; ++n) delta.points.push_back(new_point(n));
  delta.keyframes.push_back(new_keyframe(1, points_from(1, 20)));
  delta.keyframes.push_back(new_keyframe(2, points_from(5, 25)));
  map.commit(delta);
  MapInfo info;
  info.sensor.camera = make_sensor()->camera;
  info.sensor.close_depth_m = 3;
  info.sequence = "fuzz";
  return encode_map(map, info);
}

void make_header_true(wire::Bytes& file) {
  const std::span body(file.data() + kHeaderBytes, file.size() - kHeaderBytes);
  const std::uint64_t size = body.size();
  const auto crc = static_cast<std::uint32_t>(::crc32_z(0, body.data(), body.size()));
  for (int i = 0; i < 8; ++i) file[kSizeAt + i] = static_cast<std::uint8_t>(size >> (8 * i));
  for (int i = 0; i < 4; ++i) file[kChecksumAt + i] = static_cast<std::uint8_t>(crc >> (8 * i));
}

}  // namespace
}  // namespace slambed::testing

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slambed;
  static const wire::Bytes valid = testing::valid_file();
  if (size == 0) return 0;
  const std::span input(data + 1, size - 1);
  wire::Bytes file;
  if (data[0] % 2 == 0) {
    file = testing::edited(valid, testing::kHeaderBytes, input);
  } else {
    file.assign(valid.begin(), valid.begin() + testing::kHeaderBytes);
    file.insert(file.end(), input.begin(), input.end());
  }
  testing::make_header_true(file);
  try {
    const StoredMap stored = decode_map(file, "fuzz");
    const MapDelta whole = stored.map->read([](const MapView& view) { return snapshot(view); });
    Map again;
    again.commit(whole);
  } catch (const Error&) {
  }
  return 0;
}
