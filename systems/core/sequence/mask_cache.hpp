// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "sequence/frame_file.hpp"
#include "sequence/mask_source.hpp"

namespace slambed {

/// Masks of every frame of a sequence, segmented once per quality, network and n_m
/// (docs/reference/sequence.md).
class MaskCache final : public MaskSource {
 public:
  /// The size of the sequence's pictures.
  MaskCache(int width, int height) : width_(width), height_(height) {}

  /// Throws Error(kBadInput) unless the file is there, of these frames and with that key.
  void add(double threshold, const std::filesystem::path& path, const std::string& key,
           std::uint64_t frames);
  /// Throws Error(kBadInput) where there are no masks for the frame.
  Segmentation masks(std::uint64_t frame, std::span<const std::uint8_t> jpeg,
                     double threshold) override;

 private:
  int width_, height_;
  std::map<double, std::unique_ptr<FrameFile>> files_;
};

}  // namespace slambed
