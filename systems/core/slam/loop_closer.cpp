// SPDX-License-Identifier: Apache-2.0
#include "slam/loop_closer.hpp"

#include <optional>
#include <utility>

#include "slam/essential_graph.hpp"
#include "slam/global_bundle.hpp"
#include "slam/loop_correction.hpp"

namespace slambed {

struct LoopCloser::Impl {
  Impl(LoopCloserOptions o, std::shared_ptr<Map> m, const std::shared_ptr<PlaceIndex>& places)
      : options(o), map(std::move(m)), detector(o.detector, places), verifier(o.verifier, places) {}

  LoopCloserOptions options;
  std::shared_ptr<Map> map;
  LoopDetector detector;
  LoopVerifier verifier;
  LoopCorrector corrector;
  KeyFrameId keyframe;
  std::vector<KeyFrameId> candidates;
  LoopMatch match;
  LoopCorrection correction;
  LoopEdges edges;  ///< of loops closed so far
  std::optional<EssentialGraph> graph;
  std::optional<GlobalBundle> bundle;
};

LoopCloser::LoopCloser(LoopCloserOptions options, std::shared_ptr<Map> map,
                       const std::shared_ptr<PlaceIndex>& places)
    : impl_(std::make_unique<Impl>(options, std::move(map), places)) {}
LoopCloser::~LoopCloser() = default;

bool LoopCloser::detect(KeyFrameId keyframe) {
  impl_->keyframe = keyframe;
  impl_->candidates = impl_->detector.detect(*impl_->map, keyframe);
  return !impl_->candidates.empty();
}

bool LoopCloser::verify() {
  for (const KeyFrameId candidate : std::exchange(impl_->candidates, {})) {
    auto match = impl_->verifier.verify(*impl_->map, impl_->keyframe, candidate);
    if (!match) continue;
    impl_->match = std::move(*match);
    return true;
  }
  return false;
}

MapDelta LoopCloser::correct() {
  impl_->bundle.reset();
  impl_->graph.reset();
  impl_->correction = impl_->corrector.correct(*impl_->map, impl_->match);
  if (!impl_->correction.moved.empty()) impl_->detector.closed();
  return std::move(impl_->correction.delta);
}

bool LoopCloser::begin_graph() {
  const LoopCorrection& loop = impl_->correction;
  if (loop.moved.empty()) return false;
  impl_->graph.emplace(*impl_->map, loop, impl_->edges, impl_->options.graph);
  impl_->edges.insert(std::minmax(loop.keyframe, loop.matched));
  return true;
}

bool LoopCloser::step_graph() { return impl_->graph && impl_->graph->step(); }

MapDelta LoopCloser::finish_graph() {
  if (!impl_->graph) return {};
  MapDelta delta = impl_->graph->result(*impl_->map);
  impl_->graph.reset();
  impl_->correction = {};
  return delta;
}

bool LoopCloser::begin_bundle() {
  impl_->bundle = GlobalBundle::of(*impl_->map, impl_->options.bundle);
  return impl_->bundle.has_value();
}

bool LoopCloser::step_bundle() { return impl_->bundle && impl_->bundle->step(); }

MapDelta LoopCloser::finish_bundle() {
  if (!impl_->bundle) return {};
  MapDelta delta = impl_->bundle->result(*impl_->map);
  impl_->bundle.reset();
  return delta;
}

const LoopMatch& LoopCloser::loop() const { return impl_->match; }

void LoopCloser::replace_map(std::shared_ptr<Map> map) {
  impl_->map = std::move(map);
  impl_->detector.reset();
  impl_->candidates.clear();
  impl_->correction = {};
  impl_->edges.clear();
  impl_->graph.reset();
  impl_->bundle.reset();
}

}  // namespace slambed
