// SPDX-License-Identifier: Apache-2.0
#include "wire/image_codec.hpp"

#include <turbojpeg.h>

#include <memory>
#include <string>
#include <type_traits>

#include "base/error.hpp"

namespace slambed::wire {
namespace {

struct Destroy {
  void operator()(void* handle) const { tjDestroy(handle); }
};
using Handle = std::unique_ptr<std::remove_pointer_t<tjhandle>, Destroy>;

/// Limits the scans, because a hostile file may contain any number, and treats warnings as errors.
constexpr int kDecodeFlags = TJFLAG_ACCURATEDCT | TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS;

Handle made(tjhandle handle) {
  if (handle == nullptr) throw environment_error("JPEG: no memory for the codec");
  return Handle(handle);
}

/// Whether the data end with the EOI marker. Without one the image is truncated, and the decoder
/// would ignore data after it.
bool ends(std::span<const std::uint8_t> jpeg) {
  return jpeg.size() >= 2 && jpeg[jpeg.size() - 2] == 0xFF && jpeg.back() == 0xD9;
}

void check(tjhandle decoder, std::span<const std::uint8_t> jpeg, int width, int height) {
  int found_width = 0, found_height = 0, sampling = 0, colors = 0;
  if (tjDecompressHeader3(decoder, jpeg.data(), jpeg.size(), &found_width, &found_height, &sampling,
                          &colors) != 0) {
    throw DecodeError(std::string("no JPEG: ") + tjGetErrorStr2(decoder));
  }
  if (!ends(jpeg)) throw DecodeError("JPEG is torn: its end mark is not its end");
  if (colors != TJCS_GRAY) throw DecodeError("JPEG is not gray");
  if (found_width != width || found_height != height) {
    throw DecodeError("JPEG is " + std::to_string(found_width) + "x" +
                      std::to_string(found_height) + " px, announced were " +
                      std::to_string(width) + "x" + std::to_string(height));
  }
}

}  // namespace

Bytes encode_jpeg(GrayView image, int quality) {
  const Handle encoder = made(tjInitCompress());
  Bytes bytes(tjBufSize(image.width, image.height, TJSAMP_GRAY));
  unsigned char* at = bytes.data();
  unsigned long size = bytes.size();  // NOLINT(google-runtime-int): the library's type
  if (tjCompress2(encoder.get(), image.data, image.width, static_cast<int>(image.stride),
                  image.height, TJPF_GRAY, &at, &size, TJSAMP_GRAY, quality,
                  TJFLAG_ACCURATEDCT | TJFLAG_NOREALLOC) != 0) {
    throw bad_input(std::string("picture cannot be coded as JPEG: ") +
                    tjGetErrorStr2(encoder.get()));
  }
  bytes.resize(size);
  return bytes;
}

void check_jpeg(std::span<const std::uint8_t> jpeg, int width, int height) {
  check(made(tjInitDecompress()).get(), jpeg, width, height);
}

GrayImage decode_jpeg(std::span<const std::uint8_t> jpeg, int width, int height) {
  const Handle decoder = made(tjInitDecompress());
  check(decoder.get(), jpeg, width, height);
  GrayImage image{width, height, {}};
  image.pixels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  if (tjDecompress2(decoder.get(), jpeg.data(), jpeg.size(), image.pixels.data(), width, width,
                    height, TJPF_GRAY, kDecodeFlags) != 0) {
    throw DecodeError(std::string("JPEG is damaged: ") + tjGetErrorStr2(decoder.get()));
  }
  return image;
}

}  // namespace slambed::wire
