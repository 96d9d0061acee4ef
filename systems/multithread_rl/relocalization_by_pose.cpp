// SPDX-License-Identifier: Apache-2.0
#include "multithread_rl/relocalization_by_pose.hpp"

#include <algorithm>
#include <array>
#include <map>

#include "node/messaging.hpp"
#include "offload/maps/update_content.hpp"

namespace slambed {
namespace {

/// Returns the keyframe that sees the most of these points, the newest of several, or none.
KeyFrameId reference_of(const MapView& view, std::span<const MapPointId> points) {
  std::map<KeyFrameId, int> votes;
  for (const MapPointId id : points) {
    if (!id) continue;
    for (const Observation& seen : view.point(id)->observations) ++votes[seen.keyframe];
  }
  const auto most = std::max_element(votes.begin(), votes.end(), [](const auto& a, const auto& b) {
    return std::pair(a.second, a.first) < std::pair(b.second, b.first);
  });
  return most == votes.end() ? KeyFrameId{} : most->first;
}

}  // namespace

EdgeRelocalizationByPose::EdgeRelocalizationByPose(EdgeNode& node, Channel& frames, Channel& maps,
                                                   EdgeMapper& mapper, UpdateSender& updates,
                                                   PoseRelocalizationOptions options)
    : node_(node),
      channel_(frames),
      maps_(maps),
      mapper_(mapper),
      updates_(updates),
      options_(std::move(options)),
      inbox_(node.log()),
      relocalizer_(mapper.places()) {
  inbox_.on<wire::SuspendMessage>(wire::decode_suspend,
                                  [this](const wire::SuspendMessage&, const Message& raw) {
                                    updates_.suspend(raw.queued);
                                    maps_.hold(true);
                                  });
  inbox_.on<wire::ResumeMessage>(wire::decode_resume,
                                 [this](const wire::ResumeMessage& resume, const Message& raw) {
                                   maps_.hold(false);
                                   updates_.recovered(raw.queued, resume.reference);
                                 });
}

void EdgeRelocalizationByPose::start() {
  node_.runtime().spawn("reloc", [this](Worker& worker) { serve(worker); });
}

void EdgeRelocalizationByPose::serve(Worker& worker) {
  while (const auto message = channel_.receive(worker, kNever)) {
    if (is(*message, wire::RelocRequest::kType)) answer(worker, *message);
  }
}

void EdgeRelocalizationByPose::answer(Worker& worker, const Message& raw) {
  wire::RelocFail failed;
  failed.times = {.queued = raw.queued, .received = raw.received};
  failed.padding = options_.codec.text() ? options_.fail_bytes : 0;
  wire::RelocRequest request;
  const bool readable = worker.stage(options_.codec.parse_stage(), [&](StageUnits& units) {
    units.n1 = kilobytes(raw.payload);
    auto read_well = read(node_.log(), raw, [&](const Bytes& bytes) {
      failed.number = wire::number_of_request(bytes);
      return options_.codec.request(worker, bytes, node_.peer().sensor());
    });
    if (!read_well) return false;
    request = std::move(*read_well);
    return true;
  });
  std::optional<wire::RelocOk> found;
  if (!readable) {
    failed.reason = wire::RelocFailure::kUnreadable;
  } else if (count(*mapper_.map()).keyframes == 0) {
    failed.reason = wire::RelocFailure::kNoMap;
  } else {
    Frame frame;
    frame.begin(request.frame.frame_index, request.frame.timestamp_s, request.frame.features);
    const std::uint64_t corrections = mapper_.loop_corrections();
    if (locate(worker, frame)) found = answer_for(request, frame, corrections);
  }
  node_.log().write(JsonLine("reloc_attempt")
                        .add("number", failed.number)
                        .add("found", found.has_value())
                        .add("matches", found ? found->matches.size() : 0));
  if (!found) {
    send(channel_, failed);
    return;
  }
  found->times = failed.times;
  Bytes payload = options_.codec.serialize(worker, *found, request.frame);
  send(channel_, wire::RelocOk::kType, std::move(payload));
}

bool EdgeRelocalizationByPose::locate(Worker& worker, Frame& frame) {
  return worker.stage("relocalize", [&](StageUnits& units) {
    const bool found = relocalizer_.locate(*mapper_.map(), {}, search_, frame);
    units.n1 = frame.features->size();
    units.n2 = relocalizer_.candidates_posed();
    return found;
  });
}

/// Builds the answer from the current map: points may have been fused or culled meanwhile.
std::optional<wire::RelocOk> EdgeRelocalizationByPose::answer_for(
    const wire::RelocRequest& request, const Frame& frame, std::uint64_t corrections_before) {
  wire::RelocOk answer;
  answer.number = request.number;
  answer.T_cw = frame.T_cw;
  const bool whole = mapper_.read_for_update(request.applied_update, [&](std::uint64_t number,
                                                                         bool corrected) {
    // A loop correction came in between, so the pose is outdated.
    if (mapper_.loop_corrections() != corrections_before) return false;
    answer.update = number;
    answer.jumped = corrected;
    return mapper_.map()->read([&](const MapView& view) {
      std::vector<MapPointId> points = frame.points;
      for (MapPointId& id : points) {
        if (id) id = view.resolve(id);
      }
      const KeyFrameId reference = reference_of(view, points);
      if (!reference) return false;
      answer.keyframe = extract_keyframes(view, std::array{reference});
      for (std::size_t i = 0; i < points.size(); ++i) {
        const bool held =
            points[i] && std::any_of(answer.keyframe.points.begin(), answer.keyframe.points.end(),
                                     [&](const NewPoint& point) { return point.id == points[i]; });
        if (held) answer.matches.emplace_back(static_cast<std::uint16_t>(i), points[i]);
      }
      return true;
    });
  });
  if (!whole) return std::nullopt;
  return answer;
}

}  // namespace slambed
