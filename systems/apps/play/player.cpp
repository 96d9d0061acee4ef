// SPDX-License-Identifier: Apache-2.0
#include "apps/play/player.hpp"

#include <algorithm>
#include <memory>
#include <optional>

#include "apps/play/command.hpp"
#include "apps/play/conversation.hpp"
#include "apps/play/frame_memory.hpp"
#include "apps/play/frame_record.hpp"
#include "base/error.hpp"
#include "base/json_reader.hpp"
#include "node/mobile_node.hpp"
#include "run/node_files.hpp"
#include "runtime/live/live_runtime.hpp"
#include "runtime/live/stop_signals.hpp"
#include "sequence/prepared_sequence.hpp"

namespace slambed {
namespace {

namespace fs = std::filesystem;

constexpr Duration kLookForEnd = std::chrono::milliseconds(100);
/// How long a system may clean up after its last message, and an edge after the end of the run.
constexpr Duration kPatience = std::chrono::seconds(10), kEdgePatience = std::chrono::seconds(5);
constexpr int kSystemFailed = 1;

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

class Player {
 public:
  explicit Player(const PlayerOptions& options)
      : options_(options),
        config_(read_run_config(options.config)),
        restarted_(succeeds_a_dead_edge(config_.output, options.role)),
        folder_(prepare_node_folder(config_.output, options.role)),
        log_(folder_ / "events.jsonl", options.role,
             restarted_ ? EventLog::Open::kAppend : EventLog::Open::kAnew),
        runtime_(log_),
        record_(log_) {
    log_.set_clock([this] { return runtime_.now(); });
    if (restarted_) log_.write(JsonLine("node_restarted"));
    if (mobile()) open_sequence();
  }

  int run() {
    // A mobile program without a client cannot wait for the start, so it is launched only then. Its
    // edge program must run by that time.
    const bool starts_at_once = options_.client || !mobile();
    if (starts_at_once) start_command();
    signals_.watch([this] {
      stopped_ = true;
      stop();
    });
    if (options_.client && !await_ready()) {
      if (stopped_) return leave("");
      return failed(command_->wait(kPatience), "before it was ready");
    }
    write_by_rename(folder_ / "ready.json", {{"role", role_name(options_.role)}});
    const auto t0 = await_start(config_.output, from_seconds(config_.connect_timeout_s),
                                [this] { return runtime_.stopping(); });
    if (!t0) return leave("");
    log_.start(*t0, [&] { runtime_.set_origin(*t0); });
    if (!starts_at_once) start_command();
    live();
    return finish();
  }

  ~Player() { signals_.unwatch(); }

 private:
  bool mobile() const { return options_.role == NodeRole::kMobile; }

  void open_sequence() {
    sequence_.emplace(config_.sequence);
    playlist_.emplace(sequence_->timestamps_ns(), sequence_->fps(), config_.playback);
    memory_.emplace(frame_bytes(*sequence_));
    if (config_.playback.mode == PlaybackMode::kRealtime) {
      feed_ = std::make_unique<RealtimeFeed>(runtime_, *playlist_, log_);
    } else {
      feed_ = std::make_unique<EveryFrameFeed>(*playlist_, /*paced=*/true);
    }
  }

  void start_command() {
    CommandOptions command{.arguments = options_.command,
                           .directory = options_.directory,
                           .environment = environment(),
                           .inherited = {}};
    if (options_.client) command.inherited.push_back(conversation_.client_fd());
    if (options_.client && memory_) command.inherited.push_back(memory_->fd());
    command_.emplace(command);
    conversation_.forget_client();
  }

  std::vector<std::pair<std::string, std::string>> environment() const {
    std::vector<std::pair<std::string, std::string>> variables{
        {"SLAMBED_ROLE", role_name(options_.role)},
        {"SLAMBED_SEED", std::to_string(config_.seed)},
        {"SLAMBED_OUTPUT", folder_.string()},
        {"SLAMBED_PARAMS", config_.params.dump()}};
    if (options_.client) {
      variables.emplace_back("SLAMBED_CLIENT", std::to_string(conversation_.client_fd()) + "," +
                                                   std::to_string(memory_ ? memory_->fd() : -1));
    }
    for (const auto& [name, value] : config_.params.items()) {
      variables.emplace_back("SLAMBED_PARAM_" + upper(name),
                             value.is_string() ? value.get<std::string>() : value.dump());
    }
    if (config_.network) {
      variables.emplace_back("SLAMBED_EDGE_ADDRESS", config_.network->edge_address);
      for (const auto& [channel, port] : config_.network->ports) {
        variables.emplace_back("SLAMBED_PORT_" + upper(channel), std::to_string(port));
      }
    }
    return variables;
  }

  /// Returns false if the system ended or the run was stopped before it was ready.
  bool await_ready() {
    while (const auto packet = conversation_.next()) {
      if (packet->type == SLAMBED_READY) return true;
      if (packet->type == SLAMBED_HELLO) greet();
      if (packet->type == SLAMBED_EVENT) log_.write(system_event(packet->text));
      if (packet->type != SLAMBED_HELLO && packet->type != SLAMBED_EVENT) {
        throw bad_input("the system asked for frames before it said that it is ready");
      }
    }
    return false;
  }

  void greet() {
    slambed_info info{};
    if (mobile()) info = describe(*sequence_, playlist_->played_fps(), memory_->slot_bytes());
    info.type = SLAMBED_INFO;
    info.protocol = SLAMBED_PROTOCOL;
    conversation_.send_info(info);
  }

  void live() {
    try {
      spawn_log_writer(runtime_, log_);
      if (mobile() && options_.client) feed_->start();
      if (options_.client) {
        runtime_.spawn("player", [this](Worker& worker) { serve(worker); });
      } else {
        runtime_.spawn("player", [this](Worker& worker) { await_command(worker); });
      }
      if (!mobile()) runtime_.spawn("end-of-run", [this](Worker& worker) { await_mobile(worker); });
      runtime_.join();
    } catch (const std::exception& error) {
      stop();
      runtime_.join();
      log_.warning(error.what());
      log_.flush();
      throw;
    }
  }

  void serve(Worker& worker) {
    worker.sleep_until(RunTime::zero());
    while (const auto packet = conversation_.next()) {
      switch (packet->type) {
        case SLAMBED_NEXT:
          if (mobile()) offer(worker);
          break;
        case SLAMBED_POSE:
          record_.tracked(packet->pose, worker.now());
          break;
        case SLAMBED_FINAL:
          record_.placed(packet->pose);
          break;
        case SLAMBED_EVENT:
          log_.write(system_event(packet->text));
          break;
        default:
          break;
      }
    }
    runtime_.stop();
  }

  void offer(Worker& worker) {
    const bool enough = config_.playback.stop_at_first_loss && record_.lost();
    const auto offered = enough ? std::nullopt : feed_->next(worker);
    if (!offered) {
      played_ = !worker.stopping();
      return conversation_.send_end();
    }
    const auto picture = sequence_->frame(offered->played.index);
    slambed_frame frame{.type = SLAMBED_FRAME,
                        .slot = memory_->put(picture),
                        .index = offered->played.index,
                        .recorded_ns = sequence_->time_origin_ns() + picture.timestamp_ns,
                        .seq_s = offered->played.seq_s()};
    record_.dequeued(*offered, frame.recorded_ns);
    conversation_.send_frame(frame);
  }

  void await_command(Worker& worker) {
    while (!worker.stopping() && !command_->wait(kLookForEnd)) {
    }
    runtime_.stop();
  }

  /// An edge's system does not know when the run is over. The mobile node's last file shows it.
  void await_mobile(Worker& worker) {
    const fs::path end = config_.output / role_name(NodeRole::kMobile) / "node.json";
    while (!worker.stopping() && !fs::exists(end)) {
      worker.sleep_until(worker.now() + kLookForEnd);
    }
    if (worker.stopping()) return;
    played_ = true;
    conversation_.send_end();
    const RunTime deadline = worker.now() + kEdgePatience;
    while (!worker.stopping() && worker.now() < deadline) {
      worker.sleep_until(worker.now() + kLookForEnd);
    }
    stop();
  }

  void stop() {
    runtime_.stop();
    conversation_.hang_up();
  }

  int finish() {
    const std::string reason = stopped_ ? "" : "completed";
    if (stopped_ || (!mobile() && played_)) {
      // The exit code of an edge that is being stopped does not matter.
      if (!command_->wait(Duration::zero())) command_->end();
      return leave(reason);
    }
    const auto code = command_->wait(kPatience);
    const bool early = mobile() && options_.client && !played_;
    if (code != 0 || early) return failed(code, "before playback was over");
    return leave(reason);
  }

  /// Ends a run whose system failed or ended early. The system's own log may have the reason.
  int failed(std::optional<int> code, const std::string& when) {
    if (!code) command_->end();
    write_results();
    if (!code)
      throw bad_input("the system did not end by itself after its last message; it was killed");
    if (*code == 0) {
      const bool ready = fs::exists(folder_ / "ready.json");
      throw bad_input("the system ended " + when +
                      (ready ? "; ask for frames until there are none"
                             : "; say that it is ready (ready), then ask for frames"));
    }
    return *code > 128 ? *code : kSystemFailed;
  }

  int leave(const std::string& reason) {
    if (command_) command_->end();
    write_results();
    if (mobile() && !options_.trajectory.empty() && !reason.empty()) take_trajectory();
    NodeEnd end;
    end.role = options_.role;
    end.reason = reason;
    if (feed_) end.frames_total = options_.client ? feed_->offered() : playlist_->frames().size();
    write_node_end(folder_, end);
    return 0;
  }

  void write_results() {
    if (mobile() && options_.client) {
      record_.over(runtime_.now());
      record_.write_trajectories(folder_);
    }
    log_.flush();
  }

  void take_trajectory() {
    const fs::path left = folder_ / options_.trajectory;
    if (fs::exists(left) && !fs::is_regular_file(left)) {
      throw bad_input(left.string() + ": the system left " +
                      (fs::is_directory(left) ? "a folder" : "a pipe, socket or device") +
                      "; write a file");
    }
    if (!fs::is_regular_file(left)) {
      throw bad_input(left.string() +
                      ": the system left no such trajectory; correct "
                      "runtime.trajectory, or have it written to $SLAMBED_OUTPUT");
    }
    fs::copy_file(left, folder_ / "trajectory.txt", fs::copy_options::overwrite_existing);
  }

  StopSignals signals_;  ///< must be first, so that all threads inherit the blocked signals
  const PlayerOptions& options_;
  RunConfig config_;
  bool restarted_;
  fs::path folder_;
  EventLog log_;
  LiveRuntime runtime_;
  FrameRecord record_;
  Conversation conversation_;
  std::optional<PreparedSequence> sequence_;
  std::optional<Playlist> playlist_;
  std::optional<FrameMemory> memory_;
  std::unique_ptr<FrameFeed> feed_;
  std::optional<Command> command_;
  std::atomic<bool> played_{false}, stopped_{false};
};

}  // namespace

int play(const PlayerOptions& options) {
  Player player(options);
  return player.run();
}

}  // namespace slambed
