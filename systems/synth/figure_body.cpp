// SPDX-License-Identifier: Apache-2.0
#include "synth/figure_body.hpp"

#include <algorithm>
#include <span>
#include <vector>

#include "synth/random.hpp"

namespace slambed::synth {
namespace {

class PartMotion final : public Motion {
 public:
  PartMotion(std::shared_ptr<const Actor> actor, int part)
      : actor_(std::move(actor)), part_(part) {}
  SE3 at(double time_s) const override { return actor_->parts(time_s)[part_]; }

 private:
  std::shared_ptr<const Actor> actor_;
  int part_;
};

/// A horizontal ellipse around a part's axis. `material` applies from this ring up to the next.
struct Ring {
  double z = 0, radius_x = 0, radius_y = 0;
  const Material* material = nullptr;
  double x = 0;  ///< of the center
};

/// Adds a body from rings in order from below; `sides` is the corners per ring. Lids close the
/// ends.
void add_rings(Scene& scene, std::span<const Ring> rings, int sides) {
  const auto corners = [&](const Ring& ring) {
    std::vector<Vec3> points;
    for (int i = 0; i < sides; ++i) {
      const SinCos a = sincos_turns(static_cast<double>(i) / sides);
      points.emplace_back(ring.x + ring.radius_x * a.cos, ring.radius_y * a.sin, ring.z);
    }
    return points;
  };
  std::vector<Vec3> below = corners(rings.front());
  scene.add_polygon(std::vector<Vec3>(below.rbegin(), below.rend()), *rings.front().material);
  for (std::size_t k = 1; k < rings.size(); ++k) {
    const std::vector<Vec3> above = corners(rings[k]);
    for (int i = 0; i < sides; ++i) {
      const int next = (i + 1) % sides;
      scene.add_polygon(std::vector<Vec3>{below[i], below[next], above[next], above[i]},
                        *rings[k - 1].material);
    }
    below = above;
  }
  scene.add_polygon(below, *rings[rings.size() - 2].material);
}

class Tailor {
 public:
  Tailor(std::uint64_t seed, double texel_scale) : random_(seed, 0xc107), scale_(texel_scale) {
    shirt = cloth(random_.uniform(35, 215));
    trousers = cloth(random_.uniform(25, 170), 0.6);
    skin = plain(random_.uniform(75, 190), 10);
    hair = plain(random_.uniform(18, 165), 22);
    shoes = plain(random_.uniform(20, 200), 18);
    long_sleeves = random_.uniform() < 0.6;
    long_trousers = random_.uniform() < 0.8;
  }

  Material shirt, trousers, skin, hair, shoes;
  bool long_sleeves, long_trousers;

 private:
  Material plain(double gray, double contrast) const {
    Material m;
    m.gray = gray;
    m.contrast = contrast;
    m.texel_m = 0.003 * scale_;
    m.smallest_m = 0.005;
    m.largest_m = 0.05;
    m.coverage = 1;
    return m;
  }

  Material cloth(double gray, double loud = 1) {
    Material m = plain(gray, random_.uniform(8, 18));
    const double kind = random_.uniform();
    const double period = random_.uniform(0.025, 0.09), other = random_.uniform(25, 225);
    const double print = random_.uniform(40, 80), largest = random_.uniform(0.02, 0.07);
    if (kind < 0.35 * loud) {
      m.contrast = print;
      m.largest_m = largest;
      m.coverage = 1.5;
    } else if (kind < 0.6 * loud) {
      for (double t = 0; t < 0.6; t += period) m.marks.push_back({0, t, 1, 0.45 * period, other});
    }
    return m;
  }

  Random random_;
  double scale_;
};

constexpr int kLimbSides = 8, kTrunkSides = 12;

class Sculptor {
 public:
  Sculptor(Scene& scene, std::shared_ptr<const Actor> actor, int number, const Tailor& clothes)
      : scene_(scene), actor_(std::move(actor)), number_(number), wear_(clothes) {
    const Build& b = actor_->build();
    add_trunk(b);
    add_head(b);
    for (int side = 0; side < 2; ++side) {
      add_arm(b, side);
      add_leg(b, side);
    }
  }

 private:
  void add(int part, std::span<const Ring> rings, int sides) {
    begin(part);
    add_rings(scene_, rings, sides);
    scene_.end_body();
  }

  void begin(int part) {
    Body body;
    body.motion = std::make_shared<PartMotion>(actor_, part);
    body.figure = number_;
    scene_.begin_body(body);
  }

  void add_trunk(const Build& b) {
    const double h = b.height_m, g = b.girth * h;
    const Ring pelvis[] = {{-0.055 * h, 0.045 * g, 0.070 * g, &wear_.trousers},
                           {0.000 * h, 0.068 * g, 0.098 * g, &wear_.trousers},
                           {0.065 * h, 0.062 * g, 0.090 * g, &wear_.trousers}};
    add(kPelvis, pelvis, kTrunkSides);
    const Ring torso[] = {{0.015 * h, 0.068 * g, 0.096 * g, &wear_.shirt},
                          {0.090 * h, 0.062 * g, 0.086 * g, &wear_.shirt},
                          {0.210 * h, 0.070 * g, 0.106 * g, &wear_.shirt},
                          {0.275 * h, 0.052 * g, 0.104 * g, &wear_.shirt},
                          {0.303 * h, 0.034 * g, 0.045 * g, &wear_.shirt}};
    add(kTorso, torso, kTrunkSides);
  }

  void add_head(const Build& b) {
    const double h = b.height_m, top = b.head_m();
    const Ring neck[] = {{-0.01 * h, 0.032 * h, 0.034 * h, &wear_.skin},
                         {0.05 * h, 0.030 * h, 0.032 * h, &wear_.skin}};
    add(kHead, neck, kLimbSides);
    const Ring head[] = {{0.038 * h, 0.026 * h, 0.024 * h, &wear_.skin, 0.014 * h},
                         {0.070 * h, 0.046 * h, 0.038 * h, &wear_.skin, 0.010 * h},
                         {0.105 * h, 0.055 * h, 0.043 * h, &wear_.skin, 0.004 * h},
                         {0.130 * h, 0.054 * h, 0.043 * h, &wear_.hair},
                         {top - 0.014 * h, 0.042 * h, 0.035 * h, &wear_.hair, -0.004 * h},
                         {top, 0.016 * h, 0.014 * h, &wear_.hair, -0.006 * h}};
    add(kHead, head, kTrunkSides);
    const Ring back[] = {{0.058 * h, 0.030 * h, 0.036 * h, &wear_.hair, -0.022 * h},
                         {0.105 * h, 0.036 * h, 0.045 * h, &wear_.hair, -0.024 * h},
                         {0.148 * h, 0.032 * h, 0.040 * h, &wear_.hair, -0.020 * h}};
    add(kHead, back, kLimbSides);
    const Ring nose[] = {{0.080 * h, 0.012 * h, 0.009 * h, &wear_.skin, 0.055 * h},
                         {0.110 * h, 0.006 * h, 0.005 * h, &wear_.skin, 0.054 * h}};
    add(kHead, nose, 6);
    const Ring eyes[] = {{0.107 * h, 0.004 * h, 0.026 * h, &wear_.hair, 0.056 * h},
                         {0.114 * h, 0.004 * h, 0.026 * h, &wear_.hair, 0.056 * h}};
    add(kHead, eyes, 6);
  }

  void add_arm(const Build& b, int side) {
    const double h = b.height_m, g = b.girth * h;
    const Material& lower = wear_.long_sleeves ? wear_.shirt : wear_.skin;
    const double upper = b.upper_arm_m(), fore = b.forearm_m();
    const Ring arm[] = {{-upper - 0.012 * h, 0.024 * g, 0.024 * g, &lower},
                        {-0.5 * upper, 0.028 * g, 0.028 * g, &wear_.shirt},
                        {0.012 * h, 0.034 * g, 0.034 * g, &wear_.shirt},
                        {0.028 * h, 0.018 * g, 0.018 * g, &wear_.shirt}};
    add(kUpperArm + side, arm, kLimbSides);
    const Ring forearm[] = {{-fore, 0.016 * g, 0.018 * g, &lower},
                            {-0.35 * fore, 0.026 * g, 0.026 * g, &lower},
                            {0.012 * h, 0.023 * g, 0.023 * g, &lower}};
    add(kForearm + side, forearm, kLimbSides);
    const Ring hand[] = {{-fore - 0.095 * h, 0.008 * h, 0.010 * h, &wear_.skin},
                         {-fore - 0.055 * h, 0.013 * h, 0.025 * h, &wear_.skin},
                         {-fore + 0.005 * h, 0.015 * h, 0.018 * h, &wear_.skin}};
    add(kForearm + side, hand, kLimbSides);
  }

  void add_leg(const Build& b, int side) {
    const double h = b.height_m, g = b.girth * h;
    const Material& lower = wear_.long_trousers ? wear_.trousers : wear_.skin;
    const double thigh = b.thigh_m(), shin = b.shin_m();
    const Ring upper[] = {{-thigh - 0.015 * h, 0.033 * g, 0.032 * g, &wear_.trousers},
                          {-0.3 * thigh, 0.048 * g, 0.045 * g, &wear_.trousers},
                          {0.03 * h, 0.050 * g, 0.048 * g, &wear_.trousers}};
    add(kThigh + side, upper, kLimbSides);
    const Ring calf[] = {{-shin - 0.005 * h, 0.023 * g, 0.022 * g, &lower},
                         {-0.35 * shin, 0.036 * g, 0.034 * g, &lower, -0.006 * h},
                         {0.015 * h, 0.033 * g, 0.032 * g, &lower}};
    add(kShin + side, calf, kLimbSides);
    const double sole = -b.ankle_m();
    const Ring shoe[] = {{sole, 0.074 * h, 0.026 * h, &wear_.shoes, 0.040 * h},
                         {0.45 * sole, 0.070 * h, 0.027 * h, &wear_.shoes, 0.034 * h},
                         {0.3 * b.ankle_m(), 0.026 * h, 0.022 * h, &wear_.shoes}};
    add(kFoot + side, shoe, kLimbSides);
  }

  Scene& scene_;
  std::shared_ptr<const Actor> actor_;
  int number_;
  const Tailor& wear_;
};

}  // namespace

void add_figure(Scene& scene, std::shared_ptr<const Actor> actor, int number, std::uint64_t seed,
                double texel_scale) {
  const Tailor clothes(seed, texel_scale);
  if (actor->sits()) {
    const Stance s = actor->stance(0);
    Material wood;
    wood.gray = 95;
    wood.contrast = 35;
    wood.texel_m = 0.003 * texel_scale;
    scene.add_box({s.pelvis.x(), s.pelvis.y(), 0}, {0.36, 0.36, actor->seat_m() - 0.02}, wood);
  }
  Sculptor(scene, std::move(actor), number, clothes);
}

}  // namespace slambed::synth
