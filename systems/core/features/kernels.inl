// SPDX-License-Identifier: Apache-2.0
// The kernels; see kernels.hpp for what each one computes. Included by each kernels_* file inside its
// namespace, after vectors.inl and the operations that depend on the instruction set:
//   bool any(U8)                    is any byte not 0?
//   U16 widen(const uint8_t*)       half a vector of bytes as 16-bit numbers
//   void store_narrow(uint8_t*, U16)  the reverse; the numbers are below 256

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

/// The brightest level that nine neighbouring circle pixels reach together (kDarkest = false), or
/// the darkest (true), over all 16 arcs. An arc of nine is eight pixels k+1..k+8 with one more at either
/// end, so pairs of arcs share their eight.
template <bool kDarkest>
inline U8 best_arc(const U8 p[16]) {
  U8 two[8], four[8];
  for (int i = 0; i < 8; ++i) two[i] = inner<kDarkest>(p[2 * i + 1], p[(2 * i + 2) & 15]);
  for (int i = 0; i < 8; ++i) four[i] = inner<kDarkest>(two[i], two[(i + 1) & 7]);
  U8 best = splat(kDarkest ? 255 : 0);
  for (int i = 0; i < 8; ++i) {
    const U8 eight = inner<kDarkest>(four[i], four[(i + 2) & 7]);
    best = outer<kDarkest>(best, inner<kDarkest>(eight, outer<kDarkest>(p[2 * i], p[(2 * i + 9) & 15])));
  }
  return best;
}

void fast_row(const uint8_t* in, ptrdiff_t stride, int n, uint8_t threshold, uint8_t* score) {
  const ptrdiff_t circle[16] = {3 * stride,      3 * stride + 1,  2 * stride + 2,  stride + 3,
                                3,               -stride + 3,     -2 * stride + 2, -3 * stride + 1,
                                -3 * stride,     -3 * stride - 1, -2 * stride - 2, -stride - 3,
                                -3,              stride - 3,      2 * stride - 2,  3 * stride - 1};
  const U8 limit = splat(threshold);
  for (int x = 0; x < n; x += kBytes) {
    const uint8_t* at = in + x;
    const U8 centre = load<U8>(at);
    // Nine in a row hold one of each two opposite pixels, so they cannot beat these bounds.
    const U8 p0 = load<U8>(at + circle[0]), p4 = load<U8>(at + circle[4]);
    const U8 p8 = load<U8>(at + circle[8]), p12 = load<U8>(at + circle[12]);
    const U8 bright_bound = min(max(p0, p8), max(p4, p12));
    const U8 dark_bound = max(min(p0, p8), min(p4, p12));
    const U8 bound = max(excess(bright_bound, centre), excess(centre, dark_bound));
    if (!any(excess(bound, limit))) {
      store(score + x, U8{});
      continue;
    }
    U8 p[16];
    for (int i = 0; i < 16; ++i) p[i] = load<U8>(at + circle[i]);
    const U8 value =
        max(excess(best_arc<false>(p), centre), excess(centre, best_arc<true>(p)));
    store(score + x, value > limit ? value : U8{});
  }
}

int peaks_row(const uint8_t* above, const uint8_t* row, const uint8_t* below, int n,
              uint16_t* columns) {
  int count = 0;
  for (int x = 0; x < n; x += kBytes) {
    const U8 centre = load<U8>(row + x);
    if (!any(centre)) continue;
    const U8 beside = max(load<U8>(row + x - 1), load<U8>(row + x + 1));
    const U8 over = max(max(load<U8>(above + x - 1), load<U8>(above + x + 1)), load<U8>(above + x));
    const U8 under =
        max(max(load<U8>(below + x - 1), load<U8>(below + x + 1)), load<U8>(below + x));
    const U64 peaks = reinterpret_cast<U64>(excess(centre, max(beside, max(over, under))));
    for (int word = 0; word < kBytes / 8; ++word) {
      for (uint64_t rest = peaks[word]; rest != 0;) {
        const int byte = __builtin_ctzll(rest) / 8;
        rest &= ~(uint64_t{0xff} << (8 * byte));
        const int column = x + 8 * word + byte;
        if (column < n) columns[count++] = static_cast<uint16_t>(column);
      }
    }
  }
  return count;
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

void blur_row(const uint8_t* in, ptrdiff_t stride, int n, uint8_t* scratch, uint8_t* out) {
  blur_line(in - kBlurRadius, stride, n + 2 * kBlurRadius, scratch);
  blur_line(scratch + kBlurRadius, 1, n, out);
}

/// Widest column of the disc in each row: round(sqrt(15^2 - y^2)), as ORB's symmetric quarter circle.
constexpr int kDiscHalfWidth[kOrientationRadius + 1] = {15, 15, 15, 15, 14, 14, 14, 13,
                                                        13, 12, 11, 10, 9,  8,  6,  3};

constexpr int kDiscColumns = 32;
struct DiscMask {
  alignas(64) uint16_t row[kOrientationRadius + 1][kDiscColumns] = {};
  constexpr DiscMask() {
    for (int y = 0; y <= kOrientationRadius; ++y)
      for (int x = -kDiscHalfWidth[y]; x <= kDiscHalfWidth[y]; ++x)
        row[y][x + kOrientationRadius] = 0xffff;
  }
};
constexpr DiscMask kDiscMask;

Moments moments(const uint8_t* centre, ptrdiff_t stride) {
  // Column sums of the disc, plain and times y: at most 31 * 255 and 120 * 255, both within 16 bits.
  constexpr int kColumns = kDiscColumns, kParts = kColumns / kHalf;
  const uint8_t* left = centre - kOrientationRadius;
  alignas(64) int16_t sum[kColumns], turned[kColumns];
  for (int part = 0; part < kParts; ++part) {
    const int x = part * kHalf;
    U16 total = widen(left + x), weighted{};
    for (uint16_t y = 1; y <= kOrientationRadius; ++y) {
      const U16 keep = load<U16>(kDiscMask.row[y] + x);
      const U16 down = widen(left + y * stride + x) & keep;
      const U16 up = widen(left - y * stride + x) & keep;
      total += down + up;
      weighted += (down - up) * y;
    }
    store(sum + x, total & load<U16>(kDiscMask.row[0] + x));
    store(turned + x, weighted);
  }
  Moments m;
  for (int x = 0; x < kColumns; ++x) {
    m.m10 += (x - kOrientationRadius) * sum[x];
    m.m01 += turned[x];
  }
  return m;
}

void describe(const uint8_t* centre, ptrdiff_t stride, const PatternPoints& pattern, float cosine,
              float sine, uint64_t* bits) {
  // Adding 1.5 * 2^23 leaves the nearest integer in the low bits of a float.
  constexpr float kRound = 12582912.0f;
  constexpr int32_t kRoundBits = 0x4b400000;
  alignas(64) int32_t offset[512];
  const int32_t step = static_cast<int32_t>(stride);
  for (int i = 0; i < 512; i += kFloats) {
    const F32 x = load<F32>(pattern.x + i), y = load<F32>(pattern.y + i);
    const S32 column = reinterpret_cast<S32>(x * cosine - y * sine + kRound) - kRoundBits;
    const S32 row = reinterpret_cast<S32>(x * sine + y * cosine + kRound) - kRoundBits;
    store(offset + i, row * step + column);
  }
  for (int word = 0; word < 4; ++word) {
    const int32_t* a = offset + 64 * word;
    const int32_t* b = a + 256;
    uint64_t value = 0;
    for (int i = 63; i >= 0; --i) value = value + value + (centre[a[i]] < centre[b[i]]);
    bits[word] = value;
  }
}
