// SPDX-License-Identifier: Apache-2.0
// Little-endian: magic u32, format version u16, delta version u16, payload bytes u64, crc32 u32 of
// the payload; payload: sensor, sequence (text), time origin f64, the map as a delta.
#include "store/map_file.hpp"

#include <zlib.h>

#include <algorithm>
#include <vector>

#include "base/error.hpp"
#include "base/files.hpp"
#include "map/map_snapshot.hpp"
#include "wire/delta_codec.hpp"
#include "wire/message_type.hpp"

namespace slambed {
namespace {

constexpr std::uint32_t kMagic = 0x504D4C53;  // "SLMP"
constexpr std::uint16_t kVersion = 1;
constexpr std::size_t kHeaderBytes = 20;
constexpr std::size_t kMaxText = 200;
/// Larger than any real map, so that a damaged size cannot exhaust memory.
constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 34;

Error damaged(const std::string& source, const std::string& what) {
  return bad_input("map " + source + ": " + what + "; make or fetch it again");
}

std::uint32_t crc_of(std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(::crc32_z(0, bytes.data(), bytes.size()));
}

template <typename IdType>
bool contains(const std::vector<IdType>& ascending, IdType id) {
  return std::binary_search(ascending.begin(), ascending.end(), id);
}

template <typename Items>
auto ids_of(const Items& items) {
  std::vector<decltype(items.front().id)> ids;
  for (const auto& item : items) ids.push_back(item.id);
  std::sort(ids.begin(), ids.end());
  return ids;
}

/// Throws unless every element appears once and all references stay inside the map.
void check(const MapDelta& map, const std::string& source) {
  const auto keyframes = ids_of(map.keyframes);
  const auto points = ids_of(map.points);
  if (std::adjacent_find(keyframes.begin(), keyframes.end()) != keyframes.end() ||
      std::adjacent_find(points.begin(), points.end()) != points.end())
    throw damaged(source, "an element is there twice");
  for (const NewKeyFrame& keyframe : map.keyframes) {
    if (keyframe.parent && !contains(keyframes, keyframe.parent))
      throw damaged(source, "the parent of a keyframe is missing");
    for (const MapPointId id : keyframe.points)
      if (id && !contains(points, id)) throw damaged(source, "a point is missing");
  }
  MapDelta rest = map;
  rest.keyframes.clear();
  rest.points.clear();
  if (!rest.empty()) throw damaged(source, "holds edits instead of a whole map");
}

}  // namespace

wire::Bytes encode_map(const Map& map, const MapInfo& info) {
  wire::ByteWriter payload;
  wire::put_sensor(payload, info.sensor);
  payload.text(info.sequence);
  payload.f64(info.time_origin_s);
  wire::put_delta(payload, map.read([](const MapView& view) { return snapshot(view); }));
  const wire::Bytes body = payload.take();

  wire::ByteWriter file;
  file.u32(kMagic);
  file.u16(kVersion);
  file.u16(wire::kDeltaVersion);
  file.u64(body.size());
  file.u32(crc_of(body));
  wire::Bytes bytes = file.take();
  bytes.insert(bytes.end(), body.begin(), body.end());
  return bytes;
}

StoredMap decode_map(std::span<const std::uint8_t> bytes, const std::string& source) {
  try {
    wire::ByteReader header(bytes);
    if (bytes.size() < kHeaderBytes || header.u32() != kMagic)
      throw damaged(source, "is no slambed map");
    const std::uint16_t version = header.u16(), delta_version = header.u16();
    if (version != kVersion || delta_version != wire::kDeltaVersion)
      throw damaged(source, "has version " + std::to_string(version) + "." +
                                std::to_string(delta_version) + ", this program reads " +
                                std::to_string(kVersion) + "." +
                                std::to_string(wire::kDeltaVersion));
    const std::uint64_t size = header.u64();
    const std::uint32_t crc = header.u32();
    const auto body = bytes.subspan(kHeaderBytes);
    if (size != body.size()) throw damaged(source, "is cut or too long");
    if (crc_of(body) != crc) throw damaged(source, "does not match its checksum");

    wire::ByteReader in(body);
    StoredMap stored;
    stored.info.sensor = wire::get_sensor(in);
    stored.info.sequence = in.text(kMaxText);
    stored.info.time_origin_s = in.f64();
    const MapDelta delta = wire::get_delta(in, stored.info.sensor.make_sensor());
    in.expect_end();
    check(delta, source);
    stored.map = std::make_shared<Map>();
    if (stored.map->commit(delta).unknown > 0)
      throw damaged(source, "has elements of unknown kind");
    return stored;
  } catch (const wire::DecodeError& error) {
    throw damaged(source, error.what());
  }
}

void save_map(const Map& map, const MapInfo& info, const std::filesystem::path& path) {
  const wire::Bytes bytes = encode_map(map, info);
  write_whole(path, {bytes});
}

StoredMap load_map(const std::filesystem::path& path) {
  return decode_map(read_whole(path, "map", kMaxBytes), path.string());
}

}  // namespace slambed
