// SPDX-License-Identifier: Apache-2.0
#include "runtime/virtual/device.hpp"

#include <algorithm>
#include <cmath>

namespace slambed {
namespace {

/// A remainder below 0.1 ns comes from rounding, so the job is done.
constexpr double kDone_ns = 0.1;

}  // namespace

double Device::background_rate() const {
  if (background_ <= 0) return 0;
  const double running = frozen_ ? 0 : static_cast<double>(jobs_.size());
  const double threads = std::ceil(background_);
  return std::min(background_, threads * cores_ / (running + threads));
}

double Device::rate() const {
  if (jobs_.empty() || frozen_) return 0;
  return std::min(1.0, (cores_ - background_rate()) / static_cast<double>(jobs_.size()));
}

Duration Device::cpu_time() const {
  const double running = rate() * static_cast<double>(jobs_.size()) *
                         static_cast<double>((simulator_.now() - updated_).count());
  const double beside =
      background_rate() * static_cast<double>((simulator_.now() - updated_).count());
  return Duration(std::llround(spent_ns_ + running + beside));
}

void Device::advance() {
  const double done = rate() * static_cast<double>((simulator_.now() - updated_).count());
  for (Job& job : jobs_) {
    const double step = std::min(done, job.remaining_ns);
    job.remaining_ns -= step;
    spent_ns_ += step;
  }
  spent_ns_ += background_rate() * static_cast<double>((simulator_.now() - updated_).count());
  updated_ = simulator_.now();
}

void Device::plan() {
  const std::uint64_t plan = ++plan_;
  if (jobs_.empty() || frozen_) return;
  const auto next = std::min_element(jobs_.begin(), jobs_.end(), [](const Job& a, const Job& b) {
    return a.remaining_ns < b.remaining_ns;
  });
  const auto wait = Duration(static_cast<std::int64_t>(std::ceil(next->remaining_ns / rate())));
  simulator_.at(simulator_.now() + wait, [this, plan] {
    if (plan != plan_) return;
    advance();
    for (auto job = jobs_.begin(); job != jobs_.end();) {
      if (job->remaining_ns > kDone_ns) {
        ++job;
        continue;
      }
      simulator_.resume(*job->task);
      job = jobs_.erase(job);
    }
    this->plan();
  });
}

void Device::freeze(bool frozen) {
  advance();
  frozen_ = frozen;
  plan();
}

void Device::execute(Task& task, Duration work) {
  if (work <= Duration::zero()) return;
  advance();
  jobs_.push_back({&task, static_cast<double>(work.count())});
  plan();
  try {
    task.suspend();
  } catch (const SimulationOver&) {
    // Must not leave end_stage, which runs in a destructor. The task's next wait unwinds it.
  }
}

}  // namespace slambed
