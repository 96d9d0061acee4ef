// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace slambed {

/// How one image axis shrinks: out[i] = (in[first] * w0 + in[first + 1] * w1 + in[first + 2] * w2)
/// / 256. The vector form works on blocks of kResizeBlock outputs that read kResizeWindow inputs.
struct ResizeTable {
  int size = 0;
  const std::uint16_t* first = nullptr;
  const std::uint16_t* weight[3] = {};
  const std::uint16_t* pair_weight = nullptr;  ///< w0 + 256 * w1
  const std::uint16_t* block_first = nullptr;  ///< first input of each block
  const std::uint8_t* place = nullptr;  ///< of each output's first and second input in the block
  bool fits_window = true;  ///< every block reads at most kResizeWindow inputs, no weight is 256
};
inline constexpr int kResizeBlock = 8;
inline constexpr int kResizeWindow = 16;

/// The 512 points of the pattern as the descriptor kernel wants them: each a point, then its b.
struct PatternPoints {
  alignas(64) float x[512];
  alignas(64) float y[512];
};

/// First moments of the intensity over the disc of radius 15.
struct Moments {
  int m10 = 0, m01 = 0;
};

/// Where a patch of the left image fits best when it slides along a row of the right one. The other
/// two are sums over the patch, before, at and after that place.
struct PatchSlide {
  int best = 0;      ///< 0 to 2 * kPatchSlide, the first of equals
  int absolute = 0;  ///< differences, each image relative to the pixel in the middle of its patch
  int total[3] = {}, squares[3] = {};  ///< of those differences; none where the best is at an end
};

/// Buffers that kernels read or write must have this many accessible bytes beyond the last element.
inline constexpr int kKernelSlack = 64;
/// Radius of the disc that gives a keypoint its orientation, px (ORB-SLAM2: patch of 31).
inline constexpr int kOrientationRadius = 15;
/// Half width of the Gaussian, px.
inline constexpr int kBlurRadius = 3;
inline constexpr int kBlurScratchRows = 2;
/// Half a patch's side, and how far it slides either way, px (ORB-SLAM2's stereo matching).
inline constexpr int kPatchRadius = 5;
inline constexpr int kPatchSlide = 5;

/// The inner loops of the extractor. All implementations compute the same bytes. Their files use
/// nothing inline from elsewhere: the linker might keep the copy only one processor can run.
struct Kernels {
  const char* name;

  /// out[i] = weighted mean of three rows; weights sum to 256.
  void (*blend_rows)(const std::uint8_t* const rows[3], const std::uint16_t weights[3], int n,
                     std::uint8_t* out);
  /// Shrinks one row.
  void (*resize_row)(const std::uint8_t* in, const ResizeTable& axis, std::uint8_t* out);
  /// FAST-9/16 of n pixels: 1 + the largest threshold at which the pixel is a corner, or 0 where
  /// that is not above the threshold. May write up to kKernelSlack bytes beyond n.
  void (*fast_row)(const std::uint8_t* in, std::ptrdiff_t stride, int n, std::uint8_t threshold,
                   std::uint8_t* score);
  /// The columns of row whose score is above all eight neighbors, and of them those whose score is
  /// above the floor: column 32 * w + i is bit i of word w.
  void (*peaks_row)(const std::uint8_t* above, const std::uint8_t* row, const std::uint8_t* below,
                    int words, std::uint8_t floor, std::uint32_t* peaks, std::uint32_t* strong);
  /// 7x7 Gaussian, sigma 2, of some rows of n pixels; scratch holds kBlurScratchRows rows of
  /// n + 2 * kBlurRadius + kKernelSlack bytes.
  void (*blur)(const std::uint8_t* in, std::ptrdiff_t stride, int n, int rows,
               std::uint8_t* scratch, std::uint8_t* out, std::ptrdiff_t out_stride);
  /// Moments of the disc around a pixel.
  Moments (*moments)(const std::uint8_t* center, std::ptrdiff_t stride);
  /// The pattern turned by the angle with this cosine and sine, compared on the blurred image.
  void (*describe)(const std::uint8_t* center, std::ptrdiff_t stride, const PatternPoints& pattern,
                   float cosine, float sine, std::uint64_t* bits);
  /// Slides the patch around the pixel left along the row of the pixel right.
  PatchSlide (*slide_patch)(const std::uint8_t* left, std::ptrdiff_t left_stride,
                            const std::uint8_t* right, std::ptrdiff_t right_stride);
};

/// Gcc's portable vectors, 16 bytes wide: SSE2, NEON, or plain loops where there is neither.
const Kernels& portable_kernels();
/// AVX2; null in builds for other processors. The caller has asked the processor whether it can.
const Kernels* avx2_kernels();
/// The fastest kernels this processor can run.
const Kernels& fastest_kernels();

}  // namespace slambed
