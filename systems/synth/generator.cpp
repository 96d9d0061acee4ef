// SPDX-License-Identifier: Apache-2.0
#include "synth/generator.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/error.hpp"
#include "synth/hall.hpp"
#include "synth/robot_path.hpp"
#include "synth/sequence_writer.hpp"
#include "synth/sha256.hpp"
#include "synth/street.hpp"

namespace slambed::synth {
namespace {

/// Timestamp of frame 0 of a named path. Recorded paths keep their own.
constexpr double kTimeOrigin_s = 1000;
/// Least distance between the camera path and the walls.
constexpr double kWallMargin_m = 1.5;
/// Larger rooms would need more texture memory than a development machine has.
constexpr double kLargestHalf_m = 15;

/// The car's camera as in CloudSLAM: focal length at a width of 1280 pixels, and baseline.
constexpr double kRoadFocal_px = 700, kRoadBaseline_m = 0.12;
/// Depth up to which points count as close, in baselines. On the road 9.6 m.
constexpr double kRoadCloseDepth = 80, kRoomCloseDepth = 40;
/// On the road, distance for which motion blur is sampled, and most samples per pixel.
constexpr double kRoadNearest_m = 6;
constexpr int kRoadMostSamples = 3;

struct ChosenPath {
  std::shared_ptr<const CameraPath> path;
  double origin_s = kTimeOrigin_s;
  std::shared_ptr<const Drive> drive{};  ///< the same path if it is a drive
};

ChosenPath choose_path(const GeneratorOptions& options) {
  if (is_route(options.trajectory)) {
    auto drive = std::make_shared<const Drive>(options.trajectory, options.seed);
    return {drive, kTimeOrigin_s, drive};
  }
  if (is_robot_path(options.trajectory)) return {make_robot_path(options.trajectory, options.seed)};
  const auto names = path_names();
  if (std::find(names.begin(), names.end(), options.trajectory) != names.end() ||
      options.trajectory.find_first_of("./") == std::string::npos)
    return {make_path(options.trajectory, options.seconds, options.seed)};
  RecordedPath recorded = read_path(options.trajectory);
  return {std::move(recorded.path), recorded.start_s};
}

RoomOptions room_for(const GeneratorOptions& options, const std::vector<Vec3>& path, int threads) {
  RoomOptions room;
  room.seed = options.seed;
  room.moving_objects = options.moving_objects;
  room.texel_scale = options.texel_scale;
  room.threads = threads;
  for (const Vec3& p : path) {
    room.half_x_m = std::max(room.half_x_m, std::abs(p.x()) + kWallMargin_m);
    room.half_y_m = std::max(room.half_y_m, std::abs(p.y()) + kWallMargin_m);
    room.height_m = std::max(room.height_m, p.z() + 0.6);
    if (p.z() < 0.1)
      throw bad_input(options.trajectory +
                      ": the path leaves the room through the floor; its heights "
                      "must lie within 1.3 m of their mean (is z up?)");
  }
  if (std::max(room.half_x_m, room.half_y_m) > kLargestHalf_m)
    throw bad_input(options.trajectory +
                    ": the path is too long for a room (limit 27 m across); "
                    "cut it into pieces");
  return room;
}

std::shared_ptr<const Scene> make_scene(const GeneratorOptions& options, const ChosenPath& chosen,
                                        std::span<const Figure> cast, double seconds, int threads) {
  if (chosen.drive)
    return make_street({.seed = options.seed,
                        .passing_cars = options.moving_objects,
                        .open_stretches = options.open_stretches,
                        .texel_scale = options.texel_scale,
                        .threads = threads},
                       chosen.drive);
  std::vector<Vec3> places;
  for (double t = 0; t <= seconds; t += 0.1) places.push_back(chosen.path->at(t).t);
  if (is_robot_path(options.trajectory))
    return make_hall({.seed = options.seed, .texel_scale = options.texel_scale, .threads = threads},
                     places);
  const RoomOptions room = room_for(options, places, threads);
  for (const Vec3& foot : footprints(cast, seconds)) places.push_back(foot);
  return make_room(room, places, cast);
}

void check_people(const GeneratorOptions& options, const ChosenPath& chosen) {
  if (options.people == 0 && !options.labels) return;
  if (chosen.drive) throw bad_input("people and labels are for rooms; a street has none");
  if (is_robot_path(options.trajectory))
    throw bad_input("people and labels are for rooms; the hall of the robot has none");
  const CameraFlaws& flaws = options.sensor_model.flaws;
  if (options.labels && (flaws.distortion != 0 || flaws.readout_s != 0 || flaws.focal_error != 0))
    throw bad_input(
        "labels know neither distortion, focal error nor a rolling shutter; leave them out");
}

nlohmann::json describe(const GeneratorOptions& o) {
  const SensorOptions& s = o.sensor_model;
  const auto slash = o.trajectory.find_last_of('/');
  nlohmann::json described = {
      {"generator", "slambed-synth"},
      {"generator_version", kGeneratorVersion},
      {"trajectory", slash == std::string::npos ? o.trajectory : o.trajectory.substr(slash + 1)},
      {"seed", o.seed},
      {"moving_objects", o.moving_objects},
      {"texel_scale", o.texel_scale},
      {"motion_blur_s", s.motion_blur_s},
      {"noise", s.noise},
      {"depth_noise", s.depth_noise},
      {"depth_holes", s.depth_holes},
      {"blackout_start_s", s.blackout_start_s},
      {"blackout_end_s", s.blackout_end_s}};
  if (s.max_depth_m != SensorOptions().max_depth_m) described["max_depth_m"] = s.max_depth_m;
  if (o.people > 0) described.update({{"people", o.people}, {"activity", o.activity}});
  if (!is_route(o.trajectory)) return described;
  const CameraFlaws& f = s.flaws;
  described.update({{"open_stretches", o.open_stretches},
                    {"focal_error", f.focal_error},
                    {"distortion", f.distortion},
                    {"right_yaw_deg", f.right_yaw_deg},
                    {"right_pitch_deg", f.right_pitch_deg},
                    {"right_roll_deg", f.right_roll_deg},
                    {"readout_s", f.readout_s},
                    {"exposure_wander", f.exposure_wander}});
  return described;
}

}  // namespace

Camera generator_camera(const GeneratorOptions& o) {
  Camera camera;
  camera.width = o.width;
  camera.height = o.height;
  camera.fx = camera.fy = 525.0 * o.width / 640;
  camera.cx = (o.width - 1) / 2.0;
  camera.cy = (o.height - 1) / 2.0;
  if (o.sensor == "rgbd") camera.bf = 40.0 * o.width / 640;
  if (o.sensor == "stereo") camera.bf = camera.fx * 0.11;
  if (is_route(o.trajectory)) {
    camera.fx = camera.fy = kRoadFocal_px * o.width / 1280;
    camera.bf = o.sensor == "stereo" ? camera.fx * kRoadBaseline_m : 0;
  }
  return camera;
}

bool generate(const GeneratorOptions& options, const std::filesystem::path& folder, int threads,
              const Progress& progress, const std::string& extra_source) {
  const bool stereo = options.sensor == "stereo", rgbd = options.sensor == "rgbd";
  if (!stereo && !rgbd && options.sensor != "mono")
    throw bad_input("sensor '" + options.sensor + "' is not known; choose rgbd, stereo or mono");
  if (!(options.fps > 0) || options.width < 32 || options.height < 32)
    throw bad_input("fps must be positive and the image at least 32x32");
  const ChosenPath chosen = choose_path(options);
  const double path_s = chosen.path->duration_s();
  const double seconds = options.seconds > 0 ? std::min(options.seconds, path_s) : path_s;
  const int frames = std::max(1, static_cast<int>(std::floor(seconds * options.fps + 0.5)));

  if (chosen.drive && rgbd) throw bad_input("a street has no depth; choose stereo or mono");
  check_people(options, chosen);
  const std::vector<Figure> cast =
      make_cast({options.people, options.activity, options.seed, seconds}, *chosen.path);
  const auto scene = make_scene(options, chosen, cast, seconds, threads);
  const Camera camera = generator_camera(options);
  SensorOptions sensor = options.sensor_model;
  sensor.seed = options.seed;
  sensor.baseline_m = camera.baseline_m();
  if (chosen.drive) {
    sensor.laps.second_lap_s = chosen.drive->second_lap_s();
    sensor.nearest_m = kRoadNearest_m;
    sensor.most_samples = kRoadMostSamples;
  }

  SequenceHeader header{options.id,
                        options.title,
                        options.sensor,
                        camera,
                        options.fps,
                        rgbd ? sensor.depth_unit_m : 0,
                        chosen.drive ? kRoadCloseDepth : kRoomCloseDepth,
                        chosen.origin_s};
  SequenceWriter writer(folder, header);
  std::vector<SensorModel> sensors;
  for (int i = 0; i < threads; ++i)
    sensors.emplace_back(scene, true_camera(camera, sensor.flaws), sensor);
  const auto time_ns = [&](int i) {
    return static_cast<std::int64_t>(std::floor(i * 1e9 / options.fps + 0.5));
  };
  std::vector<FrameBlock> blocks(threads);
  std::vector<std::string> labels(options.labels ? frames : 0);
  for (int first = 0; first < frames; first += threads) {
    const int count = std::min(threads, frames - first);
    const auto take = [&](int k) {
      const double t = static_cast<double>(time_ns(first + k)) * 1e-9;
      FrameBlock& block = blocks[k];
      block.bytes.clear();
      const Shot shot = stereo ? sensors[k].capture_stereo(*chosen.path, first + k, t)
                        : rgbd ? sensors[k].capture_rgbd(*chosen.path, first + k, t)
                               : sensors[k].capture_mono(*chosen.path, first + k, t);
      block.append(shot.gray.data(), shot.gray.size());
      block.append(shot.right.data(), shot.right.size());
      block.append(shot.depth.data(), shot.depth.size() * 2);
      block.seal();
      if (options.labels)
        labels[first + k] = label_block(sensors[k].label(*chosen.path, cast, t), camera);
    };
    {
      std::vector<std::jthread> pool;
      for (int k = 1; k < count; ++k) pool.emplace_back(take, k);
      take(0);
    }
    for (int k = 0; k < count; ++k) {
      const std::int64_t ns = time_ns(first + k);
      writer.add(ns, blocks[k], chosen.path->at(static_cast<double>(ns) * 1e-9));
      if (!progress(first + k + 1, frames)) return false;
    }
  }
  nlohmann::json source = nlohmann::json::parse(extra_source, nullptr, false);
  if (!source.is_object()) throw bad_input("--source must be a JSON object");
  source.update(describe(options));
  if (options.labels) {
    const std::string file = label_file(labels);
    writer.add_file("labels.bin", file);
    source["labels_sha256"] = sha256_hex(file);
  }
  writer.finish(source);
  return true;
}

}  // namespace slambed::synth
