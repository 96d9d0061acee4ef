// SPDX-License-Identifier: Apache-2.0
// Kernels that schur_kernels.hpp describes. Each schur_kernels_* file includes this inside its
// namespace, after kLanes and
//   V                                    vector of kLanes doubles
//   V root(V)                            square roots
//   void load_transposed(const double* const from[kLanes], V to[4])
//                                        to[i] = from[0][i], from[1][i] ...
//   void store_transposed(const V from[kColumnStride], double* to, ptrdiff_t stride)
//                                        kColumnStride numbers per lane, lanes stride apart

using std::ptrdiff_t;
using std::size_t;
using std::uint32_t;
using std::uint8_t;

/// Vectors in a column of six rows; the last one may reach into the padding.
constexpr int kParts = (6 + kLanes - 1) / kLanes;

inline V load(const double* from) {
  V v;
  __builtin_memcpy(&v, from, sizeof(V));
  return v;
}
inline void store(double* to, V v) { __builtin_memcpy(to, &v, sizeof(V)); }
/// Subtracts zero, which compilers can omit. Adding zero would turn -0 into 0.
inline V splat(double value) { return value - V{}; }

/// kLanes rows: the points in the camera frame and their errors, measured minus predicted.
struct Errors {
  V R[9], x, y, z;
  V inverse_z, u, v, right_u, weight, right_weight;
  V rho, factor;  ///< loss and its derivative by chi-square
};

inline Errors errors_of(const RowsView& view, size_t first) {
  Errors e;
  V pose[kPoseSize], point[kPointSize];
  const double* from[kLanes];
  for (int i = 0; i < kLanes; ++i) from[i] = view.poses + size_t{kPoseSize} * view.pose[first + i];
  for (int part = 0; part < kPoseSize; part += 4) {
    const double* at[kLanes];
    for (int i = 0; i < kLanes; ++i) at[i] = from[i] + part;
    load_transposed(at, pose + part);
  }
  for (int i = 0; i < 9; ++i) e.R[i] = pose[i];
  const V* t = pose + 9;
  for (int i = 0; i < kLanes; ++i)
    from[i] = view.points + size_t{kPointSize} * view.point[first + i];
  load_transposed(from, point);
  const V X = point[0], Y = point[1], Z = point[2];
  e.x = e.R[0] * X + e.R[3] * Y + e.R[6] * Z + t[0];
  e.y = e.R[1] * X + e.R[4] * Y + e.R[7] * Z + t[1];
  e.z = e.R[2] * X + e.R[5] * Y + e.R[8] * Z + t[2];

  e.weight = load(view.weight + first);
  e.right_weight = load(view.right_weight + first);
  e.inverse_z = 1 / e.z;
  const V predicted_u = view.fx * e.x * e.inverse_z + view.cx;
  e.u = load(view.u + first) - predicted_u;
  e.v = load(view.v + first) - (view.fy * e.y * e.inverse_z + view.cy);
  e.right_u = load(view.right_u + first) - (predicted_u - view.bf * e.inverse_z);
  const V chi2 = e.weight * (e.u * e.u + e.v * e.v) + e.right_weight * e.right_u * e.right_u;
  e.rho = chi2;
  e.factor = splat(1);
  if (view.robust) {
    const V limit = load(view.chi2_limit + first);
    const auto within = chi2 <= limit;
    const V linear = root(chi2 * limit);
    e.rho = within ? chi2 : 2 * linear - limit;
    e.factor = within ? e.factor : limit / linear;
  }
  return e;
}

void row_costs(const RowsView& view, size_t rows, double* cost, uint8_t* behind) {
  for (size_t first = 0; first < rows; first += kLanes) {
    const Errors e = errors_of(view, first);
    store(cost + first, e.rho);
    alignas(64) double z[kLanes];
    store(z, e.z);
    for (int i = 0; i < kLanes; ++i) behind[first + i] = !(z[i] > view.least_depth_m);
  }
}

/// What each row adds to the sums of its pose and its point.
struct RowTerms {
  alignas(64) double pose[kLanes][kPoseSumsSize];
  alignas(64) double point[kLanes][kPointSumsSize];
  alignas(64) double cross[kLanes][kCrossSize];
  alignas(64) double z[kLanes];
};

inline void terms_of(const RowsView& view, size_t first, RowTerms& terms) {
  const Errors e = errors_of(view, first);
  const V x = e.x, y = e.y, z = e.z;
  // A = J' w J and a = J' w e, where J is the derivative of the pixel by the point in camera frame.
  const V w = e.factor * e.weight, wr = e.factor * e.right_weight;
  const V fx = view.fx * e.inverse_z, fy = view.fy * e.inverse_z;
  const V ju = -fx * x * e.inverse_z, jv = -fy * y * e.inverse_z;
  const V jr = ju + view.bf * e.inverse_z * e.inverse_z;
  const V a00 = fx * fx * (w + wr), a02 = fx * (w * ju + wr * jr);
  const V a11 = fy * fy * w, a12 = fy * w * jv;
  const V a22 = w * (ju * ju + jv * jv) + wr * jr * jr;
  const V g0 = fx * (w * e.u + wr * e.right_u), g1 = fy * w * e.v;
  const V g2 = w * (ju * e.u + jv * e.v) + wr * jr * e.right_u;

  // Point: H += R' A R, g += R' a, with B = A R. The cross block is D' B with D = [I, -[p]x].
  V B[9], point[kPointSumsSize] = {};
  for (int c = 0; c < 3; ++c) {
    const V* r = e.R + 3 * c;
    V* b = B + 3 * c;
    b[0] = a00 * r[0] + a02 * r[2];
    b[1] = a11 * r[1] + a12 * r[2];
    b[2] = a02 * r[0] + a12 * r[1] + a22 * r[2];
    const V column[kColumnStride] = {
        b[0], b[1], b[2], y * b[2] - z * b[1], z * b[0] - x * b[2], x * b[1] - y * b[0]};
    store_transposed(column, terms.cross[0] + c * kColumnStride, kCrossSize);
  }
  int h = 0;
  for (int c = 0; c < 3; ++c) {
    const V* r = e.R + 3 * c;
    point[kPointGradient + c] = r[0] * g0 + r[1] * g1 + r[2] * g2;
    for (int d = c; d < 3; ++d, ++h)
      point[h] = r[0] * B[3 * d] + r[1] * B[3 * d + 1] + r[2] * B[3 * d + 2];
  }
  for (int i = 0; i < kPointSumsSize; i += kColumnStride)
    store_transposed(point + i, terms.point[0] + i, kPointSumsSize);

  // Pose: H += D' A D, g += D' a. M = -A [p]x.
  const V m00 = y * a02, m01 = z * a00 - x * a02, m02 = -y * a00;
  const V m10 = y * a12 - z * a11, m11 = -x * a12, m12 = x * a11;
  const V m20 = y * a22 - z * a12, m21 = z * a02 - x * a22, m22 = x * a12 - y * a02;
  const V pose[kPoseSumsSize] = {a00,
                                 V{},
                                 a02,
                                 m00,
                                 m01,
                                 m02,
                                 a11,
                                 a12,
                                 m10,
                                 m11,
                                 m12,
                                 a22,
                                 m20,
                                 m21,
                                 m22,
                                 y * m20 - z * m10,
                                 y * m21 - z * m11,
                                 y * m22 - z * m12,
                                 z * m01 - x * m21,
                                 z * m02 - x * m22,
                                 x * m12 - y * m02,
                                 g0,
                                 g1,
                                 g2,
                                 y * g2 - z * g1,
                                 z * g0 - x * g2,
                                 x * g1 - y * g0};
  for (int i = 0; i < kPoseSumsSize; i += kColumnStride)
    store_transposed(pose + i, terms.pose[0] + i, kPoseSumsSize);
  store(terms.z, z);
}

template <int kSize>
inline void add(double* sums, const double* terms) {
  for (int i = 0; i < kSize; i += kLanes) store(sums + i, load(sums + i) + load(terms + i));
}

void linearize(const RowsView& view, size_t rows, const NormalSums& sums) {
  RowTerms terms;
  for (size_t first = 0; first < rows; first += kLanes) {
    terms_of(view, first, terms);
    const size_t here = rows - first < kLanes ? rows - first : kLanes;
    for (size_t i = 0; i < here; ++i) {  // one row at a time, so kLanes does not matter
      const size_t k = first + i;
      const uint32_t pose = view.pose[k];
      const bool counts = sums.active[k] && terms.z[i] > view.least_depth_m;
      if (counts)
        add<kPointSumsSize>(sums.point_sums + size_t{kPointSumsSize} * view.point[k],
                            terms.point[i]);
      if (pose >= sums.free_poses) continue;
      const size_t slot = sums.slot[k];
      sums.coupled[slot] = counts;
      if (!counts) continue;
      __builtin_memcpy(sums.cross + kCrossSize * slot, terms.cross[i], sizeof terms.cross[i]);
      add<kPoseSumsSize>(sums.pose_sums + size_t{kPoseSumsSize} * pose, terms.pose[i]);
    }
  }
}

inline void load_cross(const double* from, V to[3][kParts]) {
  for (int c = 0; c < 3; ++c)
    for (int i = 0; i < kParts; ++i) to[c][i] = load(from + c * kColumnStride + i * kLanes);
}

/// Computes Y = W V^-1 of each row of the pose and right -= W V^-1 g.
inline void prepare_column(const ColumnElimination& column) {
  V right[kParts];
  for (int i = 0; i < kParts; ++i) right[i] = load(column.right + i * kLanes);
  for (size_t row = 0; row < column.rows; ++row) {
    const size_t slot = column.first_slot + row, point = column.point[slot];
    column.taking_part[row] = column.coupled[slot] && column.invertible[point];
    if (!column.taking_part[row]) continue;
    const double* I = column.inverse + kPointSumsSize * point;
    const double* step = I + kPointGradient;
    double* y = column.scratch + kCrossSize * row;
    V W[3][kParts];
    load_cross(column.cross + kCrossSize * slot, W);
    for (int i = 0; i < kParts; ++i) {
      const V w0 = W[0][i], w1 = W[1][i], w2 = W[2][i];
      store(y + i * kLanes, w0 * I[0] + w1 * I[1] + w2 * I[2]);
      store(y + kColumnStride + i * kLanes, w0 * I[1] + w1 * I[3] + w2 * I[4]);
      store(y + 2 * kColumnStride + i * kLanes, w0 * I[2] + w1 * I[4] + w2 * I[5]);
      right[i] -= w0 * step[0] + w1 * step[1] + w2 * step[2];
    }
  }
  for (int i = 0; i < kParts; ++i) store(column.right + i * kLanes, right[i]);
}

/// kColumns columns of a block.
template <int kColumns>
struct BlockColumns {
  V of[kColumns][kParts];
  /// Subtracts a * b' for 6 x 3 blocks a and b; b starts at the row of the first column here.
  inline void subtract_product(const double* a, const double* b) {
    V A[3][kParts];
    load_cross(a, A);
    for (int j = 0; j < kColumns; ++j) {
      const V b0 = splat(b[j]), b1 = splat(b[kColumnStride + j]);
      const V b2 = splat(b[2 * kColumnStride + j]);
      for (int i = 0; i < kParts; ++i) of[j][i] -= A[0][i] * b0 + A[1][i] * b1 + A[2][i] * b2;
    }
  }
};

/// The number of columns that fit into the registers.
constexpr int kColumnsAtOnce = kParts == 1 ? 6 : kParts == 2 ? 3 : 2;

void eliminate(const ColumnElimination& column) {
  prepare_column(column);
  for (size_t number = 0; number < column.block_count; ++number) {
    const SlotPair* begin = column.pairs + column.pair_begin[number];
    const SlotPair* end = column.pairs + column.pair_begin[number + 1];
    if (begin == end) continue;
    for (int first = 0; first < 6; first += kColumnsAtOnce) {
      double* out = column.blocks + kPoseBlockSize * number + first * kColumnStride;
      BlockColumns<kColumnsAtOnce> block;
      for (int j = 0; j < kColumnsAtOnce; ++j)
        for (int i = 0; i < kParts; ++i)
          block.of[j][i] = load(out + j * kColumnStride + i * kLanes);
      for (const SlotPair* pair = begin; pair != end; ++pair) {
        const size_t row = pair->first - column.first_slot;
        if (!column.taking_part[row] || !column.coupled[pair->second]) continue;
        const double* y = column.scratch + kCrossSize * row;
        const double* w = column.cross + kCrossSize * pair->second;
        block.subtract_product(w, y + first);
        // When a pose sees the point twice, the mirrored term belongs to the same block.
        if (number == 0 && pair->first != pair->second) block.subtract_product(y, w + first);
      }
      for (int j = 0; j < kColumnsAtOnce; ++j)
        for (int i = 0; i < kParts; ++i)
          store(out + j * kColumnStride + i * kLanes, block.of[j][i]);
    }
  }
}

/// Subtracts the contribution of the columns before `first` from kRows vectors of rows of a panel.
/// left: elements of those columns in the panel's diagonal rows, kFactorColumns per column.
template <int kRows>
inline void update_rows(double* matrix, size_t stride, size_t first, size_t row,
                        const double* left) {
  V sums[kFactorColumns][kRows];
  for (int c = 0; c < kFactorColumns; ++c)
    for (int i = 0; i < kRows; ++i)
      sums[c][i] = load(matrix + (first + c) * stride + row + i * kLanes);
  for (size_t k = 0; k < first; ++k, left += kFactorColumns) {
    V column[kRows];
    for (int i = 0; i < kRows; ++i) column[i] = load(matrix + k * stride + row + i * kLanes);
    for (int c = 0; c < kFactorColumns; ++c) {
      const V factor = splat(left[c]);
      for (int i = 0; i < kRows; ++i) sums[c][i] -= column[i] * factor;
    }
  }
  for (int c = 0; c < kFactorColumns; ++c)
    for (int i = 0; i < kRows; ++i)
      store(matrix + (first + c) * stride + row + i * kLanes, sums[c][i]);
}

bool factorize(double* matrix, size_t size, size_t stride, double* scratch) {
  constexpr int kRows = 2;
  for (size_t first = 0; first < size; first += kFactorColumns) {
    for (size_t k = 0; k < first; ++k)
      for (int c = 0; c < kFactorColumns; ++c)
        scratch[k * kFactorColumns + c] = matrix[k * stride + first + c];
    const size_t top = first / kLanes * kLanes;  // rows above the panel are never read again
    size_t row = top;
    for (; row + kRows * kLanes <= stride; row += kRows * kLanes)
      update_rows<kRows>(matrix, stride, first, row, scratch);
    for (; row < stride; row += kLanes) update_rows<1>(matrix, stride, first, row, scratch);
    for (int c = 0; c < kFactorColumns; ++c) {
      double* column = matrix + (first + c) * stride;
      const double diagonal = column[first + c];
      if (!(diagonal > 0)) return false;
      const double root_of = __builtin_sqrt(diagonal);
      for (row = top; row < stride; row += kLanes)
        store(column + row, load(column + row) / root_of);
      for (int later = c + 1; later < kFactorColumns; ++later) {
        double* target = matrix + (first + later) * stride;
        const V factor = splat(column[first + later]);
        for (row = top; row < stride; row += kLanes)
          store(target + row, load(target + row) - load(column + row) * factor);
      }
    }
  }
  return true;
}

constexpr auto named(const char* name) {
  return SchurKernels{name, linearize, row_costs, eliminate, factorize};
}
