// SPDX-License-Identifier: Apache-2.0
#include "features/orb_extractor.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.hpp"
#include "base/portable_math.hpp"
#include "features/corner_detector.hpp"
#include "features/corner_selector.hpp"
#include "features/kernels.hpp"
#include "features/orb_pattern.hpp"
#include "features/orientation.hpp"
#include "features/pyramid.hpp"

namespace slambed {
namespace {

/// Keeps every coordinate within 16 bits and every row offset within 32 bits.
constexpr int kMaxSide = 16384;
/// Descriptors read this far beyond the image, px.
constexpr int kBlurRim = kPatternReach - DetectionRegion::kMargin;
static_assert(kBlurRim + kBlurRadius <= PaddedPlane::kBorder);

void check(const OrbOptions& o) {
  const auto refuse = [](const std::string& what) { throw bad_input("orb options: " + what); };
  if (o.features < 1 || o.features > 60000) refuse("features must be in 1..60000");
  if (o.levels < 1 || o.levels > 32) refuse("levels must be in 1..32");
  if (!(o.scale_factor > 1.0f && o.scale_factor <= 2.0f)) refuse("scale_factor must be in (1, 2]");
  if (o.fast_threshold_min < 1 || o.fast_threshold > 254 || o.fast_threshold_min > o.fast_threshold)
    refuse("need 1 <= fast_threshold_min <= fast_threshold <= 254");
}

/// Returns a geometric series over the levels that sums to options.features; the last level gets
/// the rest.
std::vector<int> level_quotas(const OrbOptions& o) {
  const double shrink = 1.0 / o.scale_factor;
  double wanted = o.features * (1 - shrink) / (1 - portable::power(shrink, o.levels));
  std::vector<int> quotas;
  int total = 0;
  for (int i = 0; i + 1 < o.levels; ++i, wanted *= shrink) {
    quotas.push_back(std::min(static_cast<int>(std::lround(wanted)), o.features - total));
    total += quotas.back();
  }
  quotas.push_back(o.features - total);
  return quotas;
}

OrbOptions checked(const OrbOptions& options) {
  check(options);
  return options;
}

}  // namespace

ScalePyramid::ScalePyramid(const OrbOptions& options) {
  check(options);
  float s = 1;
  for (int i = 0; i < options.levels; ++i, s *= options.scale_factor) {
    scale.push_back(s);
    sigma2.push_back(s * s);
    inv_sigma2.push_back(1 / (s * s));
  }
  log_scale_factor = static_cast<float>(portable::log(options.scale_factor));
}

struct OrbExtractor::Impl {
  Impl(const OrbOptions& o, const Kernels& k)
      : options(checked(o)),
        kernels(k),
        quotas(level_quotas(o)),
        pyramid(ScalePyramid(o).scale, k),
        detector(o.fast_threshold, o.fast_threshold_min, k),
        selector(o.distribution) {
    for (int i = 0; i < 256; ++i) {
      pattern.x[2 * i] = kOrbPattern[i].ax;
      pattern.y[2 * i] = kOrbPattern[i].ay;
      pattern.x[2 * i + 1] = kOrbPattern[i].bx;
      pattern.y[2 * i + 1] = kOrbPattern[i].by;
    }
  }

  void blur(GrayView level);
  void describe_level(int octave, GrayView image, std::vector<RawKeyPoint>& keypoints,
                      std::vector<Descriptor>& descriptors);
  void prepare(int width, int height);

  OrbOptions options;
  const Kernels& kernels;
  std::vector<int> quotas;
  ImagePyramid pyramid;
  CornerDetector detector;
  CornerSelector selector;
  PatternPoints pattern{};
  std::vector<Corner> corners;
  PaddedPlane blurred;  ///< of the current level
  std::vector<std::uint8_t> blur_scratch;
  int width = 0, height = 0;
};

void OrbExtractor::Impl::prepare(int w, int h) {
  width = w;
  height = h;
  blurred.resize(w, h);
  blur_scratch.assign(kBlurScratchRows * (w + 2 * kBlurRim + 2 * kBlurRadius + kKernelSlack), 0);
  // Suppression leaves at most one corner in any 2x2 pixels.
  const std::size_t most = static_cast<std::size_t>(w / 2 + 1) * (h / 2 + 1);
  corners.reserve(most);
  selector.reserve(most, *std::max_element(quotas.begin(), quotas.end()));
}

void OrbExtractor::Impl::blur(GrayView level) {
  kernels.blur(level.row(-kBlurRim) - kBlurRim, level.stride, level.width + 2 * kBlurRim,
               level.height + 2 * kBlurRim, blur_scratch.data(), blurred.row(-kBlurRim) - kBlurRim,
               blurred.view().stride);
}

/// Appends the keypoints and descriptors of one level. The center of pixel x of a level is at
/// (x + 0.5) * ratio - 0.5 on level 0, with the actual ratio of the rounded level sizes.
void OrbExtractor::Impl::describe_level(int octave, GrayView image,
                                        std::vector<RawKeyPoint>& keypoints,
                                        std::vector<Descriptor>& descriptors) {
  const GrayView level = pyramid.level(octave);
  const GrayView smooth = blurred.view();
  const float ratio_x = static_cast<float>(image.width) / static_cast<float>(level.width);
  const float ratio_y = static_cast<float>(image.height) / static_cast<float>(level.height);
  for (const Corner& corner : corners) {
    const Orientation o =
        orientation_of(kernels.moments(&level.at(corner.x, corner.y), level.stride));
    RawKeyPoint point;
    const float x = options.subpixel ? corner.subpixel_x() : static_cast<float>(corner.x);
    const float y = options.subpixel ? corner.subpixel_y() : static_cast<float>(corner.y);
    point.x = (x + 0.5f) * ratio_x - 0.5f;
    point.y = (y + 0.5f) * ratio_y - 0.5f;
    point.angle_deg = o.angle_deg;
    point.octave = static_cast<std::uint8_t>(octave);
    point.response = corner.response;
    keypoints.push_back(point);
    kernels.describe(&smooth.at(corner.x, corner.y), smooth.stride, pattern, o.cosine, o.sine,
                     descriptors.emplace_back().data());
  }
}

OrbExtractor::OrbExtractor(const OrbOptions& options) : OrbExtractor(options, fastest_kernels()) {}
OrbExtractor::OrbExtractor(const OrbOptions& options, const Kernels& kernels)
    : impl_(std::make_unique<Impl>(options, kernels)) {}
OrbExtractor::~OrbExtractor() = default;
OrbExtractor::OrbExtractor(OrbExtractor&&) noexcept = default;

void OrbExtractor::extract(GrayView image, std::vector<RawKeyPoint>& keypoints,
                           std::vector<Descriptor>& descriptors) {
  Impl& self = *impl_;
  if (image.width > kMaxSide || image.height > kMaxSide)
    throw bad_input("orb extractor: image of " + std::to_string(image.width) + "x" +
                    std::to_string(image.height) + " px, use at most " + std::to_string(kMaxSide) +
                    " px a side");
  keypoints.clear();
  descriptors.clear();
  if (image.data == nullptr || image.width <= 0 || image.height <= 0) return;
  if (image.width != self.width || image.height != self.height)
    self.prepare(image.width, image.height);
  const std::size_t most = self.options.features + 3 * self.quotas.size();
  keypoints.reserve(most);
  descriptors.reserve(most);
  self.pyramid.build(image);
  for (int octave = 0; octave < self.pyramid.levels(); ++octave) {
    const GrayView level = self.pyramid.level(octave);
    self.detector.detect(level, self.corners);
    self.selector.select(DetectionRegion(level), self.quotas[octave], self.corners);
    if (self.corners.empty()) continue;
    self.blur(level);
    self.describe_level(octave, image, keypoints, descriptors);
  }
}

const OrbOptions& OrbExtractor::options() const { return impl_->options; }
const std::vector<int>& OrbExtractor::quotas() const { return impl_->quotas; }
const ImagePyramid& OrbExtractor::pyramid() const { return impl_->pyramid; }

}  // namespace slambed
