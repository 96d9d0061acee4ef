// SPDX-License-Identifier: Apache-2.0
#include "runtime/live/live_runtime.hpp"

#include <pthread.h>
#include <time.h>

#include <algorithm>

namespace slambed {
namespace {

/// The kernel keeps 15 characters of a thread's name.
void name_thread(const std::string& name) {
  pthread_setname_np(pthread_self(), name.substr(0, 15).c_str());
}

}  // namespace

Duration monotonic_now() {
  timespec ts{};
  clock_gettime(CLOCK_MONOTONIC, &ts);
  return std::chrono::seconds(ts.tv_sec) + Duration(ts.tv_nsec);
}

class LiveRuntime::LiveSignal final : public Signal {
 public:
  explicit LiveSignal(LiveRuntime& runtime) : runtime_(runtime) { runtime_.enlist(*this); }
  ~LiveSignal() override { runtime_.dismiss(*this); }

  std::uint64_t ticket() const override {
    std::lock_guard lock(mutex_);
    return count_;
  }

  void notify() override {
    {
      std::lock_guard lock(mutex_);
      ++count_;
    }
    changed_.notify_all();
  }

  /// Wakes waiters without a notification, so that they check whether the run stops.
  void nudge() {
    { std::lock_guard lock(mutex_); }
    changed_.notify_all();
  }

  bool wait(std::uint64_t ticket, RunTime deadline) {
    std::unique_lock lock(mutex_);
    const auto ready = [&] { return count_ != ticket || runtime_.stopping(); };
    if (deadline == kNever) {
      changed_.wait(lock, ready);
    } else {
      // steady_clock is CLOCK_MONOTONIC.
      changed_.wait_until(lock, std::chrono::steady_clock::time_point(runtime_.origin() + deadline),
                          ready);
    }
    return count_ != ticket;
  }

 private:
  LiveRuntime& runtime_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t count_ = 0;
};

class LiveRuntime::LiveWorker final : public Worker {
 public:
  LiveWorker(LiveRuntime& runtime, std::string name)
      : runtime_(runtime), name_(std::move(name)), alarm_(runtime) {}

  RunTime now() const override { return runtime_.now(); }
  bool stopping() const override { return runtime_.stopping(); }
  bool charged() const override { return false; }

  bool wait(Signal& signal, std::uint64_t ticket, RunTime deadline) override {
    return static_cast<LiveSignal&>(signal).wait(ticket, deadline);
  }

  void sleep_until(RunTime when) override { alarm_.wait(alarm_.ticket(), when); }

 protected:
  StageToken begin_stage(std::string_view name) override {
    if (runtime_.pace_) runtime_.pace_->check(name);  // end_stage must not throw in a destructor
    return {name, now(), thread_cpu_time()};
  }

  void end_stage(StageToken& token, const StageUnits& units) override {
    record(token, units, hold(token, units));
  }

  void end_stage_with(StageToken& token, const StageUnits& units,
                      const std::function<void()>& effect) override {
    const auto paced = hold(token, units);  // a slow device would not have the result earlier
    effect();
    record(token, units, paced);
  }

 private:
  std::optional<PacedStage> hold(const StageToken& token, const StageUnits& units) {
    if (!runtime_.pace_) return {};
    return runtime_.pace_->hold(token.name, units, {.start = token.start, .cpu = token.cpu_start},
                                {.now = [this] { return now(); },
                                 .sleep_until = [this](RunTime when) { sleep_until(when); },
                                 .stopping = [this] { return stopping(); }});
  }

  void record(const StageToken& token, const StageUnits& units,
              const std::optional<PacedStage>& paced) {
    runtime_.observer_.stage({.name = token.name,
                              .worker = name_,
                              .start = token.start,
                              .wall = now() - token.start,
                              .cpu = thread_cpu_time() - token.cpu_start,
                              .units = units,
                              .paced = paced});
  }

  LiveRuntime& runtime_;
  std::string name_;
  LiveSignal alarm_;  ///< never notified, only nudged at the end of the run
};

LiveRuntime::LiveRuntime(Observer& observer, std::optional<PaceOptions> pace)
    : observer_(observer) {
  if (pace) pace_.emplace(std::move(*pace));
}

LiveRuntime::~LiveRuntime() {
  stop();
  try {
    join();
  } catch (...) {  // there is no caller left to report it to
  }
}

void LiveRuntime::set_origin(Duration t0) { origin_ns_ = t0.count(); }

RunTime LiveRuntime::now() const { return monotonic_now() - origin(); }

std::unique_ptr<Signal> LiveRuntime::make_signal() { return std::make_unique<LiveSignal>(*this); }

void LiveRuntime::spawn(std::string name, std::function<void(Worker&)> body) {
  std::lock_guard lock(mutex_);
  threads_.emplace_back([this, name = std::move(name), body = std::move(body)] {
    name_thread(name);
    try {
      LiveWorker worker(*this, name);
      body(worker);
    } catch (...) {
      fail(std::current_exception());
    }
  });
}

void LiveRuntime::stop() {
  stopping_ = true;
  std::lock_guard lock(mutex_);
  for (LiveSignal* signal : signals_) signal->nudge();
}

void LiveRuntime::join() {
  for (;;) {  // a worker may spawn another
    std::vector<std::thread> threads;
    {
      std::lock_guard lock(mutex_);
      threads.swap(threads_);
    }
    if (threads.empty()) break;
    for (auto& thread : threads) thread.join();
  }
  std::lock_guard lock(mutex_);
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
}

void LiveRuntime::enlist(LiveSignal& signal) {
  std::lock_guard lock(mutex_);
  signals_.push_back(&signal);
}

void LiveRuntime::dismiss(LiveSignal& signal) {
  std::lock_guard lock(mutex_);
  std::erase(signals_, &signal);
}

void LiveRuntime::fail(std::exception_ptr error) {
  {
    std::lock_guard lock(mutex_);
    if (!error_) error_ = std::move(error);
  }
  stop();
}

}  // namespace slambed
