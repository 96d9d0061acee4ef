// SPDX-License-Identifier: Apache-2.0
#include "synth/cast.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/error.hpp"
#include "synth/random.hpp"

namespace slambed::synth {
namespace {

constexpr double kNearest_m = 0.7;
constexpr int kAttempts = 60;
constexpr double kCheckEvery_s = 0.1;

double blend(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

/// The area of the tables in every room, with a margin for a body next to them.
bool on_tables(const Vec3& p) { return std::abs(p.x()) < 2.0 && std::abs(p.y()) < 1.05; }

class Casting {
 public:
  Casting(const CastOptions& options, std::uint64_t number, std::uint64_t attempt)
      : options_(options),
        seed_(mix(options.seed ^ mix(0xca57 + 64 * number + attempt))),
        random_(seed_) {
    build_.height_m = random_.uniform(1.5, 1.95);
    build_.girth = random_.uniform(0.85, 1.3);
  }

  Figure cast(int number) { return {std::make_shared<Actor>(actor(number)), seed_}; }

 private:
  Actor actor(int number) {
    const std::string& activity = options_.activity;
    if (activity == "sitting") return at_the_tables(number);
    if (activity == "crossing") return Actor::walking(build_, lane(number), seed_);
    if (activity == "walking")
      return Actor::walking(build_, number % 2 == 0 ? lane(number) : around(2.3, 1.45), seed_);
    const double kind = random_.uniform();
    if (kind < 0.5) {
      const double half_x = random_.uniform(2.3, 3.4), half_y = random_.uniform(1.45, 2.9);
      return Actor::walking(build_, around(half_x, half_y), seed_);
    }
    return somewhere(kind < 0.75);
  }

  /// Back and forth along the near side of the tables.
  Track lane(int number) {
    std::vector<Vec3> control;
    for (const double x : {-2.4, -0.8, 0.8, 2.4})
      control.emplace_back(x, -1.12 + random_.uniform(-0.03, 0.03), 0);
    for (const double x : {2.4, 0.8, -0.8, -2.4})
      control.emplace_back(x, -1.42 + random_.uniform(-0.03, 0.03), 0);
    const double start = 0.5 * number + random_.uniform(0.05, 0.2);
    const double speed = random_.uniform(0.8, 1.0);
    if (options_.activity != "crossing") return track(control, speed, start);
    const auto slow = [](const Vec3& p, double) {
      return 0.28 + 0.72 * blend((std::abs(p.x()) - 0.5) / 0.7);
    };
    return Track(control, speed, start, options_.duration_s, slow);
  }

  /// Along a rectangle with round corners, which clears the tables from half sizes of 2.3 x 1.45 m.
  Track around(double half_x, double half_y) {
    std::vector<Vec3> control;
    const double sense = random_.uniform() < 0.5 ? 1 : -1;
    for (const auto& [x, y] :
         {std::pair{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}) {
      const double reach = random_.uniform(1, 1.08);
      control.emplace_back(reach * half_x * x, sense * reach * half_y * y, 0);
    }
    const double start = random_.uniform(), speed = random_.uniform(0.55, 1.1);
    return track(control, speed, start);
  }

  /// A track with pauses of 1.5 to 4 s.
  Track track(const std::vector<Vec3>& control, double speed, double start) {
    std::array<double, 8> from{}, length{};
    double t = random_.uniform(0, 6);
    for (std::size_t i = 0; i < from.size(); ++i) {
      from[i] = t;
      length[i] = random_.uniform(1.5, 4);
      t += length[i] + random_.uniform(5, 11);
    }
    const auto pace = [&](const Vec3&, double at) {
      double share = 1;
      for (std::size_t i = 0; i < from.size(); ++i)
        share *= 1 - blend((at - from[i]) / 0.6) * blend((from[i] + length[i] - at) / 0.6);
      return share;
    };
    return Track(control, speed, start, options_.duration_s, pace);
  }

  Actor at_the_tables(int number) {
    const double sign = number % 2 == 0 ? -1 : 1;
    const int out = number / 2;
    const Vec3 place(sign * (0.55 + 0.8 * out) + random_.uniform(-0.05, 0.05), -1.15, 0);
    const double turned = random_.uniform(20, 50);  // towards each other and the near side
    return Actor::sitting(build_, place, sign < 0 ? -turned : 180 + turned, seed_);
  }

  Actor somewhere(bool sits) {
    Vec3 place;
    do {
      place.x() = random_.uniform(-3.6, 3.6);
      place.y() = random_.uniform(-3.0, 3.0);
      place.z() = 0;
    } while (on_tables(place));
    const double yaw = random_.uniform(0, 360);
    return sits ? Actor::sitting(build_, place, yaw, seed_)
                : Actor::standing(build_, place, yaw, seed_);
  }

  const CastOptions& options_;
  std::uint64_t seed_;
  Random random_;
  Build build_;
};

Vec3 feet(const Actor& actor, double time_s) {
  const Vec3 p = actor.stance(time_s).pelvis;
  return {p.x(), p.y(), 0};
}

bool keeps_away(const Actor& actor, const std::vector<Figure>& others, const CameraPath& camera,
                double duration_s) {
  for (double t = 0; t <= duration_s; t += kCheckEvery_s) {
    const Vec3 here = feet(actor, t), eye = camera.at(t).t;
    if ((here - Vec3(eye.x(), eye.y(), 0)).norm() < kNearest_m) return false;
    for (const Figure& other : others)
      if (actor.sits() && (here - feet(*other.actor, t)).norm() < 0.6) return false;
  }
  return true;
}

}  // namespace

std::vector<std::string> activity_names() { return {"walking", "crossing", "sitting", "mixed"}; }

std::vector<Figure> make_cast(const CastOptions& options, const CameraPath& camera) {
  const auto names = activity_names();
  if (std::find(names.begin(), names.end(), options.activity) == names.end())
    throw bad_input("activity '" + options.activity +
                    "' is not known; choose walking, crossing, sitting or mixed");
  std::vector<Figure> cast;
  for (int i = 0; i < options.people; ++i) {
    int attempt = 0;
    for (; attempt < kAttempts; ++attempt) {
      const Figure figure = Casting(options, i, attempt).cast(i);
      if (!keeps_away(*figure.actor, cast, camera, options.duration_s)) continue;
      cast.push_back(figure);
      break;
    }
    if (attempt == kAttempts)
      throw bad_input("no place for person " + std::to_string(i + 1) +
                      " that the camera does not pass within 0.7 m; ask for fewer people or "
                      "another seed");
  }
  return cast;
}

std::vector<Vec3> footprints(std::span<const Figure> cast, double duration_s) {
  std::vector<Vec3> places;
  for (const Figure& figure : cast)
    for (double t = 0; t <= duration_s; t += 2 * kCheckEvery_s)
      places.push_back(feet(*figure.actor, t));
  return places;
}

}  // namespace slambed::synth
