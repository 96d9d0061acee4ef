// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "sequence/frame_file.hpp"
#include "sequence/mask_source.hpp"

namespace slambed {

/// Masks of every frame of a sequence, segmented once per JPEG quality, neural network and n_m
/// (docs/reference/sequence.md, "Mask cache").
class MaskCache final : public MaskSource {
 public:
  MaskCache(int width, int height) : width_(width), height_(height) {}

  /// Throws Error(kBadInput) unless the file exists and has this number of frames and this key.
  void add(double threshold, const std::filesystem::path& path, const std::string& key,
           std::uint64_t frames);
  /// Throws Error(kBadInput) if there are no masks for the frame and threshold.
  Segmentation masks(std::uint64_t frame, std::span<const std::uint8_t> jpeg,
                     double threshold) override;

 private:
  int width_, height_;
  std::map<double, std::unique_ptr<FrameFile>> files_;
};

}  // namespace slambed
