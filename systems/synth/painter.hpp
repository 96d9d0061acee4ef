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

/// Look of a surface: overlapping opaque shapes of all sizes ("dead leaves", Lee, Mumford and Huang
/// 2001). Their size distribution is scale-free, so there are corners at every viewing distance.
struct Material {
  double gray = 128;          ///< mean, 0..255
  double contrast = 60;       ///< largest deviation from the mean, gray levels
  double smallest_m = 0.004;  ///< half size of the smallest leaf
  double largest_m = 0.25;    ///< half size of the largest leaf
  double coverage = 2.5;      ///< mean number of leaves over each point
  double grid_m = 0;          ///< spacing of joints between tiles or planks; 0: none
  double texel_m = 0.003;
  std::vector<Mark> marks{};  ///< painted over the leaves, in this order
};

/// Returns a material with leaves from 1.6 texel_m up to largest_m. texel_scale coarsens the
/// texture but not the leaves.
Material leafy(double gray, double contrast, double texel_m, double largest_m, double coverage,
               double texel_scale);

void paint(Texture& texture, const Material& material, Random random);

}  // namespace slambed::synth
