// SPDX-License-Identifier: Apache-2.0
#include "synth/hall.hpp"

#include <algorithm>
#include <array>

#include "synth/random.hpp"

namespace slambed::synth {
namespace {

constexpr double kHalfX_m = 8, kHalfY_m = 6, kHallHeight_m = 5;

struct Island {
  double x, y, half_x, half_y;
};
/// Islands surround a free middle, and the south is empty.
constexpr std::array kIslands = {
    Island{-4.2, 3.6, 1.9, 1.1}, Island{0.2, 4.3, 1.4, 0.9},   Island{4.4, 3.4, 1.8, 1.2},
    Island{6.2, -0.8, 1.0, 1.9}, Island{-6.2, -1.2, 1.0, 1.9},
};
/// Objects tried on each square meter of an island; they may overlap.
constexpr double kPiecesPerSquareMeter = 3.4;

class HallBuilder {
 public:
  HallBuilder(const HallOptions& options, std::span<const Vec3> path)
      : options_(options), path_(path), scene_(std::make_shared<Scene>()) {}

  std::shared_ptr<const Scene> build() {
    add_shell();
    for (const Island& island : kIslands) add_island(island);
    Light light;
    for (const double x : {-0.5, 0.5})
      for (const double y : {-0.5, 0.5})
        light.lamps.push_back({x * kHalfX_m, y * kHalfY_m, kHallHeight_m - 0.1});
    scene_->finish(light, options_.seed, options_.threads);
    return scene_;
  }

 private:
  Material material(double gray, double contrast, double texel_m, double largest_m,
                    double coverage) const {
    return leafy(gray, contrast, texel_m, largest_m, coverage, options_.texel_scale);
  }

  /// Paint and concrete: their contrast is below the threshold of a corner detector.
  void add_shell() {
    scene_->begin_group();
    scene_->add_room({kHalfX_m, kHalfY_m, 0}, kHallHeight_m, material(96, 2.5, 0.008, 0.5, 0.9),
                     material(150, 2.5, 0.008, 0.5, 0.9), material(172, 2.5, 0.012, 0.5, 0.9));
    scene_->end_body();
  }

  void add_island(const Island& island) {
    scene_->begin_group();
    const double area = 4 * island.half_x * island.half_y;
    const int pieces = static_cast<int>(kPiecesPerSquareMeter * area + 0.5);
    for (int i = 0; i < pieces; ++i) add_piece(island);
    scene_->end_body();
  }

  /// Adds a tall shelf or a stack of one to four crates. Each object has its own random stream.
  void add_piece(const Island& island) {
    Random random(options_.seed, 0x30000 + pieces_++);
    // y first: as arguments, compilers would evaluate the draws in different orders.
    const double y = island.y + random.uniform(-1, 1) * (island.half_y - 0.25);
    const double x = island.x + random.uniform(-1, 1) * (island.half_x - 0.25);
    const Vec3 place(x, y, 0);
    const double yaw = random.uniform(-25, 25);
    const int kind = random.below(4);
    const Vec3 size{random.uniform(0.35, 0.8), random.uniform(0.35, 0.8),
                    kind == 0 ? random.uniform(1.3, 2.1) : random.uniform(0.35, 0.7)};
    const Vec3 half(0.6, 0.6, 0);
    const Extent extent{place - half, place + half + Vec3(0, 0, 2.2)};
    if (std::any_of(path_.begin(), path_.end(),
                    [&](const Vec3& p) { return extent.distance_m(p) < options_.clearance_m; }))
      return;
    double z = 0;
    const int high = kind == 0 ? 1 : 1 + random.below(4);
    for (int i = 0; i < high; ++i) {
      const double gray = random.uniform(60, 185), turned = random.uniform(-12, 12);
      const double shrink = random.uniform(0.8, 1.0);
      scene_->add_box({place.x(), place.y(), z}, {shrink * size.x(), shrink * size.y(), size.z()},
                      material(gray, 62, 0.003, 0.14, 1.3), yaw + turned);
      z += size.z();
    }
  }

  HallOptions options_;
  std::span<const Vec3> path_;
  std::shared_ptr<Scene> scene_;
  std::uint64_t pieces_ = 0;
};

}  // namespace

std::shared_ptr<const Scene> make_hall(const HallOptions& options,
                                       std::span<const Vec3> kept_clear) {
  return HallBuilder(options, kept_clear).build();
}

}  // namespace slambed::synth
