// SPDX-License-Identifier: Apache-2.0
// Kernels that kernels.hpp describes. Each kernels_* file includes this inside its namespace, after
// vectors.inl and the operations that depend on the instruction set:
//   bool any(U8)                    whether any byte is not 0
//   uint32_t nonzero(U8)            mask of the bytes that are not 0, the first in bit 0
//   U8 excess(U8 a, U8 b)           a - b, or 0 where b is greater
//   U16 widen(const uint8_t*)       half a vector of bytes to 16-bit numbers
//   void store_narrow(uint8_t*, U16)  inverse of widen; the numbers are below 256
//   S32 nearest(F32)                nearest integers, ties to even
//   S32 squares(S16)                sums of the squares of adjacent pairs
//   S32 in_pairs(S16)               sums of adjacent pairs
//   int sum(S32)                    sum of all elements

void blend_rows(const uint8_t* const rows[3], const uint16_t weights[3], int n, uint8_t* out) {
  for (int x = 0; x < n; x += kHalf) {
    const U16 sum = widen(rows[0] + x) * weights[0] + widen(rows[1] + x) * weights[1] +
                    widen(rows[2] + x) * weights[2];
    store_narrow(out + x, (sum + 128) >> 8);
  }
}

void resize_row(const uint8_t* in, const ResizeTable& axis, uint8_t* out) {
  const uint16_t* w0 = axis.weight[0];
  const uint16_t* w1 = axis.weight[1];
  const uint16_t* w2 = axis.weight[2];
  for (int i = 0; i < axis.size; ++i) {
    const uint8_t* from = in + axis.first[i];
    out[i] = static_cast<uint8_t>((from[0] * w0[i] + from[1] * w1[i] + from[2] * w2[i] + 128) >> 8);
  }
}

template <bool kDarkest>
inline U8 inner(U8 a, U8 b) {
  return kDarkest ? max(a, b) : min(a, b);
}
template <bool kDarkest>
inline U8 outer(U8 a, U8 b) {
  return kDarkest ? min(a, b) : max(a, b);
}

/// Returns the largest minimum over all 16 arcs of nine circle pixels (kDarkest = false), or the
/// smallest maximum (true). Two arcs share the pixels k+1..k+8 and add one at either end.
template <bool kDarkest>
inline U8 best_arc(const U8 p[16]) {
  U8 two[8], four[8];
  for (int i = 0; i < 8; ++i) two[i] = inner<kDarkest>(p[2 * i + 1], p[(2 * i + 2) & 15]);
  for (int i = 0; i < 8; ++i) four[i] = inner<kDarkest>(two[i], two[(i + 1) & 7]);
  U8 best = splat(kDarkest ? 255 : 0);
  for (int i = 0; i < 8; ++i) {
    const U8 eight = inner<kDarkest>(four[i], four[(i + 2) & 7]);
    best = outer<kDarkest>(best,
                           inner<kDarkest>(eight, outer<kDarkest>(p[2 * i], p[(2 * i + 9) & 15])));
  }
  return best;
}

void fast_row(const uint8_t* in, ptrdiff_t stride, int n, uint8_t threshold, uint8_t* score) {
  const ptrdiff_t circle[16] = {3 * stride,  3 * stride + 1,  2 * stride + 2,  stride + 3,
                                3,           -stride + 3,     -2 * stride + 2, -3 * stride + 1,
                                -3 * stride, -3 * stride - 1, -2 * stride - 2, -stride - 3,
                                -3,          stride - 3,      2 * stride - 2,  3 * stride - 1};
  const U8 limit = splat(threshold);
  for (int x = 0; x < n; x += kBytes) {
    const uint8_t* at = in + x;
    const U8 center = load<U8>(at);
    // Every arc of nine contains one of any two opposite pixels, which gives these bounds.
    const U8 p0 = load<U8>(at + circle[0]), p4 = load<U8>(at + circle[4]);
    const U8 p8 = load<U8>(at + circle[8]), p12 = load<U8>(at + circle[12]);
    const U8 bright_bound = min(max(p0, p8), max(p4, p12));
    const U8 dark_bound = max(min(p0, p8), min(p4, p12));
    const U8 bound = max(excess(bright_bound, center), excess(center, dark_bound));
    if (!any(excess(bound, limit))) {
      store(score + x, U8{});
      continue;
    }
    U8 p[16];
    for (int i = 0; i < 16; ++i) p[i] = load<U8>(at + circle[i]);
    const U8 value = max(excess(best_arc<false>(p), center), excess(center, best_arc<true>(p)));
    store(score + x, value > limit ? value : U8{});
  }
}

/// Has no branches, because the positions of peaks are hard to predict.
void peaks_row(const uint8_t* above, const uint8_t* row, const uint8_t* below, int words,
               uint8_t floor, uint32_t* peaks, uint32_t* strong) {
  const U8 limit = splat(floor);
  for (int word = 0; word < words; ++word) {
    uint32_t found = 0, above_floor = 0;
    for (int bit = 0; bit < 32; bit += kBytes) {
      const int x = 32 * word + bit;
      const U8 center = load<U8>(row + x);
      U8 around = max(load<U8>(row + x - 1), load<U8>(row + x + 1));
      const uint8_t* const beside[2] = {above + x, below + x};
      for (const uint8_t* at : beside)
        around = max(around, max(max(load<U8>(at - 1), load<U8>(at + 1)), load<U8>(at)));
      found |= nonzero(excess(center, around)) << bit;
      above_floor |= nonzero(excess(center, max(around, limit))) << bit;
    }
    peaks[word] = found;
    strong[word] = above_floor;
  }
}

/// Gaussian weights, sigma 2 px, 7 taps, in 128ths: at distance 3, 2, 1, 0.
constexpr uint16_t kGauss3 = 9, kGauss2 = 17, kGauss1 = 24, kGauss0 = 28;

inline void blur_line(const uint8_t* in, ptrdiff_t step, int n, uint8_t* out) {
  for (int x = 0; x < n; x += kHalf) {
    const uint8_t* at = in + x;
    const U16 sum = (widen(at - 3 * step) + widen(at + 3 * step)) * kGauss3 +
                    (widen(at - 2 * step) + widen(at + 2 * step)) * kGauss2 +
                    (widen(at - step) + widen(at + step)) * kGauss1 + widen(at) * kGauss0;
    store_narrow(out + x, (sum + 64) >> 7);
  }
}

void blur(const uint8_t* in, ptrdiff_t stride, int n, int rows, uint8_t* scratch, uint8_t* out,
          ptrdiff_t out_stride) {
  for (int y = 0; y < rows; ++y, in += stride, out += out_stride) {
    blur_line(in - kBlurRadius, stride, n + 2 * kBlurRadius, scratch);
    blur_line(scratch + kBlurRadius, 1, n, out);
  }
}

/// Half width of the disc in row y: round(sqrt(15^2 - y^2)), made symmetric as in ORB.
constexpr int kDiscHalfWidth[kOrientationRadius + 1] = {15, 15, 15, 15, 14, 14, 14, 13,
                                                        13, 12, 11, 10, 9,  8,  6,  3};

void describe(const uint8_t* center, ptrdiff_t stride, const PatternPoints& pattern, float cosine,
              float sine, uint64_t* bits) {
  alignas(64) int32_t offset[512];
  const int32_t step = static_cast<int32_t>(stride);
  for (int i = 0; i < 512; i += kFloats) {
    const F32 x = load<F32>(pattern.x + i), y = load<F32>(pattern.y + i);
    const S32 column = nearest(x * cosine - y * sine), row = nearest(x * sine + y * cosine);
    store(offset + i, row * step + column);
  }
  // Gather all pixels first, eight per word, so that whole vectors can be compared.
  alignas(64) uint64_t a[32], b[32];
  for (int i = 0; i < 32; ++i) {
    const int32_t* at = offset + 16 * i;
    uint64_t pixels = 0, others = 0;
    for (int byte = 0; byte < 8; ++byte) {
      pixels |= static_cast<uint64_t>(center[at[2 * byte]]) << 8 * byte;
      others |= static_cast<uint64_t>(center[at[2 * byte + 1]]) << 8 * byte;
    }
    a[i] = pixels;
    b[i] = others;
  }
  for (int word = 0; word < 4; ++word) {
    uint64_t value = 0;
    for (int bit = 0; bit < 64; bit += kBytes) {
      const int at = 8 * word + bit / 8;
      const U8 darker = excess(load<U8>(b + at), load<U8>(a + at));
      value |= static_cast<uint64_t>(nonzero(darker)) << bit;
    }
    bits[word] = value;
  }
}

constexpr int kPatchSide = 2 * kPatchRadius + 1;
constexpr int kPatchLanes = 16;
constexpr int kPatchParts = kPatchLanes / kHalf;
struct PatchMask {
  alignas(64) int16_t column[kPatchLanes] = {};
  constexpr PatchMask() {
    for (int x = 0; x < kPatchSide; ++x) column[x] = -1;
  }
};
constexpr PatchMask kPatchMask;

inline S16 pixels(const uint8_t* from) { return reinterpret_cast<S16>(widen(from)); }

PatchSlide slide_patch(const uint8_t* left, ptrdiff_t left_stride, const uint8_t* right,
                       ptrdiff_t right_stride) {
  constexpr int kPlaces = 2 * kPatchSlide + 1;
  S16 patch[kPatchSide][kPatchParts], mask[kPatchParts];
  for (int part = 0; part < kPatchParts; ++part) {
    const int x = part * kHalf - kPatchRadius;
    mask[part] = load<S16>(kPatchMask.column + part * kHalf);
    for (int y = 0; y < kPatchSide; ++y)
      patch[y][part] = pixels(left + (y - kPatchRadius) * left_stride + x) - left[0];
  }
  S32 total[kPlaces], square[kPlaces];
  PatchSlide found;
  for (int place = 0; place < kPlaces; ++place) {
    const uint8_t* at = right + place - kPatchSlide;
    S16 absolute{}, signed_sum{};  // at most 22 * 510
    S32 square_sum{};
    for (int y = 0; y < kPatchSide; ++y)
      for (int part = 0; part < kPatchParts; ++part) {
        const int x = part * kHalf - kPatchRadius;
        const S16 other = pixels(at + (y - kPatchRadius) * right_stride + x) - at[0];
        const S16 difference = (patch[y][part] - other) & mask[part];
        absolute += difference > -difference ? difference : -difference;
        signed_sum += difference;
        square_sum += squares(difference);
      }
    total[place] = in_pairs(signed_sum);
    square[place] = square_sum;
    const int of_place = sum(in_pairs(absolute));
    if (place == 0 || of_place < found.absolute) {
      found.absolute = of_place;
      found.best = place;
    }
  }
  if (found.best == 0 || found.best == kPlaces - 1) return found;
  for (int i = 0; i < 3; ++i) {
    found.total[i] = sum(total[found.best + i - 1]);
    found.squares[i] = sum(square[found.best + i - 1]);
  }
  return found;
}
