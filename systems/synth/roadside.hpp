// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "synth/random.hpp"
#include "synth/scene.hpp"

namespace slambed::synth {

/// Objects and materials of a street.
class Roadside {
 public:
  Roadside(Scene& scene, double texel_scale) : scene_(scene), texel_scale_(texel_scale) {}

  /// Material of a 3 m piece of road whose right edge lies at `right_m`, with lines at lateral
  /// positions `lines_m` (the middle one only if `dash`) and random cracks.
  Material road(Random random, double right_m, std::span<const double> lines_m, bool dash) const;
  Material pavement() const;
  Material curb() const;
  Material ground() const;

  /// front: middle of its front edge on the ground; to_street: normal of the front. `detailed`
  /// gives finer textures.
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
