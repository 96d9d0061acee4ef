// SPDX-License-Identifier: Apache-2.0
#include "node/onboard_mapping.hpp"

#include <utility>

namespace slambed {

OnboardMapping::OnboardMapping(Runtime& runtime, EventLog& log, std::shared_ptr<Map> map,
                               const std::shared_ptr<PlaceIndex>& places,
                               OnboardMappingOptions options)
    : mode_(options.mode),
      map_(std::move(map)),
      mapping_(runtime, log, {}, map_, options.ids, mode_, hooks(options)) {
  if (!options.loop_closing) return;
  loops_.emplace(runtime, log, LoopCloserOptions(), map_, places, mapping_, mode_);
}

MappingHooks OnboardMapping::hooks(const OnboardMappingOptions& options) {
  if (!options.loop_closing)
    return {.prepare = {}, .done = {}, .idle = {}, .changed = {}, .lock = options.lock};
  return {.prepare = {},
          .done =
              [this](Worker& worker, KeyFrameId id) {
                const RunTime begin = worker.now();
                loops_->mapped(worker, id);
                if (mode_ == LocalMapping::Mode::kSequential) loops_spent_ += worker.now() - begin;
              },
          .idle =
              [this](Worker& worker) {
                loops_->idle(worker);
                return kNever;
              },
          .changed = [this] { loops_->map_changed(); },
          .lock = options.lock};
}

void OnboardMapping::start() {
  mapping_.start();
  if (loops_) loops_->start();
}

OnboardMapping::Spent OnboardMapping::after_frame(Worker& worker, FrameTracking& tracking,
                                                  const TrackedFrame& frame) {
  if (frame.outcome.reset_now) {
    mapping_.reset(map_).wait(worker);
    map_->clear();  // removes what the mapper committed before the reset
  }
  Tracker& tracker = tracking.tracker();
  if (frame.outcome.state != TrackingState::kOk || !tracker.wants_keyframe(mapping_.status()))
    return {};
  loops_spent_ = {};
  const RunTime begin = worker.now();
  const MapDelta made = tracking.create_keyframe(worker, frame, tracker.keyframe_need(), true);
  for (const NewKeyFrame& keyframe : made.keyframes) mapping_.submit(worker, keyframe.id);
  if (mode_ == LocalMapping::Mode::kWorker) return {};
  return {worker.now() - begin - loops_spent_, loops_spent_};
}

void OnboardMapping::drain(Worker& worker) {
  mapping_.drained().wait(worker);
  if (loops_ && !loops_->drained().wait(worker)) loops_->cancel();
}

void OnboardMapping::place(PoseBook& book) const { book.placed_in(*map_); }

}  // namespace slambed
