// SPDX-License-Identifier: Apache-2.0
// Vectors of kBytes bytes and the operations that need no special instructions. Each kernels_* file
// includes this inside its namespace, after kBytes.

using std::int16_t;
using std::int32_t;
using std::ptrdiff_t;
using std::uint16_t;
using std::uint32_t;
using std::uint64_t;
using std::uint8_t;

constexpr int kHalf = kBytes / 2;
constexpr int kFloats = kBytes / 4;

typedef uint8_t U8 __attribute__((vector_size(kBytes)));
typedef uint16_t U16 __attribute__((vector_size(kBytes)));
typedef int16_t S16 __attribute__((vector_size(kBytes)));
typedef uint32_t U32 __attribute__((vector_size(kBytes)));
typedef uint64_t U64 __attribute__((vector_size(kBytes)));
typedef uint8_t HalfU8 __attribute__((vector_size(kHalf)));
typedef float F32 __attribute__((vector_size(kBytes)));
typedef int32_t S32 __attribute__((vector_size(kBytes)));

template <typename V>
inline V load(const void* from) {
  V v;
  __builtin_memcpy(&v, from, sizeof(V));
  return v;
}
template <typename V>
inline void store(void* to, V v) {
  __builtin_memcpy(to, &v, sizeof(V));
}
inline U8 min(U8 a, U8 b) { return a < b ? a : b; }
inline U8 max(U8 a, U8 b) { return a > b ? a : b; }
inline U8 splat(uint8_t value) { return U8{} + value; }
