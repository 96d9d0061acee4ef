// SPDX-License-Identifier: Apache-2.0
// Map files: a map survives the round trip, and damaged files are refused.
#include "store/map_file.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include <fstream>
#include <random>

#include "base/error.hpp"
#include "map/map_snapshot.hpp"
#include "stored_scene.hpp"
#include "wire/delta_codec.hpp"

namespace slambed::testing {
namespace {

/// Precision that the codec may lose: positions to 32 bits, pixels and depth a little.
constexpr double kPositionTolerance_m = 1e-5, kPixelTolerance = 0.01;

void expect_same(const MapView& a, const MapView& b) {
  EXPECT_EQ(a.origin(), b.origin());
  EXPECT_EQ(a.epoch(), b.epoch());
  ASSERT_EQ(a.keyframe_ids(), b.keyframe_ids());
  ASSERT_EQ(a.point_ids(), b.point_ids());
  for (const KeyFrameId id : a.keyframe_ids()) {
    const KeyFrame &x = *a.keyframe(id), &y = *b.keyframe(id);
    EXPECT_EQ(x.points, y.points);
    EXPECT_EQ(x.parent, y.parent);
    EXPECT_EQ(x.children, y.children);
    EXPECT_EQ(x.version, y.version);
    EXPECT_EQ(x.frame_index, y.frame_index);
    EXPECT_EQ(x.timestamp_s, y.timestamp_s);
    EXPECT_LT((x.T_cw.R - y.T_cw.R).norm() + (x.T_cw.t - y.T_cw.t).norm(), 1e-12);
    ASSERT_EQ(x.covisibles.size(), y.covisibles.size());
    for (std::size_t i = 0; i < x.covisibles.size(); ++i) {
      EXPECT_EQ(x.covisibles[i].id, y.covisibles[i].id);
      EXPECT_EQ(x.covisibles[i].weight, y.covisibles[i].weight);
    }
    ASSERT_EQ(x.features->size(), y.features->size());
    for (int i = 0; i < x.features->size(); ++i) {
      EXPECT_NEAR(x.features->keypoint(i).u, y.features->keypoint(i).u, kPixelTolerance);
      EXPECT_EQ(x.features->descriptor(i), y.features->descriptor(i));
    }
  }
  for (const MapPointId id : a.point_ids()) {
    const MapPoint &x = *a.point(id), &y = *b.point(id);
    EXPECT_LT((x.p_w - y.p_w).norm(), kPositionTolerance_m);
    EXPECT_EQ(x.appearance.descriptor, y.appearance.descriptor);
    EXPECT_EQ(x.reference, y.reference);
    EXPECT_EQ(x.weight, y.weight);
    EXPECT_EQ(x.visible, y.visible);
    EXPECT_EQ(x.found, y.found);
  }
}

class MapFile : public StoredScene {
 protected:
  wire::Bytes with_right_checksum(wire::Bytes bytes) const {
    const auto crc = static_cast<std::uint32_t>(::crc32_z(0, bytes.data() + 20, bytes.size() - 20));
    for (int i = 0; i < 4; ++i) bytes[16 + i] = static_cast<std::uint8_t>(crc >> (8 * i));
    return bytes;
  }
};

TEST_F(MapFile, TheSameMapComesBack) {
  make_map(90);
  save_map(*map, info, folder / "m.slm");
  const StoredMap loaded = load_map(folder / "m.slm");
  EXPECT_EQ(loaded.info.sequence, "walk");
  EXPECT_EQ(loaded.info.time_origin_s, 1000.5);
  EXPECT_EQ(loaded.info.sensor.camera.fx, 500);
  map->read([&](const MapView& a) {
    EXPECT_GT(a.keyframe_count(), 3u);
    loaded.map->read([&](const MapView& b) {
      expect_same(a, b);
      return 0;
    });
    return 0;
  });
  EXPECT_FALSE(std::filesystem::exists(folder / "m.slm.part"));
}

TEST_F(MapFile, SavingWhatWasLoadedLosesNothingMore) {
  make_map(40);
  const StoredMap once = decode_map(encode_map(*map, info), "memory");
  const StoredMap twice = decode_map(encode_map(*once.map, once.info), "memory");
  once.map->read([&](const MapView& a) {
    twice.map->read([&](const MapView& b) {
      expect_same(a, b);
      return 0;
    });
    return 0;
  });
}

TEST_F(MapFile, AnEmptyMapIsAMapToo) {
  const StoredMap loaded = decode_map(encode_map(*map, info), "memory");
  loaded.map->read([](const MapView& view) {
    EXPECT_EQ(view.keyframe_count(), 0u);
    return 0;
  });
}

TEST_F(MapFile, ATrackerFindsItselfInALoadedMapAndGoesOnWithFreshIds) {
  make_map(90);
  const StoredMap loaded = decode_map(encode_map(*map, info), "memory");
  const auto newest = loaded.map->read([](const MapView& view) {
    return std::pair(view.keyframe_ids().back(), view.point_ids().back());
  });
  Tracker tracker({}, std::make_shared<Map>(), IdSpace::kTracker);
  tracker.replace_map(loaded.map);
  for (int i = 40; i < 60; ++i) {
    const TrackOutcome outcome = tracker.track(i, i / 30.0, scene.look(walk(i)));
    ASSERT_EQ(outcome.state, TrackingState::kOk) << i;
    EXPECT_LT(center_error(outcome.T_cw, walk(i) * walk(0).inverse()), 0.02);
  }
  const MapDelta made = tracker.create_keyframe();
  ASSERT_EQ(made.keyframes.size(), 1u);
  EXPECT_GT(made.keyframes[0].id, newest.first);
  for (const NewPoint& point : made.points) {
    loaded.map->read([&](const MapView& view) {
      EXPECT_EQ(view.point(point.id)->first_keyframe, made.keyframes[0].id);
      return 0;
    });
  }
}

TEST_F(MapFile, EveryFlippedByteAndEveryCutIsNoticed) {
  make_map(8, 60);
  const wire::Bytes good = encode_map(*map, info);
  ASSERT_NO_THROW(decode_map(good, "good"));
  for (std::size_t i = 0; i < good.size(); ++i) {
    wire::Bytes bad = good;
    bad[i] ^= 0x41;
    EXPECT_THROW(decode_map(bad, "bad"), Error) << i;
  }
  for (std::size_t n = 0; n < good.size(); n += 1 + n / 50)
    EXPECT_THROW(decode_map(std::span(good).first(n), "cut"), Error) << n;
  wire::Bytes longer = good;
  longer.push_back(0);
  EXPECT_THROW(decode_map(longer, "longer"), Error);
}

TEST_F(MapFile, DamageUnderARightChecksumIsRefusedOrHarmless) {
  make_map(8, 60);
  const wire::Bytes good = encode_map(*map, info);
  std::mt19937 random(5);
  int refused = 0;
  constexpr int kTries = 4000;
  for (int i = 0; i < kTries; ++i) {
    wire::Bytes bad = good;
    for (std::uint32_t n = 1 + random() % 4; n > 0; --n)
      bad[20 + random() % (bad.size() - 20)] = static_cast<std::uint8_t>(random());
    try {
      // A file that is accepted must give a usable map.
      const StoredMap loaded = decode_map(with_right_checksum(bad), "bad");
      loaded.map->read([](const MapView& view) { return snapshot(view).points.size(); });
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput);
      ++refused;
    }
  }
  EXPECT_GT(refused, kTries / 20);
}

TEST_F(MapFile, InconsistentMapsAreRefused) {
  make_map(8, 60);
  // A map cannot hold such content, so the file is made by hand.
  wire::ByteWriter body;
  wire::put_sensor(body, info.sensor);
  body.text(info.sequence);
  body.f64(0);
  MapDelta delta = map->read([](const MapView& view) { return snapshot(view); });
  delta.points.pop_back();
  wire::put_delta(body, delta);
  const wire::Bytes payload = body.take();
  wire::Bytes file = encode_map(Map(), info);
  file.resize(20);
  for (int i = 0; i < 8; ++i) file[8 + i] = static_cast<std::uint8_t>(payload.size() >> (8 * i));
  file.insert(file.end(), payload.begin(), payload.end());
  try {
    decode_map(with_right_checksum(file), "spoiled");
    FAIL() << "a keyframe sees a point that is not there";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("a point is missing"), std::string::npos);
  }
}

TEST_F(MapFile, MissingAndForeignFilesAreNamed) {
  EXPECT_THROW(load_map(folder / "absent.slm"), Error);
  std::ofstream(folder / "text.slm") << "this is not a map, but it is long enough";
  try {
    load_map(folder / "text.slm");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("text.slm"), std::string::npos);
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
  }
  EXPECT_THROW(save_map(*map, info, folder / "no_such_folder" / "m.slm"), Error);
}

}  // namespace
}  // namespace slambed::testing
