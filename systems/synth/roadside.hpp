// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "synth/random.hpp"
#include "synth/scene.hpp"

namespace slambed::synth {

/// What stands in a street and what it is made of.
class Roadside {
 public:
  Roadside(Scene& scene, double texel_scale) : scene_(scene), texel_scale_(texel_scale) {}

  /// A piece of road of 3 m whose right edge lies at `right_m`; lines at these places across (the
  /// middle one is dashed), cracks by the stream.
  Material road(Random random, double right_m, std::span<const double> lines_m, bool dash) const;
  Material pavement() const;
  Material curb() const;
  Material ground() const;

  /// From the middle of its front on the ground; `to_street` is its front's normal. Windows only
  /// where it is detailed.
  void house(const Vec3& front, const Vec3& to_street, double width, double depth, double height,
             bool detailed, Random& random);
  void car(const Vec3& p, double yaw_deg, Random& random);
  void tree(const Vec3& p, Random& random);
  void pole(const Vec3& p, double yaw_deg, Random& random);

 private:
  Material material(double gray, double contrast, double texel_m, double largest_m,
                    double coverage) const;
  void add_windows(Material& wall, double width, double height, Random& random) const;

  Scene& scene_;
  double texel_scale_;
};

}  // namespace slambed::synth
