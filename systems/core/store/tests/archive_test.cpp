// SPDX-License-Identifier: Apache-2.0
// The map of an earlier trip together with a new trip whose ids start at one again.
#include "store/archive.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "stored_scene.hpp"

namespace slambed::testing {
namespace {

class ArchiveTest : public StoredScene {};

TEST_F(ArchiveTest, IsTheSameMapUnderOtherIds) {
  make_map(120);
  const auto archived = archive(*map);
  map->read([&](const MapView& old) {
    return archived->read([&](const MapView& fresh) {
      const auto before = old.keyframe_ids(), after = fresh.keyframe_ids();
      EXPECT_GT(before.size(), 3u);
      EXPECT_EQ(before.size(), after.size());
      EXPECT_EQ(old.point_count(), fresh.point_count());
      for (std::size_t i = 0; i < std::min(before.size(), after.size()); ++i) {
        const KeyFrame &a = *old.keyframe(before[i]), &b = *fresh.keyframe(after[i]);
        EXPECT_EQ(a.T_cw.t, b.T_cw.t);
        EXPECT_EQ(a.features, b.features);
        EXPECT_EQ(a.covisibles.size(), b.covisibles.size());
        EXPECT_EQ(static_cast<bool>(a.parent), static_cast<bool>(b.parent));
        EXPECT_EQ(a.points.size(), b.points.size());
        for (std::size_t f = 0; f < a.points.size(); ++f) {
          EXPECT_EQ(static_cast<bool>(a.points[f]), static_cast<bool>(b.points[f]));
          if (!a.points[f] || !b.points[f]) continue;
          EXPECT_EQ(old.point(a.points[f])->p_w, fresh.point(b.points[f])->p_w);
          EXPECT_EQ(old.point(a.points[f])->weight, fresh.point(b.points[f])->weight);
        }
      }
      return 0;
    });
  });
}

TEST_F(ArchiveTest, TakesTheKeyFramesOfANewTrip) {
  make_map(90);
  const auto trip = std::make_shared<Map>();
  Tracker tracker({}, trip, IdSpace::kTracker);
  tracker.track(0, 0, scene.look(walk(5)));
  const MapDelta first = tracker.create_keyframe();
  ASSERT_EQ(first.keyframes.size(), 1u);
  const auto known = [](const Map& where, KeyFrameId id) {
    return where.read([&](const MapView& view) { return view.keyframe(id) != nullptr; });
  };
  ASSERT_TRUE(known(*map, first.keyframes[0].id)) << "the stored map has the trip's first id";

  const auto archived = archive(*map);
  const auto count = [&] {
    return archived->read([](const MapView& view) { return view.keyframe_count(); });
  };
  const std::size_t before = count();
  ASSERT_FALSE(known(*archived, first.keyframes[0].id));
  archived->commit(first);
  EXPECT_EQ(count(), before + 1);
  EXPECT_TRUE(known(*archived, first.keyframes[0].id));

  // A mapper on the archive does not reuse its ids.
  LocalMapper mapper({}, archived, IdSpace::kEdgeMapper);
  const auto ids = archived->read([](const MapView& view) { return view.point_ids(); });
  mapper.insert(archived->read([](const MapView& view) { return view.keyframe_ids().back(); }));
  for (const NewPoint& point : mapper.triangulate().points)
    EXPECT_FALSE(std::binary_search(ids.begin(), ids.end(), point.id));
}

TEST_F(ArchiveTest, MayBeStoredAndArchivedAgain) {
  make_map(60);
  save_map(*archive(*map), info, folder / "archive.slm");
  const StoredMap loaded = load_map(folder / "archive.slm");
  const auto again = archive(*loaded.map);
  EXPECT_EQ(loaded.map->read([](const MapView& view) { return view.keyframe_ids(); }),
            again->read([](const MapView& view) { return view.keyframe_ids(); }));
}

}  // namespace
}  // namespace slambed::testing
