// SPDX-License-Identifier: Apache-2.0
#include "run/virtual_sampler.hpp"

namespace slambed {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(100);

}  // namespace

VirtualSampler::VirtualSampler(Simulator& simulator, std::vector<SampledNode> nodes,
                               const std::filesystem::path& path)
    : simulator_(simulator), nodes_(std::move(nodes)), last_cpu_(nodes_.size()), file_(path) {
  plan();
}

void VirtualSampler::plan() {
  simulator_.at_background(simulator_.now() + kPeriod, [this] {
    sample();
    plan();
  });
}

void VirtualSampler::sample() {
  const RunTime now = simulator_.now();
  if (now <= last_) return;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Duration cpu = nodes_[i].runtime->cpu_time();
    const double percent = 100 * to_seconds(cpu - last_cpu_[i]) / to_seconds(now - last_);
    file_.print(
        "{\"t_s\": %.9f, \"node\": \"%s\", \"cpu_s\": %.9f, \"cpu_percent\": %.6f, "
        "\"memory_mb\": null, \"throttled_s\": null, \"throttled_periods\": null}\n",
        to_seconds(now), nodes_[i].name.c_str(), to_seconds(cpu), percent);
    last_cpu_[i] = cpu;
  }
  last_ = now;
}

void VirtualSampler::finish() {
  sample();
  file_.flush();
}

}  // namespace slambed
