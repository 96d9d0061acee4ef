// SPDX-License-Identifier: Apache-2.0
#include "wire/byte_io.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "wire/id_codec.hpp"

namespace slambed::wire {
namespace {

TEST(ByteIo, ValuesComeBack) {
  ByteWriter out;
  out.u8(200);
  out.u16(65535);
  out.u32(0xdeadbeef);
  out.i64(-3);
  out.f32(1.5f);
  out.f64(-2.25);
  out.text("abc");
  for (const std::uint64_t v : {0ull, 127ull, 128ull, 1ull << 40, ~0ull}) out.varint(v);
  for (const std::int64_t v : {0ll, -1ll, 1ll, -(1ll << 62)}) out.zigzag(v);
  const Bytes bytes = out.take();
  ByteReader in(bytes);
  EXPECT_EQ(in.u8(), 200);
  EXPECT_EQ(in.u16(), 65535);
  EXPECT_EQ(in.u32(), 0xdeadbeef);
  EXPECT_EQ(in.i64(), -3);
  EXPECT_EQ(in.f32(), 1.5f);
  EXPECT_EQ(in.f64(), -2.25);
  EXPECT_EQ(in.text(3), "abc");
  for (const std::uint64_t v : {0ull, 127ull, 128ull, 1ull << 40, ~0ull}) EXPECT_EQ(in.varint(), v);
  for (const std::int64_t v : {0ll, -1ll, 1ll, -(1ll << 62)}) EXPECT_EQ(in.zigzag(), v);
  EXPECT_NO_THROW(in.expect_end());
  EXPECT_THROW(in.u8(), DecodeError);
}

TEST(ByteIo, RefusesWhatIsNoValue) {
  const auto reader = [](const Bytes& bytes, auto read) {
    ByteReader in(bytes);
    EXPECT_THROW(read(in), DecodeError);
  };
  reader({1, 2, 3}, [](ByteReader& in) { in.u32(); });
  reader(Bytes(11, 0xff), [](ByteReader& in) { in.varint(); });
  reader(Bytes{0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 2},
         [](ByteReader& in) { in.varint(); });
  reader({0x80, 0x80, 0x80, 0x80, 0x10}, [](ByteReader& in) { in.varint32(); });
  reader({2}, [](ByteReader& in) { in.flag(); });
  reader({5, 'a', 'b', 'c', 'd', 'e'}, [](ByteReader& in) { in.text(4); });
  reader({4, 0, 0, 0}, [](ByteReader& in) { in.count(1); });
  reader({0, 0}, [](ByteReader& in) {
    in.u8();
    in.expect_end();
  });
  ByteWriter out;
  out.f32(std::numeric_limits<float>::infinity());
  reader(out.take(), [](ByteReader& in) { in.f32(); });
  ByteWriter nan;
  nan.f64(std::numeric_limits<double>::quiet_NaN());
  reader(nan.take(), [](ByteReader& in) { in.f64(); });
}

TEST(IdStream, IdsOfAllSpacesAndNoneComeBackShort) {
  const std::vector<MapPointId> ids = {
      {1ull << 56 | 5}, {1ull << 56 | 6}, {},
      {2ull << 56 | 1}, {1ull << 56 | 4}, {2ull << 56 | (kMaxIdIndex - 1)},
      {3ull << 56 | 1}};
  ByteWriter out;
  IdStream writer, reader;
  for (const auto id : ids) writer.put(out, id);
  EXPECT_LE(out.size(), 5u + 2 * 5);
  const Bytes bytes = out.take();
  ByteReader in(bytes);
  for (const auto id : ids) EXPECT_EQ(reader.get_or_none<MapPointId>(in), id);
}

TEST(IdStream, IdsOutOfRangeAreRefused) {
  ByteWriter out;
  EXPECT_THROW(IdStream().put(out, MapPointId{1ull << 56 | kMaxIdIndex}), Error);
  EXPECT_THROW(IdStream().put(out, MapPointId{4ull << 56 | 1}), Error);
  EXPECT_THROW(IdStream().put(out, MapPointId{7}), Error);
  const auto refuse = [](std::uint64_t code) {
    ByteWriter raw;
    raw.varint(code);
    const Bytes bytes = raw.take();
    ByteReader in(bytes);
    EXPECT_THROW(IdStream().get_or_none<MapPointId>(in), DecodeError) << code;
  };
  refuse((kMaxIdIndex * 2) << 2 | 1);  // index 2^26
  refuse(~0ull);
  refuse(3 << 2 | 1);  // a negative index
  refuse(2 << 2);      // space 0
  ByteWriter none;
  none.varint(0);
  const Bytes bytes = none.take();
  ByteReader in(bytes);
  EXPECT_THROW(IdStream().get<MapPointId>(in), DecodeError);
}

}  // namespace
}  // namespace slambed::wire
