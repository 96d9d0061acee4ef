// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "synth/random.hpp"
#include "synth/texture.hpp"

namespace slambed::synth {

/// A plain rectangle on a surface: a window, a line on the road.
struct Mark {
  double s_m, t_m, width_m, height_m;
  double gray;
};

/// Look of a surface: opaque shapes of all sizes thrown over each other ("dead leaves", Lee,
/// Mumford and Huang 2001). Their size law is scale-free, so corners exist at every distance.
struct Material {
  double gray = 128;          ///< mean, 0..255
  double contrast = 60;       ///< gray levels either side of the mean
  double smallest_m = 0.004;  ///< half size of the smallest leaf
  double largest_m = 0.25;    ///< half size of the largest leaf
  double coverage = 2.5;      ///< how often the surface is covered on average
  double grid_m = 0;          ///< joints of tiles or planks; 0: none
  double texel_m = 0.003;
  std::vector<Mark> marks{};  ///< painted over the leaves, in this order
};

/// Leaves from 1.6 texels up to largest_m. texel_scale: how much coarser the texture is than its
/// leaves.
Material leafy(double gray, double contrast, double texel_m, double largest_m, double coverage,
               double texel_scale);

void paint(Texture& texture, const Material& material, Random random);

}  // namespace slambed::synth
