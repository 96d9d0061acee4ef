// SPDX-License-Identifier: Apache-2.0
// An upload's acknowledgment counts even if it arrives before send() returns.
#include "edgeslam_semantic/uploads.hpp"

#include "edgeslam_semantic/tests/semantic_run.hpp"
#include "wire/messages.hpp"

namespace slambed::edgeslam_semantic {
namespace {

constexpr Duration kRoundTrip = std::chrono::milliseconds(10);
constexpr Duration kUploadTook = std::chrono::milliseconds(30);

/// A channel that stands in for the edge and answers before send() returns.
class AnsweringChannel final : public Channel {
 public:
  AnsweringChannel(Runtime& runtime, std::string name, Duration after)
      : runtime_(runtime),
        options_{.name = std::move(name)},
        signal_(runtime.make_signal()),
        after_(after) {}

  const ChannelOptions& options() const override { return options_; }
  std::uint64_t send(std::uint8_t, Bytes payload) override {
    ++sent_;
    largest_ = std::max(largest_, payload.size());
    Message answer{.type = wire::type_of(wire::AckMessage::kType),
                   .received = runtime_.now() + after_,
                   .payload = encode(wire::AckMessage{sent_})};
    if (take_) {
      take_(answer);
    } else {
      answers_.push_back(std::move(answer));
      signal_->notify();
    }
    return sent_;
  }
  void hold(bool) override {}
  std::optional<Message> try_receive() override {
    if (answers_.empty()) return std::nullopt;
    Message answer = std::move(answers_.front());
    answers_.pop_front();
    return answer;
  }
  Signal& signal() override { return *signal_; }
  PathStats path() const override { return {}; }

  /// Makes send() pass answers to `take` instead of queueing them.
  void answer_to(std::function<void(const Message&)> take) { take_ = std::move(take); }
  std::size_t largest() const { return largest_; }

 private:
  Runtime& runtime_;
  ChannelOptions options_;
  std::unique_ptr<Signal> signal_;
  Duration after_;
  std::function<void(const Message&)> take_;
  std::deque<Message> answers_;
  std::uint64_t sent_ = 0;
  std::size_t largest_ = 0;
};

struct Noted {
  std::optional<Duration> delay;
  std::size_t bytes = 0;
};

/// Uploads every frame, whether tracked or not.
class UploadingPolicy final : public MobilePolicy {
 public:
  UploadingPolicy(MobileNode& node, Noted& noted)
      : noted_(noted),
        frames_(node.runtime(), "frame", kUploadTook),
        probes_(node.runtime(), "probe", kRoundTrip),
        uploads_(node, frames_, probes_,
                 {.pictures = false, .one_way = true, .probe_period_s = 1}) {
    frames_.answer_to([this](const Message& answer) {
      uploads_.acknowledged(wire::decode_ack(answer.payload), answer.received);
    });
  }

  void start() override { uploads_.start(); }
  void after_frame(Worker&, const TrackedFrame& frame) override {
    NewKeyFrame keyframe;
    keyframe.id = ids_.next();
    keyframe.features = frame.features;
    keyframe.points.resize(static_cast<std::size_t>(frame.features->size()));
    SemanticKeyFrame message;
    message.map_id = keyframe.id;
    message.delta.keyframes.push_back(std::move(keyframe));
    uploads_.put(std::move(message), {.reason = "test"});
  }
  void finish(Worker& worker) override {
    uploads_.drain(worker);
    noted_ = {uploads_.delay(), frames_.largest()};
  }
  void place_keyframes(PoseBook&) override {}
  MapCounts counts() const override { return {}; }

 private:
  Noted& noted_;
  IdSource<KeyFrameId> ids_{IdSpace::kTracker};
  AnsweringChannel frames_, probes_;
  Uploads uploads_;
};

class UploadsTest : public SemanticRun {};

TEST_F(UploadsTest, AnAnswerThatComesWithinSendIsAnAnswer) {
  Noted noted;
  System system;
  system.name = "edgeslam_semantic";
  system.orb = [](const Parameters&) { return OrbOptions{.features = 300}; };
  system.tracker = [](const Parameters&) { return TrackerOptions(); };
  system.sequential = [](const Parameters&) { return false; };
  system.sensors = {SensorKind::kMono};
  system.mobile = [&](MobileNode& node, const Parameters&) {
    return std::make_unique<UploadingPolicy>(node, noted);
  };
  scenario["devices"]["edge"] = nullptr;
  scenario["link"] = nullptr;
  write_scenario(nlohmann::json::object(), false);
  run_virtually(folder.path() / "sim.json", {&system, 1});
  ASSERT_GT(noted.bytes, 0u);
  ASSERT_TRUE(noted.delay) << "no upload was ever answered";
  // N is the upload's time without the round trip, plus half of the round trip.
  EXPECT_NEAR(to_seconds(*noted.delay), to_seconds(kUploadTook - kRoundTrip / 2), 0.005);
}

}  // namespace
}  // namespace slambed::edgeslam_semantic
