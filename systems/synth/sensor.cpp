// SPDX-License-Identifier: Apache-2.0
#include "synth/sensor.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace slambed::synth {
namespace {

/// Samples per pixel of a still picture. Motion blur gets about one per pixel of motion.
constexpr int kMinSamples = 3;
/// Bands of rows of a rolling shutter, each rendered from one pose.
constexpr int kBands = 16;
/// Gray of a covered lens.
constexpr float kBlackLevel = 3;
/// Relative depth jump that counts as an edge, where a structured-light sensor gives no depth.
constexpr float kEdgeJump = 0.08f;
/// Limit of the slant that still gives depth: about the cosine of the steepest angle.
constexpr float kSlantLimit = 0.09f;
/// Side of the patches without depth, in pixels.
constexpr int kPatch = 16;

std::uint32_t pixel_hash(std::uint64_t frame_seed, std::size_t i) {
  auto x = static_cast<std::uint32_t>(frame_seed) + static_cast<std::uint32_t>(i) * 0x9e3779b9u;
  x = (x ^ (x >> 16)) * 0x7feb352du;
  x = (x ^ (x >> 15)) * 0x846ca68bu;
  return x ^ (x >> 16) ^ static_cast<std::uint32_t>(frame_seed >> 32);
}

/// Imitates the optics by a slight blur with [1 6 1]/8 in both directions.
void soften(std::vector<float>& image, int width, int height) {
  const auto mix3 = [](float a, float b, float c) { return 0.75f * b + 0.125f * (a + c); };
  std::vector<float> line(image.begin(), image.begin() + width);  // the row above, unchanged
  std::vector<float> next(width);
  for (int y = 0; y < height; ++y) {
    float* row = image.data() + static_cast<std::size_t>(y) * width;
    const float* below = y + 1 < height ? row + width : row;
    std::copy_n(row, width, next.begin());
    for (int x = 0; x < width; ++x) row[x] = mix3(line[x], row[x], below[x]);
    std::swap(line, next);
    float left = row[0];
    for (int x = 0; x + 1 < width; ++x) {
      const float here = row[x];
      row[x] = mix3(left, here, row[x + 1]);
      left = here;
    }
  }
}

}  // namespace

SensorModel::SensorModel(std::shared_ptr<const Scene> scene, const Camera& camera,
                         SensorOptions options)
    : renderer_(std::move(scene), camera),
      options_(options),
      lens_(camera, options.flaws.distortion),
      right_rotation_(right_rotation(options.flaws)) {
  sum_.resize(static_cast<std::size_t>(camera.width) * camera.height);
}

Shot SensorModel::capture_rgbd(const CameraPath& path, int frame, double time_s) {
  Shot shot;
  shot.gray = expose(path, frame, time_s, 0, 0);
  renderer_.render_depth(path.at(time_s), time_s, depth_m_);
  if (covered(time_s)) std::fill(depth_m_.begin(), depth_m_.end(), 0.0f);
  shot.depth = measure_depth(frame);
  return shot;
}

Shot SensorModel::capture_stereo(const CameraPath& path, int frame, double time_s) {
  Shot shot;
  shot.gray = expose(path, frame, time_s, 0, 0);
  shot.right = expose(path, frame, time_s, options_.baseline_m, 1);
  return shot;
}

Shot SensorModel::capture_mono(const CameraPath& path, int frame, double time_s) {
  Shot shot;
  shot.gray = expose(path, frame, time_s, 0, 0);
  return shot;
}

std::vector<PersonLabel> SensorModel::label(const CameraPath& path, std::span<const Figure> cast,
                                            double time_s) {
  if (covered(time_s)) return {};
  return label_people(renderer_, cast, path.at(time_s), time_s);
}

bool SensorModel::covered(double time_s) const {
  return time_s >= options_.blackout_start_s && time_s < options_.blackout_end_s;
}

int SensorModel::samples_for(const CameraPath& path, double time_s) const {
  if (options_.motion_blur_s <= 0) return kMinSamples;
  const SE3 a = path.at(time_s - 0.5 * options_.motion_blur_s);
  const SE3 b = path.at(time_s + 0.5 * options_.motion_blur_s);
  // Image motion of a point nearest_m ahead, from rotation and translation.
  const double turn = (a.R.col(2) - b.R.col(2)).norm() + (a.t - b.t).norm() / options_.nearest_m;
  const auto wanted = static_cast<int>(std::ceil(turn * renderer_.camera().fx));
  return std::clamp(wanted, kMinSamples, options_.most_samples);
}

/// Adds one sample per pixel. With a rolling shutter, time_s is that of the middle row.
void SensorModel::expose_sample(const CameraPath& path, double time_s, double baseline_m,
                                double across, double down) {
  const int height = renderer_.camera().height;
  const bool rolling = options_.flaws.readout_s > 0;
  const int bands = rolling ? std::min(kBands, height) : 1;
  for (int band = 0; band < bands; ++band) {
    const int first = height * band / bands, last = height * (band + 1) / bands;
    const double row = 0.5 * (first + last) / height - 0.5;
    const double t = rolling ? time_s + options_.flaws.readout_s * row : time_s;
    SE3 T_wc = path.at(t);
    T_wc.t += baseline_m * T_wc.R.col(0);
    if (baseline_m > 0) T_wc.R = (T_wc.R * right_rotation_).eval();
    renderer_.accumulate_rows(T_wc, t, across, down, first, last, sum_);
  }
}

std::vector<std::uint8_t> SensorModel::expose(const CameraPath& path, int frame, double time_s,
                                              double baseline_m, std::uint32_t stream) {
  const Camera& camera = renderer_.camera();
  const int samples = samples_for(path, time_s);
  std::fill(sum_.begin(), sum_.end(), covered(time_s) ? kBlackLevel : 0.0f);
  if (!covered(time_s)) {
    for (int i = 0; i < samples; ++i) {
      // Times are even over the exposure; offsets in the pixel form a low-discrepancy lattice.
      const double at = (i + 0.5) / samples;
      const double across = at - 0.5, down = 0.618034 * (i + 0.5);
      const double t = time_s + options_.motion_blur_s * (at - 0.5);
      expose_sample(path, t, baseline_m, across, down - std::floor(down) - 0.5);
    }
    const double gain = exposure_gain(options_.flaws, options_.laps, options_.seed, time_s);
    const float share = static_cast<float>(gain) / static_cast<float>(samples);
    for (float& value : sum_) value *= share;
    lens_.bend(sum_);
    soften(sum_, camera.width, camera.height);
  }
  std::vector<std::uint8_t> gray(sum_.size());
  const std::uint64_t seed =
      mix(options_.seed ^ mix(static_cast<std::uint64_t>(frame) * 2 + stream));
  const auto sigma = static_cast<float>(options_.noise * noise_gain(options_.laps, time_s));
  for (std::size_t i = 0; i < gray.size(); ++i) {
    const float noisy = sum_[i] + sigma * bell(pixel_hash(seed, i)) + 0.5f;
    gray[i] = static_cast<std::uint8_t>(std::clamp(noisy, 0.0f, 255.0f));
  }
  return gray;
}

std::vector<std::uint16_t> SensorModel::measure_depth(int frame) const {
  const Camera& camera = renderer_.camera();
  const int width = camera.width, height = camera.height;
  const std::uint64_t seed =
      mix(options_.seed ^ 0xdeb7ull ^ mix(static_cast<std::uint64_t>(frame)));
  const auto noise = static_cast<float>(options_.depth_noise);
  const auto per_m = static_cast<float>(1 / options_.depth_unit_m);
  const auto farthest =
      static_cast<float>(std::min(options_.max_depth_m, 65535 * options_.depth_unit_m));
  const bool holes = options_.depth_holes > 0;
  const auto lost = static_cast<std::uint32_t>(options_.depth_holes * 4294967295.0);
  std::vector<std::uint16_t> raw(depth_m_.size(), 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * width + x;
      float z = depth_m_[i];
      if (z <= 0 || z > farthest) continue;
      if (holes) {
        const float right = depth_m_[x + 1 < width ? i + 1 : i];
        const float below = depth_m_[y + 1 < height ? i + width : i];
        const float jump = std::max(std::abs(right - z), std::abs(below - z));
        if (jump > kEdgeJump * z) continue;
        // Across one pixel a surface at slant angle a changes depth by z tan(a) / f.
        if (jump * static_cast<float>(camera.fx) * kSlantLimit > z) continue;
        // Patches change every 8 frames, so a place stays lost for several frames.
        const std::uint64_t patch = mix(options_.seed + static_cast<std::uint64_t>(frame / 8));
        if (pixel_hash(patch, static_cast<std::size_t>(y / kPatch) * 4096 + x / kPatch) < lost)
          continue;
      }
      if (noise > 0) {
        const float d = z - 0.4f;
        z += noise * (0.0012f + 0.0019f * d * d) * bell(pixel_hash(seed, i));
      }
      raw[i] = static_cast<std::uint16_t>(std::clamp(z * per_m + 0.5f, 0.0f, 65535.0f));
    }
  }
  return raw;
}

}  // namespace slambed::synth
