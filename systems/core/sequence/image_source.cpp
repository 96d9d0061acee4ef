// SPDX-License-Identifier: Apache-2.0
#include "sequence/image_source.hpp"

#include "wire/image_codec.hpp"

namespace slambed {

wire::Bytes EncodingSource::jpeg(std::uint64_t frame) {
  return wire::encode_jpeg(sequence_.frame(frame).gray, quality_);
}

ImageCache::ImageCache(const std::filesystem::path& path, const std::string& key,
                       const PreparedSequence& sequence, int quality)
    : file_({.name = "image cache", .magic = 0x43494C53, .version = 1}, path,  // "SLIC"
            sequence.frames()) {
  EncodingSource source(sequence, quality);
  file_.open_or_make(key, [&](std::uint64_t frame) {
    FrameFile::OwnedBlock block{0, source.jpeg(frame)};
    block.count = static_cast<std::uint32_t>(block.bytes.size());
    return block;
  });
}

wire::Bytes ImageCache::jpeg(std::uint64_t frame) {
  const auto block = file_.block(frame);
  if (block.count != block.bytes.size()) file_.refuse(frame, "is damaged");
  return {block.bytes.begin(), block.bytes.end()};
}

}  // namespace slambed
