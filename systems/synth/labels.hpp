// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "synth/cast.hpp"
#include "synth/renderer.hpp"

namespace slambed::synth {

/// Where a joint is in the picture; visibility as in COCO, but 0 means outside of the picture.
struct Keypoint {
  float u_px = 0, v_px = 0;
  std::uint32_t visibility = 0;  ///< 1: hidden, 2: seen
};

/// What is to be seen of one person, through pixel centers at mid-exposure.
struct PersonLabel {
  std::array<Keypoint, kKeypoints> keypoints{};
  std::vector<std::uint32_t> runs;  ///< lengths out, in, out ... of the mask, row by row
};

/// Labels of everybody with a pixel in the picture, in the order of the cast.
std::vector<PersonLabel> label_people(Renderer& renderer, std::span<const Figure> cast,
                                      const SE3& T_wc, double time_s);

/// A frame of labels.bin, a mask cache (docs/reference/sequence.md) with the key
/// "labels".
std::string label_block(std::span<const PersonLabel> people, const Camera& camera);
std::string label_file(const std::vector<std::string>& blocks);

}  // namespace slambed::synth
