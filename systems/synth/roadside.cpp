// SPDX-License-Identifier: Apache-2.0
#include "synth/roadside.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace slambed::synth {

Material Roadside::material(double gray, double contrast, double texel_m, double largest_m,
                            double coverage) const {
  return leafy(gray, contrast, texel_m, largest_m, coverage, texel_scale_);
}

Material Roadside::road(Random random, double right_m, std::span<const double> lines_m,
                        bool dash) const {
  Material m = material(92, 13, 0.016, 0.35, 0.9);
  for (std::size_t i = 0; i < lines_m.size(); ++i) {
    const double t = lines_m[i] - right_m - 0.06;
    if (i != 1)
      m.marks.push_back({0, t, 4, 0.1, 165});
    else if (dash)
      m.marks.push_back({0, t, 3, 0.12, 180});
  }
  if (random.uniform() < 0.25) {  // a patch of newer asphalt
    const double s = random.uniform(0, 1.5), t = random.uniform(0.5, 9);
    const double width = random.uniform(0.6, 1.5), height = random.uniform(0.5, 1.8);
    m.marks.push_back({s, t, width, height, random.uniform(55, 75)});
  }
  const int cracks = 1 + random.below(3);
  for (int i = 0; i < cracks; ++i) {
    double s = random.uniform(0, 3), t = random.uniform(0, 11);
    const double ahead = random.uniform(-0.12, 0.12), aside = random.uniform(-0.12, 0.12);
    const double gray = random.uniform(30, 50);
    for (int k = 0; k < 25; ++k) {
      m.marks.push_back({s, t, 0.05 + std::abs(ahead), 0.035, gray});
      s += ahead + random.uniform(-0.04, 0.04);
      t += aside + random.uniform(-0.04, 0.04);
    }
  }
  return m;
}

Material Roadside::pavement() const {
  Material m = material(128, 16, 0.02, 0.3, 1);
  m.grid_m = 0.6;
  return m;
}

Material Roadside::curb() const { return material(150, 25, 0.02, 0.2, 1); }

Material Roadside::ground() const { return material(105, 30, 0.25, 4, 1); }

void Roadside::add_windows(Material& wall, double width, double height, Random& random) const {
  const double storey = random.uniform(2.8, 3.3), pitch = random.uniform(2.1, 3.2);
  const double wide = pitch * random.uniform(0.38, 0.6), tall = random.uniform(1.3, 1.8);
  const double frame_gray = random.uniform(140, 235), frame = random.uniform(0.06, 0.12);
  const int columns = std::max(1, static_cast<int>((width - 0.6) / pitch));
  const double margin = 0.5 * (width - columns * pitch) + 0.5 * (pitch - wide);
  const int door = random.below(columns);
  for (int floor = 0; (floor + 1) * storey < height + 0.3; ++floor)
    for (int column = 0; column < columns; ++column) {
      const double s = margin + column * pitch;
      const bool is_door = floor == 0 && column == door;
      const double low = is_door ? 0.05 : floor * storey + 0.95;
      const double high = is_door ? 2.2 : std::min(low + tall, height - 0.2);
      const double gray = random.uniform(18, 85);
      if (high <= low + 0.3) continue;
      wall.marks.push_back(
          {s - frame, low - frame, wide + 2 * frame, high - low + 2 * frame, frame_gray});
      wall.marks.push_back({s, low, wide, high - low, gray});
      // A blind, curtain or crossbar makes every window different.
      const double part = random.uniform(0.15, 0.7), light = random.uniform(90, 210);
      const double from = random.uniform(0, 0.5) * wide;
      if (random.uniform() < 0.6)
        wall.marks.push_back({s, high - part * (high - low), wide, part * (high - low), light});
      else
        wall.marks.push_back({s + from, low, 0.35 * wide, high - low, light});
      wall.marks.push_back({s + 0.47 * wide, low, 0.06, high - low, frame_gray});
    }
}

void Roadside::house(const Vec3& front, const Vec3& to_street, double width, double depth,
                     double height, bool detailed, Random& random) {
  const double gray = random.uniform(85, 185), contrast = random.uniform(9, 24);
  Material wall = material(gray, contrast, detailed ? 0.018 : 0.05, 0.4, 1.1);
  Material side = material(gray * 0.95, contrast, detailed ? 0.03 : 0.08, 0.5, 1.1);
  add_windows(wall, width, height, random);
  add_windows(side, depth, height, random);
  const Vec3 up(0, 0, height), along = Vec3::UnitZ().cross(to_street);
  const Vec3 a = front - 0.5 * width * along, b = front + 0.5 * width * along;
  const Vec3 c = b - depth * to_street, d = a - depth * to_street;
  const auto face = [&](const Vec3& p, const Vec3& q, const Material& m) {
    const std::array<Vec3, 4> corners = {p, q, q + up, p + up};
    scene_.add_polygon(corners, m);
  };
  face(a, b, wall);
  face(b, c, side);
  face(c, d, side);
  face(d, a, side);
}

void Roadside::car(const Vec3& p, double yaw_deg, Random& random) {
  const double gray = random.uniform(25, 215), length = random.uniform(3.8, 4.7);
  const double tall = random.uniform(0.5, 0.7);
  const Material paint = material(gray, 20, 0.02, 0.5, 0.5);
  const Material glass = material(45, 30, 0.025, 0.5, 0.8);
  const Material roof = material(gray * 0.9, 15, 0.04, 0.5, 0.5);
  const SinCos yaw = sincos_deg(yaw_deg);
  const Vec3 back = -0.25 * Vec3(yaw.cos, yaw.sin, 0);
  const auto at = [&](double z) { return Vec3(p.x(), p.y(), p.z() + z); };
  scene_.add_box(at(0.02), {length - 0.5, 1.6, 0.3}, material(22, 10, 0.04, 0.3, 0.5), yaw_deg);
  scene_.add_box(at(0.3), {length, 1.74, 0.58}, paint, yaw_deg);
  scene_.add_box(at(0.88) + back, {0.52 * length, 1.5, tall - 0.06}, glass, yaw_deg);
  scene_.add_box(at(0.82 + tall) + back, {0.5 * length, 1.46, 0.07}, roof, yaw_deg);
  // Lamps and license plates at both ends.
  for (const double end : {0.5, -0.5})
    for (const double across : {-0.62, 0.0, 0.62}) {
      const Vec3 lamp =
          end * length * Vec3(yaw.cos, yaw.sin, 0) + across * Vec3(-yaw.sin, yaw.cos, 0);
      scene_.add_box(at(0.52) + lamp, {0.05, across == 0 ? 0.5 : 0.26, 0.14},
                     material(gray > 120 ? 60 : 200, 40, 0.025, 0.1, 1), yaw_deg);
    }
}

void Roadside::tree(const Vec3& p, Random& random) {
  const double trunk = random.uniform(2, 2.8), crown = random.uniform(2, 3.2);
  const double wide = random.uniform(1, 1.6);
  const Material leaves = material(random.uniform(50, 95), 48, 0.03, 0.3, 1.6);
  scene_.add_cylinder(p, 0.16, trunk, material(62, 28, 0.02, 0.2, 1.2), 6);
  const Vec3 above(0, 0, 1);
  scene_.add_cylinder(p + trunk * above, 0.7 * wide, 0.3 * crown, leaves, 8);
  scene_.add_cylinder(p + (trunk + 0.3 * crown) * above, wide, 0.45 * crown, leaves, 8);
  scene_.add_cylinder(p + (trunk + 0.75 * crown) * above, 0.6 * wide, 0.25 * crown, leaves, 8);
}

void Roadside::pole(const Vec3& p, double yaw_deg, Random& random) {
  const double tall = random.uniform(3, 6);
  const bool sign = random.uniform() < 0.6;
  scene_.add_cylinder(p, 0.06, tall, material(80, 20, 0.02, 0.2, 1), 6);
  if (!sign) return;
  const double z = random.uniform(2, 2.6), gray = random.uniform(150, 220);
  Material plate = material(gray, 60, 0.02, 0.2, 0.8);
  scene_.add_box(p + Vec3(0, 0, z), {0.06, 0.65, 0.7}, plate, yaw_deg);
}

}  // namespace slambed::synth
