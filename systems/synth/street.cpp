// SPDX-License-Identifier: Apache-2.0
#include "synth/street.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "synth/roadside.hpp"

namespace slambed::synth {
namespace {

// Lateral positions, in meters to the left of the driven lane's middle; traffic keeps right.
constexpr double kCenterLine_m = 1.75, kOncoming_m = 3.5;
constexpr double kRightCurb_m = -3.85, kLeftCurb_m = 7.35, kCurbHeight_m = 0.12;
constexpr double kRightHouses_m = -6.35, kLeftHouses_m = 9.85;
constexpr double kRightParking_m = -2.85, kLeftParking_m = 6.3;
constexpr double kPiece_m = 3;                 ///< length of a piece of road
constexpr double kHouseClearance_m = 5.8;      ///< of any house from the middle of the driven lane
constexpr double kNoParking_per_m = 1.0 / 16;  ///< largest curvature with parked cars
constexpr double kOpenStretch_m = 30;
constexpr float kSky = 215;

/// Drives along the other lane in the opposite direction.
class OncomingCar final : public Motion {
 public:
  OncomingCar(std::shared_ptr<const Drive> drive, double start_m, double speed_m_s)
      : drive_(std::move(drive)), start_m_(start_m), speed_m_s_(speed_m_s) {}
  SE3 at(double time_s) const override {
    const double s = start_m_ - speed_m_s_ * time_s;
    const SinCos a = sincos_turns(drive_->route().heading_turns(s) + 0.5);
    Eigen::Matrix3d R;
    R << a.cos, -a.sin, 0, a.sin, a.cos, 0, 0, 0, 1;
    return {R, drive_->route().at(s, kOncoming_m)};
  }

 private:
  std::shared_ptr<const Drive> drive_;
  double start_m_, speed_m_s_;
};

/// Builds the street with one random stream per piece; no argument list has two random draws.
class StreetBuilder {
 public:
  StreetBuilder(const StreetOptions& options, std::shared_ptr<const Drive> drive)
      : options_(options),
        drive_(std::move(drive)),
        route_(drive_->route()),
        scene_(std::make_shared<Scene>()),
        things_(*scene_, options.texel_scale) {}

  std::shared_ptr<const Scene> build() {
    choose_open_stretches();
    add_ground();
    for (double s = 0; s < route_.length_m(); s += kPiece_m) add_piece(s);
    for (const bool right : {true, false}) {
      add_houses(right);
      add_backdrop(right);
      add_parked_cars(right);
      add_trees_and_poles(right);
    }
    for (int i = 0; i < options_.passing_cars; ++i) add_passing_car(i);
    Light light;
    light.ambient = 0.62;
    light.to_sun = Vec3(0.36, 0.48, 0.8);
    light.sun_strength = 0.5;
    scene_->set_background(kSky);
    scene_->finish(light, options_.seed, options_.threads);
    return scene_;
  }

 private:
  Random stream() { return Random(options_.seed, 0x30000 + pieces_++); }

  void choose_open_stretches() {
    const double every_m = route_.length_m() / std::max(1, options_.open_stretches);
    for (int i = 0; i < options_.open_stretches; ++i) {
      Random random = stream();
      open_.push_back((i + random.uniform(0.2, 0.8)) * every_m);
    }
  }

  bool is_open(double s) const {
    return std::any_of(open_.begin(), open_.end(),
                       [&](double begin) { return s >= begin && s < begin + kOpenStretch_m; });
  }

  Vec3 place(double s, double left, double z = 0) const {
    Vec3 p = route_.at(s, left);
    p.z() = z;
    return p;
  }

  /// Adds a coarse ground plane below everything else.
  void add_ground() {
    Vec3 low = Vec3::Constant(1e9), high = Vec3::Constant(-1e9);
    for (double s = 0; s < route_.length_m(); s += 5) {
      low = low.cwiseMin(route_.at(s));
      high = high.cwiseMax(route_.at(s));
    }
    low -= Vec3(70, 70, 0);
    high += Vec3(70, 70, 0);
    const double z = -0.06;
    const Vec3 corners[] = {{low.x(), low.y(), z},
                            {high.x(), low.y(), z},
                            {high.x(), high.y(), z},
                            {low.x(), high.y(), z}};
    scene_->begin_group();
    scene_->add_polygon(corners, things_.ground());
    scene_->end_body();
  }

  void add_piece(double s) {
    const double end = std::min(s + kPiece_m, route_.length_m());
    const auto strip = [&](double right, double left, double z, const Material& material) {
      const Vec3 corners[] = {place(s, right, z), place(end, right, z), place(end, left, z),
                              place(s, left, z)};
      scene_->add_polygon(corners, material);
    };
    const auto wall = [&](double from, double to, double left, const Material& material) {
      const Vec3 corners[] = {place(from, left), place(to, left), place(to, left, kCurbHeight_m),
                              place(from, left, kCurbHeight_m)};
      scene_->add_polygon(corners, material);
    };
    scene_->begin_group();
    const bool dash = static_cast<int>(s / kPiece_m) % 3 == 0;
    const double across[] = {kRightCurb_m + 2.1, kCenterLine_m, kLeftCurb_m - 2.1};
    strip(kRightCurb_m, kLeftCurb_m, 0, things_.road(stream(), kRightCurb_m, across, dash));
    strip(kRightHouses_m - 2, kRightCurb_m, kCurbHeight_m, things_.pavement());
    strip(kLeftCurb_m, kLeftHouses_m + 2, kCurbHeight_m, things_.pavement());
    wall(end, s, kRightCurb_m, things_.curb());
    wall(s, end, kLeftCurb_m, things_.curb());
    scene_->end_body();
  }

  /// Returns whether a footprint keeps its distance from the route. front: middle of its front
  /// edge; inwards: away from the street.
  bool keeps_clear(const Vec3& front, const Vec3& along, const Vec3& inwards, double width,
                   double depth, double clearance_m) const {
    for (const double a : {-0.5, -0.25, 0.0, 0.25, 0.5})
      for (const double b : {0.0, 0.5, 1.0})
        if (route_.distance_m(front + a * width * along + b * depth * inwards, clearance_m) <
            clearance_m)
          return false;
    return true;
  }

  void add_row(double s, double left, double width, double depth, double height, bool right,
               double clearance_m, bool detailed) {
    Random random = stream();
    const SinCos heading = sincos_turns(route_.heading_turns(s));
    const Vec3 along(heading.cos, heading.sin, 0);
    const Vec3 to_left(-heading.sin, heading.cos, 0);
    const Vec3 to_street = right ? to_left : Vec3(-to_left);
    const Vec3 front = place(s, left);
    if (!keeps_clear(front, along, -to_street, width, depth, clearance_m)) return;
    scene_->begin_group();
    things_.house(front, to_street, width, depth, height, detailed, random);
    scene_->end_body();
  }

  void add_houses(bool right) {
    double next_street_m = right ? 50 : 75;
    for (double s = 0; s < route_.length_m();) {
      Random random = stream();
      if (s > next_street_m) {
        s += random.uniform(8, 11);  // a side street
        next_street_m = s + random.uniform(55, 95);
      } else if (random.uniform() < 0.15) {
        s += random.uniform(2.5, 5);
      }
      const double width = random.uniform(8, 16), height = random.uniform(6.5, 15);
      const double back = random.uniform() < 0.4 ? random.uniform(0, 1.8) : 0;
      const double depth = random.uniform(9, 13);
      const double left = right ? kRightHouses_m - back : kLeftHouses_m + back;
      const double middle = s + 0.5 * width;
      s += width;
      if (is_open(middle)) continue;
      add_row(middle, left, width, depth, height, right, kHouseClearance_m, true);
    }
  }

  /// Adds distant houses, which are seen through gaps instead of the sky.
  void add_backdrop(bool right) {
    for (double s = 0; s < route_.length_m();) {
      Random random = stream();
      const double width = random.uniform(16, 26), height = random.uniform(9, 20);
      const double away = random.uniform(32, 42);
      add_row(s + 0.5 * width, right ? -away : away + 3.5, width, 12, height, right, 14, false);
      s += width + random.uniform(4, 14);
    }
  }

  void add_parked_cars(bool right) {
    for (double s = 3; s < route_.length_m() - 3;) {
      Random random = stream();
      const double at = s;
      const bool taken = random.uniform() < 0.55, changes = random.uniform() < 0.2;
      const bool taken_again = random.uniform() < 0.6;
      const double left = (right ? kRightParking_m : kLeftParking_m) + random.uniform(-0.15, 0.15);
      const double turn_deg = random.uniform(-2, 2) + (random.uniform() < 0.2 ? 180 : 0);
      s += random.uniform(5.6, 7.4);
      const bool corner = std::abs(route_.curvature(at)) > kNoParking_per_m;
      if (is_open(at) || corner || !taken) continue;
      const double yaw_deg = 360 * route_.heading_turns(at) + (right ? 0 : 180) + turn_deg;
      const double change_s = drive_->leaves_behind_s(at + 12);
      const double never = std::numeric_limits<double>::infinity();
      scene_->begin_group(-never, changes ? change_s : never);
      things_.car(place(at, left), yaw_deg, random);
      scene_->end_body();
      if (!changes || !taken_again) continue;
      scene_->begin_group(change_s, never);
      const double moved = random.uniform(-0.5, 0.5);
      things_.car(place(at + moved, left), yaw_deg, random);
      scene_->end_body();
    }
  }

  void add_trees_and_poles(bool right) {
    for (double s = right ? 6 : 11; s < route_.length_m() - 4;) {
      Random random = stream();
      const double at = s;
      const double kind = random.uniform();
      s += random.uniform(7, 13);
      if (is_open(at) || kind > 0.75) continue;
      const Vec3 p = place(at, right ? kRightCurb_m - 0.7 : kLeftCurb_m + 0.7, kCurbHeight_m);
      scene_->begin_group();
      if (kind < 0.4)
        things_.tree(p, random);
      else
        things_.pole(p, 360 * route_.heading_turns(at), random);
      scene_->end_body();
    }
  }

  void add_passing_car(int i) {
    Random random = stream();
    const double start = (i + random.uniform()) * route_.length_m() / options_.passing_cars;
    const double speed = random.uniform(4.5, 7);
    Body body;
    body.motion = std::make_shared<OncomingCar>(drive_, start, speed);
    scene_->begin_body(body);
    things_.car(Vec3::Zero(), 0, random);
    scene_->end_body();
  }

  StreetOptions options_;
  std::shared_ptr<const Drive> drive_;
  const Route& route_;
  std::shared_ptr<Scene> scene_;
  Roadside things_;
  std::vector<double> open_;  ///< where each open stretch begins
  std::uint64_t pieces_ = 0;
};

}  // namespace

std::shared_ptr<const Scene> make_street(const StreetOptions& options,
                                         std::shared_ptr<const Drive> drive) {
  return StreetBuilder(options, std::move(drive)).build();
}

}  // namespace slambed::synth
