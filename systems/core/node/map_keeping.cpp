// SPDX-License-Identifier: Apache-2.0
#include "node/map_keeping.hpp"

#include "base/error.hpp"
#include "map/map_snapshot.hpp"
#include "store/map_file.hpp"

namespace slambed {
namespace {

bool same_rig(const wire::SensorInfo& a, const wire::SensorInfo& b) {
  const Camera &x = a.camera, &y = b.camera;
  return x.width == y.width && x.height == y.height && x.fx == y.fx && x.fy == y.fy &&
         x.cx == y.cx && x.cy == y.cy && x.bf == y.bf && x.distortion == y.distortion &&
         a.levels == b.levels && a.scale_factor == b.scale_factor;
}

std::string describe(const wire::SensorInfo& sensor) {
  const Camera& camera = sensor.camera;
  return std::to_string(camera.width) + "x" + std::to_string(camera.height) + ", fx " +
         std::to_string(camera.fx) + ", bf " + std::to_string(camera.bf) + ", " +
         std::to_string(sensor.levels) + " levels";
}

}  // namespace

void require_same_rig(const wire::SensorInfo& stored, const wire::SensorInfo& played,
                      const std::filesystem::path& map) {
  if (same_rig(stored, played)) return;
  throw bad_input("map " + map.string() + ": was made with another camera (" + describe(stored) +
                  ") than this sequence's (" + describe(played) +
                  "); take a map of the same camera");
}

MapKeeping::MapKeeping(const System& system, const Parameters& parameters,
                       const PreparedSequence& sequence, const Playlist& playlist,
                       const wire::SensorInfo& sensor)
    : sensor_(sensor), sequence_(sequence.id()) {
  if (system.prior_map) prior_ = system.prior_map(parameters);
  if (system.save_map) save_ = system.save_map(parameters);
  const std::uint64_t first = playlist.frames().front().index;
  time_zero_s_ =
      1e-9 * static_cast<double>(sequence.time_origin_ns() + sequence.timestamps_ns()[first]);
}

std::shared_ptr<Map> MapKeeping::prior() const {
  if (prior_.empty()) return nullptr;
  const StoredMap stored = load_map(prior_);
  const std::string what = "map " + prior_.string() + ": ";
  require_same_rig(stored.info.sensor, sensor_, prior_);
  MapDelta whole = stored.map->read([](const MapView& view) { return snapshot(view); });
  if (whole.keyframes.empty()) {
    throw bad_input(what + "has no keyframes to start from; leave prior_map empty");
  }
  for (NewKeyFrame& keyframe : whole.keyframes)
    keyframe.timestamp_s += stored.info.time_origin_s - time_zero_s_;
  auto map = std::make_shared<Map>();
  map->commit(whole);
  return map;
}

void MapKeeping::save(const Map& map, const std::filesystem::path& folder) const {
  const bool any = map.read([](const MapView& view) { return view.keyframe_count() > 0; });
  if (!save_ || !any) return;
  save_map(map, {.sensor = sensor_, .sequence = sequence_, .time_origin_s = time_zero_s_},
           folder / "map.slm");
}

}  // namespace slambed
