// SPDX-License-Identifier: Apache-2.0
#include "slam/essential_graph.hpp"

#include <algorithm>

#include "slam/map_correction.hpp"

namespace slambed {
namespace {

/// Covisibility that makes an edge of the essential graph (ORB-SLAM2).
constexpr int kStrongWeight = 100;

/// Collects edges between keyframes, each pair once.
class EdgeCollector {
 public:
  EdgeCollector(const std::vector<KeyFrameId>& ids, PoseGraphProblem& problem)
      : ids_(ids), problem_(problem) {}

  std::optional<std::uint32_t> place(KeyFrameId id) const {
    const auto at = std::lower_bound(ids_.begin(), ids_.end(), id);
    if (at == ids_.end() || *at != id) return std::nullopt;
    return static_cast<std::uint32_t>(at - ids_.begin());
  }

  /// Adds an edge that keeps the pair's relative pose in S_cw.
  void add(KeyFrameId from, KeyFrameId to, const std::vector<Sim3>& S_cw) {
    const auto i = place(from), j = place(to);
    if (!i || !j || !taken_.emplace(std::minmax(from, to)).second) return;
    problem_.edges.push_back({*i, *j, S_cw[*j] * S_cw[*i].inverse()});
  }

 private:
  const std::vector<KeyFrameId>& ids_;
  PoseGraphProblem& problem_;
  LoopEdges taken_;
};

bool was_connected(const LoopCorrection::Moved& moved, KeyFrameId id) {
  const auto& before = moved.connected_before;
  const auto at =
      std::lower_bound(before.begin(), before.end(), id,
                       [](const Covisible& other, KeyFrameId wanted) { return other.id < wanted; });
  return at != before.end() && at->id == id;
}

/// Adds the loop's new links: from moved keyframes to those that they are connected with only now.
void hold_new_links(const MapView& view, const LoopCorrection& loop, const std::vector<Sim3>& S_cw,
                    EdgeCollector& edges) {
  edges.add(loop.keyframe, loop.matched, S_cw);
  const auto is_moved = [&](KeyFrameId id) {
    return std::any_of(loop.moved.begin(), loop.moved.end(),
                       [&](const LoopCorrection::Moved& m) { return m.id == id; });
  };
  for (const LoopCorrection::Moved& moved : loop.moved) {
    const KeyFrame* keyframe = view.keyframe(moved.id);
    if (!keyframe) continue;
    for (const Covisible& near : keyframe->covisibles) {
      if (near.weight < kStrongWeight) break;
      if (!was_connected(moved, near.id) && !is_moved(near.id)) edges.add(moved.id, near.id, S_cw);
    }
  }
}

void hold_old_links(const MapView& view, const std::vector<KeyFrameId>& ids,
                    const LoopEdges& earlier, const std::vector<Sim3>& S_cw, EdgeCollector& edges) {
  for (const KeyFrameId id : ids)
    if (const KeyFrameId parent = view.keyframe(id)->parent) edges.add(id, parent, S_cw);
  for (const auto& [older, newer] : earlier) edges.add(newer, older, S_cw);
  for (const KeyFrameId id : ids) {
    for (const Covisible& near : view.keyframe(id)->covisibles) {
      if (near.weight < kStrongWeight) break;
      edges.add(id, near.id, S_cw);
    }
  }
}

}  // namespace

EssentialGraph::EssentialGraph(const Map& map, const LoopCorrection& loop, const LoopEdges& earlier,
                               const PoseGraphOptions& options) {
  PoseGraphProblem problem;
  map.read([&](const MapView& view) {
    ids_ = view.keyframe_ids();
    origin_ = view.origin();
    std::vector<Sim3> before;
    for (const KeyFrameId id : ids_) {
      start_.push_back(to_sim3(view.keyframe(id)->T_cw));
      before.push_back(start_.back());
    }
    EdgeCollector edges(ids_, problem);
    for (const LoopCorrection::Moved& moved : loop.moved) {
      const auto at = edges.place(moved.id);
      if (!at) continue;
      start_[*at] = moved.after;
      before[*at] = moved.before;
    }
    if (const auto at = edges.place(origin_)) origin_before_ = before[*at];
    hold_new_links(view, loop, start_, edges);
    hold_old_links(view, ids_, earlier, before, edges);
    problem.fixed.assign(ids_.size(), 0);
    const auto held = edges.place(loop.matched);
    if (!problem.fixed.empty()) problem.fixed[held ? *held : 0] = 1;
    if (!ids_.empty()) problem.fix_scale = view.keyframe(ids_.front())->features->sensor().metric();
    return 0;
  });
  problem.S_cw = start_;
  for (const MapPointId point : loop.moved_points) anchors_.emplace_back(point, loop.keyframe);
  graph_ = std::make_unique<PoseGraph>(std::move(problem), options);
}

MapDelta EssentialGraph::result(const Map& map) const {
  const std::vector<Sim3>& solved = graph_->problem().S_cw;
  // The graph fixed the old side of the loop; in the map's world frame the origin never moves.
  Sim3 to_solved;
  const auto origin = std::lower_bound(ids_.begin(), ids_.end(), origin_);
  if (origin != ids_.end() && *origin == origin_)
    to_solved = solved[static_cast<std::size_t>(origin - ids_.begin())].inverse() * origin_before_;
  MapCorrection correction;
  for (std::size_t i = 0; i < ids_.size(); ++i)
    correction.move(ids_[i], start_[i],
                    ids_[i] == origin_ ? origin_before_ : normalized(solved[i] * to_solved));
  for (const auto& [point, keyframe] : anchors_) correction.anchor(point, keyframe);
  return map.read([&](const MapView& view) { return correction.delta(view); });
}

}  // namespace slambed
