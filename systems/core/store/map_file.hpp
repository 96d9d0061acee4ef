// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "map/map.hpp"
#include "wire/hello.hpp"

namespace slambed {

/// Metadata of a map file.
struct MapInfo {
  wire::SensorInfo sensor;
  std::string sequence;      ///< id of the prepared sequence
  double time_origin_s = 0;  ///< recorded time of sequence time 0
};

struct StoredMap {
  MapInfo info;
  std::shared_ptr<Map> map;
};

/// Map files (docs/reference/sequence.md): header, checksum, and the whole map as one delta in its
/// wire form.
wire::Bytes encode_map(const Map& map, const MapInfo& info);
/// Throws Error(kBadInput), which names source, for anything but a whole, consistent map.
StoredMap decode_map(std::span<const std::uint8_t> bytes, const std::string& source);

/// Writes the file atomically, by rename.
void save_map(const Map& map, const MapInfo& info, const std::filesystem::path& path);
StoredMap load_map(const std::filesystem::path& path);

}  // namespace slambed
