// SPDX-License-Identifier: Apache-2.0
#include "synth/room.hpp"

#include <algorithm>
#include <functional>

#include "synth/figure_body.hpp"

namespace slambed::synth {
namespace {

/// Furnishes a scene. Every piece has its own random stream, so that leaving one out changes no
/// other. No argument list has two random draws, because the compiler may choose their order.
class Furnisher {
 public:
  Furnisher(const RoomOptions& options, std::span<const Vec3> path, std::span<const Figure> cast)
      : options_(options), path_(path), cast_(cast), scene_(std::make_shared<Scene>()) {}

  std::shared_ptr<const Scene> furnish() {
    add_shell();
    for (const double x : {-0.85, 0.85})
      for (const double y : {-0.42, 0.42}) add_table(x, y);
    add_wall_furniture();
    add_pictures();
    add_seats_and_crates();
    for (int i = 0; i < options_.moving_objects; ++i) add_walker(i);
    for (std::size_t i = 0; i < cast_.size(); ++i)
      add_figure(*scene_, cast_[i].actor, static_cast<int>(i) + 1, cast_[i].seed,
                 options_.texel_scale);
    Light light;
    for (const double x : {-0.5, 0.5})
      for (const double y : {-0.5, 0.5})
        light.lamps.push_back(
            {x * options_.half_x_m, y * options_.half_y_m, options_.height_m - 0.1});
    scene_->finish(light, options_.seed, options_.threads);
    return scene_;
  }

 private:
  Material material(double gray, double contrast, double texel_m = 0.003, double largest_m = 0.12,
                    double coverage = 0.9) {
    return leafy(gray, contrast, texel_m, largest_m, coverage, options_.texel_scale);
  }

  /// Material of pictures, screens and covers: strong contrast, no bare areas.
  Material printed(double gray, double texel_m = 0.002, double largest_m = 0.06) {
    return material(gray, 75, texel_m, largest_m, 1.6);
  }

  bool keeps_clear(const Vec3& low, const Vec3& high) const {
    const Extent extent{low, high};
    return std::none_of(path_.begin(), path_.end(),
                        [&](const Vec3& p) { return extent.distance_m(p) < options_.clearance_m; });
  }

  Random stream() { return Random(options_.seed, 0x10000 + pieces_++); }

  void add_shell() {
    Material floor = material(92, 42, 0.004, 0.3);
    floor.grid_m = 0.6;
    const Material wall = material(158, 34, 0.0035, 0.3, 0.75);
    Material ceiling = material(170, 34, 0.006, 0.4, 0.75);
    ceiling.grid_m = 1.2;
    scene_->add_room({options_.half_x_m, options_.half_y_m, 0}, options_.height_m, floor, wall,
                     ceiling);
  }

  /// Adds a table of 1.6 x 0.8 x 0.74 m with a screen, boxes, books and cups on it.
  void add_table(double x, double y) {
    Random random = stream();
    if (!keeps_clear({x - 0.8, y - 0.4, 0}, {x + 0.8, y + 0.4, 1.25})) return;
    const Material wood = material(random.uniform(125, 150), 38, 0.0025, 0.12);
    const double top = 0.74;
    scene_->add_box({x, y, top - 0.04}, {1.6, 0.8, 0.04}, wood);
    for (const double dx : {-0.74, 0.74})
      for (const double dy : {-0.34, 0.34})
        scene_->add_box({x + dx, y + dy, 0}, {0.06, 0.06, top - 0.04}, wood);
    const double side = y < 0 ? 1 : -1;  // screens stand back to back in the middle
    scene_->add_box({x, y + side * 0.26, top}, {0.26, 0.18, 0.02}, material(40, 24, 0.002));
    scene_->add_box({x, y + side * 0.30, top + 0.02}, {0.06, 0.04, 0.12}, material(40, 24, 0.002));
    scene_->add_box({x, y + side * 0.28, top + 0.12}, {0.56, 0.05, 0.36}, printed(110, 0.002, 0.1),
                    random.uniform(-12, 12));
    scene_->add_box({x, y - side * 0.16, top}, {0.44, 0.15, 0.025},
                    material(60, 45, 0.002, 0.02, 1.5));
    for (const double slot : {-0.62, -0.42, 0.42, 0.62}) {
      const Vec3 place{x + slot + random.uniform(-0.04, 0.04), y + random.uniform(-0.2, 0.2), top};
      add_desk_thing(place, random);
    }
  }

  void add_desk_thing(const Vec3& place, Random& random) {
    const Material print = printed(random.uniform(70, 180), 0.0015, 0.05);
    switch (random.below(4)) {
      case 0: {
        const double radius = random.uniform(0.035, 0.05);
        scene_->add_cylinder(place, radius, random.uniform(0.09, 0.14), print);
        break;
      }
      case 1: {
        double z = place.z();
        for (int i = 0; i < 4; ++i) {
          const double thick = random.uniform(0.02, 0.05);
          const double gray = random.uniform(50, 190);
          scene_->add_box({place.x(), place.y(), z}, {0.17, 0.24, thick},
                          material(gray, 55, 0.0015, 0.05), random.uniform(-20, 20));
          z += thick;
        }
        break;
      }
      case 2:
        scene_->add_cylinder(place, 0.09, 0.02, print);
        scene_->add_cylinder({place.x(), place.y(), place.z() + 0.02}, 0.012, 0.36, print, 8);
        scene_->add_box({place.x(), place.y(), place.z() + 0.36}, {0.2, 0.1, 0.06}, print,
                        random.uniform(0, 180));
        break;
      default: {
        const Vec3 size{random.uniform(0.12, 0.2), random.uniform(0.1, 0.18),
                        random.uniform(0.1, 0.28)};
        scene_->add_box(place, size, print, random.uniform(-45, 45));
      }
    }
  }

  /// Adds shelves and cabinets with their backs to the four walls.
  void add_wall_furniture() {
    const double hx = options_.half_x_m, hy = options_.half_y_m;
    for (const bool along_x : {true, false})
      for (const double sign : {-1.0, 1.0}) {
        const double length = along_x ? hx : hy, depth = along_x ? hy : hx;
        for (double at = -length + 0.9; at < length - 0.8; at += 1.25) {
          Random random = stream();
          const double out = 0.22;  // half depth of a piece
          const Vec3 center =
              along_x ? Vec3(at, sign * (depth - out), 0) : Vec3(sign * (depth - out), at, 0);
          add_wall_piece(center, along_x, random);
        }
      }
  }

  void add_wall_piece(const Vec3& c, bool along_x, Random& random) {
    // Coordinates of a box: along the wall, into the room, up.
    const auto box = [&](double along, double into, double up, const Vec3& size,
                         const Material& m) {
      const Vec3 offset = along_x ? Vec3(along, into, up) : Vec3(into, along, up);
      const Vec3 turned = along_x ? size : Vec3(size.y(), size.x(), size.z());
      scene_->add_box(c + offset, turned, m);
    };
    const int kind = random.below(5);
    const double tall = kind < 2 ? 2.0 : kind == 2 ? 1.1 : 0.8;
    const Vec3 half = along_x ? Vec3(0.55, 0.22, 0) : Vec3(0.22, 0.55, 0);
    if (kind == 4 || !keeps_clear(c - half, c + half + Vec3(0, 0, tall))) return;
    const Material wood = material(random.uniform(55, 150), 32, 0.003, 0.12);
    if (kind < 2) {
      box(-0.53, 0, 0, {0.04, 0.4, 2.0}, wood);
      box(0.53, 0, 0, {0.04, 0.4, 2.0}, wood);
      for (int board = 0; board < 6; ++board) {
        const double z = 0.04 + board * 0.385;
        box(0, 0, z, {1.02, 0.4, 0.03}, wood);
        if (board == 5) break;
        for (double along = -0.49; along < 0.42;) {
          const double thick = random.uniform(0.03, 0.13);
          const double into = random.uniform(0.16, 0.3);
          const double high = random.uniform(0.18, 0.33), gray = random.uniform(35, 200);
          if (random.uniform() < 0.85)
            box(along + thick / 2, 0, z + 0.03, {thick, into, high},
                material(gray, 45, 0.002, 0.05));
          along += thick + 0.004;
        }
      }
    } else {
      box(0, 0, 0, {1.06, 0.42, tall}, wood);
      for (const double along : {-0.3, 0.02, 0.33}) {
        const Vec3 size{random.uniform(0.15, 0.28), 0.2, random.uniform(0.12, 0.4)};
        box(along, 0, tall, size, printed(random.uniform(60, 190), 0.002, 0.07));
      }
    }
  }

  void add_pictures() {
    const double hx = options_.half_x_m, hy = options_.half_y_m;
    for (const bool along_x : {true, false})
      for (const double sign : {-1.0, 1.0}) {
        const double length = along_x ? hx : hy;
        for (double at = -length + 0.8; at < length - 0.5; at += 1.35) {
          Random random = stream();
          const double w = random.uniform(0.45, 0.95), h = random.uniform(0.35, 0.6);
          const double above = random.uniform() < 0.3 ? 0.45 : 0;
          const double z = random.uniform(1.45, 1.7) + above;
          const Vec3 c =
              along_x ? Vec3(at, sign * (hy - 0.015), z) : Vec3(sign * (hx - 0.015), at, z);
          const Vec3 size = along_x ? Vec3(w, 0.03, h) : Vec3(0.03, w, h);
          scene_->add_box(c, size, printed(random.uniform(90, 150), 0.0025, 0.2));
        }
      }
  }

  void add_seats_and_crates() {
    for (int i = 0; i < 10; ++i) {
      Random random = stream();
      const SinCos a = sincos_turns((i + random.uniform(-0.25, 0.25)) / 10.0);
      const bool seat = i % 2 == 0;
      const double reach = seat ? 1.0 : 1.25;
      const Vec3 c(reach * a.cos * (seat ? 2.0 : options_.half_x_m / 1.6),
                   reach * a.sin * (seat ? 1.25 : options_.half_y_m / 1.6), 0);
      const double yaw = random.uniform(0, 360);
      const double tall = seat ? 0.95 : random.uniform(0.25, 0.6);
      if (!keeps_clear(c - Vec3(0.3, 0.3, 0), c + Vec3(0.3, 0.3, tall))) continue;
      const Material m = material(random.uniform(45, 170), 40, 0.0025);
      if (!seat) {
        scene_->add_box(c, {0.45, 0.38, tall}, m, yaw);
        continue;
      }
      const SinCos turn = sincos_deg(yaw);
      scene_->add_cylinder(c, 0.2, 0.05, m);
      scene_->add_cylinder({c.x(), c.y(), 0.05}, 0.04, 0.37, m, 8);
      scene_->add_box({c.x(), c.y(), 0.42}, {0.44, 0.44, 0.06}, m, yaw);
      scene_->add_box({c.x() - 0.2 * turn.sin, c.y() + 0.2 * turn.cos, 0.48}, {0.42, 0.05, 0.45}, m,
                      yaw);
    }
  }

  /// Adds a figure of boxes that walks around the tables. Its faces are relative to the body's
  /// pose.
  void add_walker(int i) {
    Random random = stream();
    Body motion;
    motion.radius_x_m = 2.1 + 0.12 * (i % 3);
    motion.radius_y_m = 1.35 + 0.12 * (i % 3);
    motion.period_s = random.uniform(16, 24) * (i % 2 == 0 ? 1 : -1);
    motion.phase = (i + random.uniform()) / std::max(1, options_.moving_objects);
    scene_->begin_body(motion);
    const Material cloth = material(random.uniform(60, 150), 50, 0.0025, 0.1);
    scene_->add_box({0, -0.1, 0}, {0.16, 0.14, 0.85}, cloth);
    scene_->add_box({0, 0.1, 0}, {0.16, 0.14, 0.85}, cloth);
    scene_->add_box({0, 0, 0.85}, {0.24, 0.44, 0.58}, cloth);
    scene_->add_cylinder({0, 0, 1.47}, 0.1, 0.25, material(150, 50, 0.002, 0.05));
    scene_->end_body();
  }

  RoomOptions options_;
  std::span<const Vec3> path_;
  std::span<const Figure> cast_;
  std::shared_ptr<Scene> scene_;
  std::uint64_t pieces_ = 0;
};

}  // namespace

std::shared_ptr<const Scene> make_room(const RoomOptions& options, std::span<const Vec3> kept_clear,
                                       std::span<const Figure> cast) {
  return Furnisher(options, kept_clear, cast).furnish();
}

}  // namespace slambed::synth
