// SPDX-License-Identifier: Apache-2.0
#include "sequence/mask_cache.hpp"

#include "base/error.hpp"
#include "wire/mask_codec.hpp"

namespace slambed {

void MaskCache::add(double threshold, const std::filesystem::path& path, const std::string& key,
                    std::uint64_t frames) {
  auto file = std::make_unique<FrameFile>(
      FrameFile::Kind{.name = "mask cache", .magic = 0x434D4C53, .version = 1}, path,  // "SLMC"
      frames);
  if (!file->open(key)) {
    throw bad_input("mask cache " + path.string() +
                    ": is missing, or was made of other pictures; segment the sequence anew");
  }
  files_[threshold] = std::move(file);
}

Segmentation MaskCache::masks(std::uint64_t frame, std::span<const std::uint8_t>,
                              double threshold) {
  const auto found = files_.find(threshold);
  if (found == files_.end()) {
    throw bad_input("masks: the sequence was not segmented with n_m " + std::to_string(threshold) +
                    "; name a mask cache for it");
  }
  const auto block = found->second->block(frame);
  try {
    return {wire::decode_segmentation(block.count, block.bytes, width_, height_), {}};
  } catch (const wire::DecodeError& error) {
    found->second->refuse(frame, std::string("is no segmentation (") + error.what() + ")");
  }
}

}  // namespace slambed
