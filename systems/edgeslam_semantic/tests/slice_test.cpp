// SPDX-License-Identifier: Apache-2.0
// After every slice the mobile's window equals the edge's.
#include <gtest/gtest.h>

#include <random>

#include "edgeslam_semantic/labels.hpp"
#include "edgeslam_semantic/local_map.hpp"
#include "edgeslam_semantic/messages.hpp"
#include "edgeslam_semantic/semantic_edge.hpp"
#include "wire/tests/examples.hpp"

namespace slambed::edgeslam_semantic {
namespace {

using wire::keyframe_id;
using wire::point_id;

constexpr int kFeatures = 40;

/// An edge's map that gets keyframes and random changes of every kind.
class RandomEdge {
 public:
  RandomEdge() : sensor_(wire::example_camera().make_sensor()) {}

  Map map;
  std::vector<KeyFrameId> keyframes;

  void step() {
    MapDelta delta;
    if (keyframes.empty() || random_() % 3 == 0) add_keyframe(delta);
    map.commit(delta);
    delta = map.read([this](const MapView& view) { return change(view); });
    map.commit(delta);
  }
  std::span<const KeyFrameId> newest(std::size_t count) const {
    return std::span(keyframes).last(std::min(count, keyframes.size()));
  }
  std::uint64_t random() { return random_(); }

 private:
  void add_keyframe(MapDelta& delta) {
    NewKeyFrame keyframe;
    keyframe.id = keyframe_id(keyframes.size() + 1);
    keyframe.features = wire::example_features(random_, kFeatures, sensor_);
    keyframe.T_cw = pose();
    keyframe.points.resize(kFeatures);
    const auto known = map.read([](const MapView& view) { return view.point_ids(); });
    for (int i = 0; i < kFeatures; ++i) {
      if (random_() % 3 == 0) continue;
      if (!known.empty() && random_() % 2) {
        keyframe.points[i] = known[random_() % known.size()];
      } else {
        keyframe.points[i] = point_id(++points_, IdSpace::kEdgeMapper);
        NewPoint fresh;
        fresh.id = keyframe.points[i];
        fresh.p_w = position();
        fresh.reference = fresh.first_keyframe = keyframe.id;
        delta.points.push_back(fresh);
      }
    }
    keyframes.push_back(keyframe.id);
    delta.keyframes.push_back(std::move(keyframe));
  }

  MapDelta change(const MapView& view) {
    MapDelta delta;
    const auto ids = view.point_ids();
    for (const MapPointId id : ids) {
      switch (random_() % 12) {
        case 0:
          delta.positions.push_back({id, position(), view.point(id)->version + 1});
          break;
        case 1:
          delta.culled_points.push_back(id);
          break;
        case 2:
          delta.fusions.push_back({id, ids[random_() % ids.size()]});
          break;
        default:
          break;
      }
    }
    const auto frames = view.keyframe_ids();
    for (const KeyFrameId id : frames) {
      const KeyFrame& keyframe = *view.keyframe(id);
      if (random_() % 4 == 0) delta.poses.push_back({id, pose(), keyframe.version + 1});
      const auto feature = static_cast<std::uint16_t>(random_() % kFeatures);
      if (random_() % 2 && !ids.empty())
        delta.attach.push_back({id, feature, ids[random_() % ids.size()]});
      else if (keyframe.points[feature])
        delta.detach.push_back({id, feature, keyframe.points[feature]});
    }
    if (frames.size() > 4 && random_() % 6 == 0)
      delta.culled_keyframes.push_back(frames[1 + random_() % (frames.size() - 1)]);
    return delta;
  }

  double number() { return std::uniform_real_distribution<double>(-3, 3)(random_); }
  Eigen::Vector3d position() { return {number(), number(), number()}; }
  SE3 pose() {
    Eigen::Matrix<double, 6, 1> twist;
    for (double& value : twist) value = number();
    return SE3::exp(twist);
  }

  std::mt19937 random_{7};
  wire::SensorPtr sensor_;
  std::uint64_t points_ = 0;
};

void expect_equal(const MapWindow& found, const MapWindow& wanted, int step) {
  ASSERT_EQ(found.points.size(), wanted.points.size()) << step;
  for (const auto& [id, p_w] : wanted.points) ASSERT_EQ(found.points.at(id), p_w) << step;
  ASSERT_EQ(found.keyframes.size(), wanted.keyframes.size()) << step;
  for (const auto& [id, observed] : wanted.keyframes) {
    ASSERT_EQ(found.keyframes.at(id).points, observed.points) << step;
    // Not exact, because rotations are sent as quaternions.
    ASSERT_LT((found.keyframes.at(id).T_cw.R - observed.T_cw.R).norm(), 1e-12) << step;
    ASSERT_LT((found.keyframes.at(id).T_cw.t - observed.T_cw.t).norm(), 1e-12) << step;
  }
}

TEST(MapSlices, AThousandLaterTheMobileHasWhatTheEdgeHas) {
  RandomEdge edge;
  MapWindow before, mobile;
  std::size_t largest = 0, left = 0;
  for (int step = 0; step < 1000; ++step) {
    for (std::uint64_t changes = 1 + edge.random() % 3; changes > 0; --changes) edge.step();
    const auto [now, sent] = edge.map.read([&](const MapView& view) {
      const MapWindow window = window_of(view, edge.newest(8));
      MapSlice slice = difference(before, window, view);
      return std::pair(window, OptResult{.map_id = keyframe_id(1),
                                         .number = 1,
                                         .keyframe = keyframe_id(1),
                                         .T_cw = {},
                                         .times = {},
                                         .changes = slice.changes,
                                         .left_keyframes = slice.left_keyframes,
                                         .left_points = slice.left_points});
    });
    const OptResult came = decode_opt_result(encode(sent));
    apply(mobile, {came.changes, came.left_keyframes, came.left_points});
    before = now;
    expect_equal(mobile, now, step);
    largest = std::max(largest, now.points.size());
    left += came.left_points.size();
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(largest, 50u);
  EXPECT_GT(left, 100u) << "points left the window without being deleted";
}

}  // namespace
}  // namespace slambed::edgeslam_semantic
