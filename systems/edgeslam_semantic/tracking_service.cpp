// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/tracking_service.hpp"

#include <utility>

#include "features/default_vocabulary.hpp"
#include "node/messaging.hpp"
#include "offload/channels/message_codec.hpp"
#include "slam/place_index.hpp"
#include "wire/message_type.hpp"

namespace slambed {
namespace {

wire::FrameState state_of(TrackingState state) {
  return state == TrackingState::kOk     ? wire::FrameState::kOk
         : state == TrackingState::kLost ? wire::FrameState::kLost
                                         : wire::FrameState::kNotInitialized;
}

}  // namespace

TrackingService::TrackingService(EdgeNode& node, Channel& frames, TrackingServiceOptions options)
    : node_(node),
      channel_(frames),
      options_(options),
      map_(std::make_shared<Map>()),
      places_(std::make_shared<PlaceIndex>(default_vocabulary())),
      mapping_(node.runtime(), node.log(), map_, places_,
               {.mode = LocalMapping::Mode::kSequential,
                .loop_closing = options_.loop_closing,
                .ids = IdSpace::kEdgeMapper}),
      progressed_(node.runtime().make_signal()) {
  if (options_.masks) masks_.emplace(node, *options_.masks);
}

void TrackingService::start() {
  mapping_.start();
  if (masks_) masks_->start();
  node_.runtime().spawn("tracking", [this](Worker& worker) { receive(worker); });
}

void TrackingService::receive(Worker& worker) {
  while (const auto message = channel_.receive(worker, kNever)) {
    if (is(*message, wire::FrameImage::kType)) answer(worker, *message);
    answered_ = message->sequence;
    progressed_->notify();
  }
}

void TrackingService::answer(Worker& worker, const Message& message) {
  wire::FrameResult result;
  result.sequence = message.sequence;
  result.times.queued = message.queued;
  result.times.received = message.received;
  result.times.begun = worker.now();
  const auto sensor = node_.peer().sensor();
  try {
    const wire::FrameImage image = wire::decode_frame_image(message.payload);
    result.frame_index = image.frame_index;
    result.times.captured = image.captured;
    result.times.dequeued = image.dequeued;
    if (!sensor) throw wire::DecodeError("its camera is unknown");
    result.masks = {sensor->camera.width, sensor->camera.height, {}};
    track(worker, image, result);
  } catch (const wire::DecodeError& error) {
    refuse(node_.log(), message, error);
    if (!sensor) return;
    // The mobile waits for an answer, so it gets one without a pose.
    result.masks = {sensor->camera.width, sensor->camera.height, {}};
    result.state = wire::FrameState::kLost;
  }
  result.times.done = worker.now();
  send(channel_, result);
}

FrameTracking& TrackingService::tracking() {
  if (!tracking_) {
    tracking_ = std::make_unique<FrameTracking>(
        node_.log(), at_rate(options_.tracker, SensorKind::kMono, node_.peer().played_fps()), map_,
        places_);
  }
  return *tracking_;
}

void TrackingService::track(Worker& worker, const wire::FrameImage& image,
                            wire::FrameResult& result) {
  result_ = &result;
  worker.stage("decode_image", [&](StageUnits& units) {
    units.n1 = kilobytes(image.jpeg);
    node_.pictures().decode(image.jpeg);
    return 0;
  });
  if (masks_) masks_->ask(image.frame_index, image.jpeg, result.times.begun);
  const OfferedFrame offered{.played = {image.frame_index, from_seconds(image.timestamp_s)},
                             .offered = image.captured,
                             .dequeued = result.times.begun};
  const TrackedFrame frame = tracking().track(
      worker, offered,
      [&](StageUnits& units) {
        auto features = node_.pictures().extract(image.frame_index);
        units.n1 = features->size();
        return features;
      },
      *this);
  result.state = state_of(frame.outcome.state);
  result.reset = frame.outcome.reset_now;
  result.T_cw = frame.outcome.T_cw;
  result.reference = frame.outcome.reference;
  result.T_cr = frame.outcome.T_cr;
  result.features = static_cast<std::uint32_t>(frame.features->size());
  result.inliers = static_cast<std::uint32_t>(frame.outcome.inliers);
}

std::shared_ptr<const FeatureSet> TrackingService::before_tracking(
    Worker& worker, const OfferedFrame&, std::shared_ptr<const FeatureSet> features) {
  result_->times.extract = worker.now() - result_->times.begun;
  if (masks_) {
    PictureMasks::Answer answer = masks_->wait(worker);
    result_->times.nrcc = answer.took;
    // Without masks nothing is culled in this frame.
    if (answer.segmented) result_->masks = std::move(answer.masks);
  }
  tracking_began_ = worker.now();
  return masks_ ? masks_->cull(worker, std::move(features), result_->masks) : features;
}

void TrackingService::after_frame(Worker& worker, const TrackedFrame& frame) {
  result_->times.track = worker.now() - tracking_began_;
  const auto spent = mapping_.after_frame(worker, *tracking_, frame);
  result_->times.local_mapping = spent.local_mapping;
  result_->times.loop_closing = spent.loop_closing;
}

void TrackingService::drain(Worker& worker, std::uint64_t last_sequence, RunTime transit, RunTime) {
  Completion(
      *progressed_, [&] { return answered_ >= last_sequence; }, [] { return false; })
      .wait(worker, transit);
}

std::vector<KeyFramePose> TrackingService::all_poses() const {
  std::vector<KeyFramePose> poses;
  if (!tracking_) return poses;
  for (const KeyFrameId id : tracking_->poses().keyframes()) {
    const auto pose = map_->read([&](const MapView& view) { return view.pose_of(id); });
    if (pose) poses.push_back({id, *pose, 0});
  }
  return poses;
}

}  // namespace slambed
