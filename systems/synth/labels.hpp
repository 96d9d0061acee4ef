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

/// Position of a joint in the picture. Visibility as in COCO, except that 0 means outside of the
/// picture.
struct Keypoint {
  float u_px = 0, v_px = 0;
  std::uint32_t visibility = 0;  ///< 1: occluded, 2: visible
};

/// Label of one person, sampled at pixel centers at mid-exposure.
struct PersonLabel {
  std::array<Keypoint, kKeypoints> keypoints{};
  std::vector<std::uint32_t> runs;  ///< run lengths of the mask: out, in, out ..., row by row
};

/// Returns labels of all people with at least one visible pixel, in the order of the cast.
std::vector<PersonLabel> label_people(Renderer& renderer, std::span<const Figure> cast,
                                      const SE3& T_wc, double time_s);

/// Encodes one frame of labels.bin, which is a mask cache (docs/reference/sequence.md) with the key
/// "labels".
std::string label_block(std::span<const PersonLabel> people, const Camera& camera);
std::string label_file(const std::vector<std::string>& blocks);

}  // namespace slambed::synth
