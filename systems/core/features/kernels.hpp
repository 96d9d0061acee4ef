// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace slambed {

/// Downscaling of one image axis: out[i] is in[first], in[first + 1], in[first + 2] weighted by w0,
/// w1, w2 in 256ths. Vector kernels compute kResizeBlock outputs from kResizeWindow inputs at once.
struct ResizeTable {
  int size = 0;
  const std::uint16_t* first = nullptr;
  const std::uint16_t* weight[3] = {};
  const std::uint16_t* pair_weight = nullptr;  ///< w0 + 256 * w1
  const std::uint16_t* block_first = nullptr;  ///< first input of each block
  const std::uint8_t* place = nullptr;  ///< offsets in the block of each output's first two inputs
  bool fits_window = true;  ///< blocks read at most kResizeWindow inputs, and no weight is 256
};
inline constexpr int kResizeBlock = 8;
inline constexpr int kResizeWindow = 16;

/// The 512 points of the pattern in the layout of the descriptor kernel: a and b of each test in
/// turn.
struct PatternPoints {
  alignas(64) float x[512];
  alignas(64) float y[512];
};

/// First moments of the intensity over the disc of radius 15.
struct Moments {
  int m10 = 0, m01 = 0;
};

/// Best match of a patch of the left image that slides along a row of the right one. Differences
/// are between pixels relative to the center pixel of their patch.
struct PatchSlide {
  int best = 0;                        ///< 0 to 2 * kPatchSlide; the first one of equal matches
  int absolute = 0;                    ///< sum of absolute differences at the best position
  int total[3] = {}, squares[3] = {};  ///< at best - 1, best, best + 1; 0 if best is an end
};

/// Buffers of kernels must have this many accessible bytes beyond the last element.
inline constexpr int kKernelSlack = 64;
/// Radius of the disc that gives a keypoint its orientation, px (ORB-SLAM2: patch of 31).
inline constexpr int kOrientationRadius = 15;
/// Half width of the Gaussian, px.
inline constexpr int kBlurRadius = 3;
inline constexpr int kBlurScratchRows = 2;
/// Half the side of a patch and its largest shift either way, px (ORB-SLAM2's stereo matching).
inline constexpr int kPatchRadius = 5;
inline constexpr int kPatchSlide = 5;

/// The inner loops of the extractor. All implementations compute the same bytes. Their files use no
/// inline functions from other headers, because the linker might keep a copy for newer processors.
struct Kernels {
  const char* name;

  /// out[i] = weighted mean of three rows; weights sum to 256.
  void (*blend_rows)(const std::uint8_t* const rows[3], const std::uint16_t weights[3], int n,
                     std::uint8_t* out);
  /// Shrinks one row.
  void (*resize_row)(const std::uint8_t* in, const ResizeTable& axis, std::uint8_t* out);
  /// FAST-9/16 of n pixels: score is 1 + the largest threshold at which the pixel is a corner, or 0
  /// when it is no corner at `threshold`. May write up to kKernelSlack bytes beyond n.
  void (*fast_row)(const std::uint8_t* in, std::ptrdiff_t stride, int n, std::uint8_t threshold,
                   std::uint8_t* score);
  /// Non-maximum suppression of one row: peaks marks columns with a score above all eight
  /// neighbors, strong those that are also above `floor`. Column 32 * w + i is bit i of word w.
  void (*peaks_row)(const std::uint8_t* above, const std::uint8_t* row, const std::uint8_t* below,
                    int words, std::uint8_t floor, std::uint32_t* peaks, std::uint32_t* strong);
  /// 7x7 Gaussian, sigma 2, of `rows` rows of n pixels; scratch holds kBlurScratchRows rows of
  /// n + 2 * kBlurRadius + kKernelSlack bytes.
  void (*blur)(const std::uint8_t* in, std::ptrdiff_t stride, int n, int rows,
               std::uint8_t* scratch, std::uint8_t* out, std::ptrdiff_t out_stride);
  /// Moments of the disc around a pixel.
  Moments (*moments)(const std::uint8_t* center, std::ptrdiff_t stride);
  /// Descriptor bits: rotates the pattern by the given cosine and sine and compares blurred pixels.
  void (*describe)(const std::uint8_t* center, std::ptrdiff_t stride, const PatternPoints& pattern,
                   float cosine, float sine, std::uint64_t* bits);
  /// Slides the patch around pixel `left` along the row of pixel `right`.
  PatchSlide (*slide_patch)(const std::uint8_t* left, std::ptrdiff_t left_stride,
                            const std::uint8_t* right, std::ptrdiff_t right_stride);
};

/// Kernels in portable 16-byte gcc vectors: SSE2, NEON, or scalar code without either.
const Kernels& portable_kernels();
/// AVX2 kernels; null in builds for other architectures. The caller must check for AVX2 first.
const Kernels* avx2_kernels();
/// Returns the fastest kernels that this processor can run.
const Kernels& fastest_kernels();

}  // namespace slambed
