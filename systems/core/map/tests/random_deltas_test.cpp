// SPDX-License-Identifier: Apache-2.0
// Random sequences of deltas: derived state equals a recount from scratch, a repeated delta changes
// nothing, and the same sequence always gives the same map.
#include <gtest/gtest.h>

#include <set>

#include "map_fixture.hpp"

namespace slambed::testing {
namespace {

constexpr int kFeatures = 60;

class DeltaMaker {
 public:
  explicit DeltaMaker(unsigned seed) : random_(seed) {}

  MapDelta next() {
    MapDelta delta;
    if (chance(60)) add_keyframe(delta);
    for (int i = pick(12); i > 0; --i) delta.attach.push_back(observation());
    for (int i = pick(12); i > 0; --i) delta.detach.push_back(observation());
    for (int i = pick(4); i > 0; --i) delta.fusions.push_back({some_point(), some_point()});
    for (int i = pick(6); i > 0; --i)
      delta.positions.push_back({some_point(), {real(), real(), 2 + real()}, version()});
    for (int i = pick(3); i > 0; --i)
      delta.poses.push_back(
          {some_keyframe(), SE3(Eigen::Matrix3d::Identity(), {real(), real(), 0}), version()});
    for (int i = pick(3); i > 0; --i)
      delta.observation_counts.push_back({some_point(), version(), 1});
    if (chance(20)) delta.culled_points.push_back(some_point());
    if (chance(15)) delta.culled_keyframes.push_back(some_keyframe());
    return delta;
  }

 private:
  int pick(int n) { return static_cast<int>(random_() % n); }
  bool chance(int percent) { return pick(100) < percent; }
  double real() { return 0.01 * pick(100); }
  std::uint32_t version() { return static_cast<std::uint32_t>(pick(6)); }
  MapPointId some_point() { return pt(1 + random_() % (points_ + 2)); }
  KeyFrameId some_keyframe() { return kf(1 + random_() % (keyframes_ + 1)); }
  ObservationEdit observation() {
    return {some_keyframe(), static_cast<std::uint16_t>(pick(kFeatures)), some_point()};
  }

  void add_keyframe(MapDelta& delta) {
    std::vector<std::uint64_t> seen(kFeatures);
    for (auto& number : seen) {
      if (chance(40)) {
        delta.points.push_back(new_point(++points_, {real(), real(), 2 + real()}));
        delta.points.back().first_keyframe = delta.points.back().reference = kf(keyframes_ + 1);
        number = points_;
      } else if (points_ > 0 && chance(70)) {
        number = 1 + (points_ - 1 - random_() % std::min<std::uint64_t>(points_, 120));
      }
    }
    // A keyframe observes a point at most once.
    std::vector<std::uint64_t> sorted;
    for (auto& number : seen) {
      if (number && std::find(sorted.begin(), sorted.end(), number) != sorted.end()) number = 0;
      sorted.push_back(number);
    }
    delta.keyframes.push_back(new_keyframe(++keyframes_, seen));
    if (chance(30)) delta.keyframes.back().parent = some_keyframe();
    delta.keyframes.back().observes_known = keyframes_ % 3 != 0;
  }

  std::mt19937_64 random_;
  std::uint64_t points_ = 0, keyframes_ = 0;
};

void check_observations(const MapView& view) {
  std::size_t from_keyframes = 0, from_points = 0;
  for (const KeyFrameId id : view.keyframe_ids()) {
    const KeyFrame& keyframe = *view.keyframe(id);
    for (std::size_t i = 0; i < keyframe.points.size(); ++i) {
      if (!keyframe.points[i]) continue;
      ++from_keyframes;
      const MapPoint* point = view.point(keyframe.points[i]);
      ASSERT_NE(point, nullptr);
      const auto seen =
          std::count_if(point->observations.begin(), point->observations.end(),
                        [&](const Observation& o) { return o.keyframe == id && o.feature == i; });
      ASSERT_EQ(seen, 1);
    }
  }
  for (const MapPointId id : view.point_ids()) {
    const MapPoint& point = *view.point(id);
    int weight = 0;
    for (std::size_t i = 0; i < point.observations.size(); ++i) {
      const Observation& seen = point.observations[i];
      if (i > 0) {
        ASSERT_LT(point.observations[i - 1].keyframe, seen.keyframe);
      }
      const KeyFrame* keyframe = view.keyframe(seen.keyframe);
      ASSERT_NE(keyframe, nullptr);
      const int full = keyframe->features->keypoint(seen.feature).right_u >= 0 ? 2 : 1;
      ASSERT_TRUE(seen.weight == full || seen.weight == 0);
      weight += seen.weight;
    }
    from_points += point.observations.size();
    ASSERT_EQ(point.weight, weight);
  }
  ASSERT_EQ(from_keyframes, from_points);
}

void check_covisibility(const MapView& view) {
  for (const KeyFrameId id : view.keyframe_ids()) {
    std::map<KeyFrameId, int> shared;
    for (const MapPointId listed : view.keyframe(id)->points) {
      if (!listed) continue;
      const auto& observations = view.point(listed)->observations;
      if (std::any_of(observations.begin(), observations.end(),
                      [&](const Observation& o) { return o.keyframe == id && o.weight == 0; }))
        continue;
      for (const Observation& seen : observations)
        if (seen.keyframe != id && seen.weight > 0) ++shared[seen.keyframe];
    }
    std::vector<Covisible> expected, all;
    for (const auto& [other, weight] : shared) {
      all.push_back({other, weight});
      if (weight >= 15) expected.push_back({other, weight});
    }
    const auto& connected = view.keyframe(id)->connected;
    ASSERT_EQ(connected.size(), all.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      ASSERT_EQ(connected[i].id, all[i].id);
      ASSERT_EQ(connected[i].weight, all[i].weight);
    }
    const auto heavier = [](const Covisible& a, const Covisible& b) {
      return a.weight != b.weight ? a.weight > b.weight : a.id > b.id;
    };
    std::sort(expected.begin(), expected.end(), heavier);
    std::sort(all.begin(), all.end(), heavier);
    if (expected.empty() && !all.empty()) expected.push_back(all.front());
    const auto& listed = view.keyframe(id)->covisibles;
    ASSERT_EQ(listed.size(), expected.size());
    for (std::size_t i = 0; i < listed.size(); ++i) {
      ASSERT_EQ(listed[i].id, expected[i].id);
      ASSERT_EQ(listed[i].weight, expected[i].weight);
    }
  }
}

void check_tree(const MapView& view) {
  for (const KeyFrameId id : view.keyframe_ids()) {
    const KeyFrame& keyframe = *view.keyframe(id);
    std::size_t steps = 0;
    for (KeyFrameId at = id; at; at = view.keyframe(at)->parent)
      ASSERT_LE(++steps, view.keyframe_count()) << "cycle";
    if (keyframe.parent) {
      const auto& siblings = view.keyframe(keyframe.parent)->children;
      ASSERT_EQ(std::count(siblings.begin(), siblings.end(), id), 1);
    }
    ASSERT_TRUE(std::is_sorted(keyframe.children.begin(), keyframe.children.end()));
    for (const KeyFrameId child : keyframe.children) ASSERT_EQ(view.keyframe(child)->parent, id);
  }
  if (view.keyframe_count() > 0) {
    ASSERT_NE(view.keyframe(view.origin()), nullptr);
    ASSERT_FALSE(view.keyframe(view.origin())->parent);
  }
}

/// The journal alone must give the set of keyframes.
void check_journal(const MapView& view, std::size_t& read, std::set<KeyFrameId>& followed) {
  const auto& changes = view.keyframe_journal().changes;
  ASSERT_LE(changes.size() - read, 2u) << "one new keyframe and one culled per delta";
  for (; read < changes.size(); ++read)
    if (!followed.erase(changes[read])) followed.insert(changes[read]);
  const auto ids = view.keyframe_ids();
  ASSERT_TRUE(std::equal(ids.begin(), ids.end(), followed.begin(), followed.end()));
}

class RandomDeltas : public ::testing::TestWithParam<unsigned> {};

TEST_P(RandomDeltas, KeepEverythingConsistentAndIdempotent) {
  Map map, twin;
  DeltaMaker maker(GetParam());
  std::size_t read = 0;
  std::set<KeyFrameId> followed;
  for (int step = 0; step < 50; ++step) {
    const MapDelta delta = maker.next();
    map.commit(delta);
    twin.commit(delta);
    map.read([&](const MapView& view) {
      check_observations(view);
      check_covisibility(view);
      check_tree(view);
      check_journal(view, read, followed);
      return 0;
    });
    if (HasFatalFailure()) FAIL() << "after step " << step;
    const std::string once = dump(map);
    map.commit(delta);
    ASSERT_EQ(dump(map), once) << "step " << step << " was not idempotent";
    ASSERT_EQ(dump(twin), once) << "step " << step << " was not deterministic";
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomDeltas, ::testing::Range(1u, 9u));

}  // namespace
}  // namespace slambed::testing
