// SPDX-License-Identifier: Apache-2.0
#include "geometry/pnp_ransac.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/portable_math.hpp"
#include "geometry/p3p.hpp"
#include "geometry/random_sample.hpp"

namespace slambed {
namespace {

double chi2(const Camera& camera, const SE3& T_cw, const PnpCorrespondence& match) {
  const Eigen::Vector3d p_c = T_cw * match.p_w;
  if (!(p_c.z() > 0)) return INFINITY;
  const Eigen::Vector2d pixel = camera.project(p_c);
  const double du = pixel.x() - match.u, dv = pixel.y() - match.v;
  return (du * du + dv * dv) / match.sigma2;
}

int count_inliers(const Camera& camera, const SE3& T_cw, std::span<const PnpCorrespondence> matches,
                  double limit, std::vector<std::uint8_t>& inlier) {
  int count = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    inlier[i] = chi2(camera, T_cw, matches[i]) <= limit;
    count += inlier[i];
  }
  return count;
}

/// Returns how many samples contain an all-inlier one with probability options.confidence.
int samples_needed(double inlier_share, const PnpOptions& options) {
  const double all_good = portable::power(inlier_share, 4);
  if (all_good >= 1) return 1;
  if (all_good <= 0) return options.max_iterations;
  const double needed = portable::log(1 - options.confidence) / portable::log1p(-all_good);
  return static_cast<int>(std::min<double>(options.max_iterations, std::ceil(needed)));
}

}  // namespace

std::optional<PnpResult> solve_pnp_ransac(const Camera& camera,
                                          std::span<const PnpCorrespondence> matches,
                                          const PnpOptions& options) {
  if (matches.size() < 4) return std::nullopt;
  PnpResult best;
  std::vector<std::uint8_t> inlier(matches.size());
  SplitMix64 random(options.seed);
  int limit = options.max_iterations;
  for (int iteration = 0; iteration < limit; ++iteration) {
    const auto sample = draw_sample<4>(random, matches.size());
    std::array<Eigen::Vector3d, 3> points, directions;
    for (int i = 0; i < 3; ++i) {
      const PnpCorrespondence& match = matches[sample[i]];
      points[i] = match.p_w;
      directions[i] = camera.unproject(match.u, match.v, 1).normalized();
    }
    const auto poses = solve_p3p(points, directions);
    const auto chosen =
        std::min_element(poses.begin(), poses.end(), [&](const SE3& a, const SE3& b) {
          return chi2(camera, a, matches[sample[3]]) < chi2(camera, b, matches[sample[3]]);
        });
    if (chosen == poses.end()) continue;
    const int count = count_inliers(camera, *chosen, matches, options.chi2_limit, inlier);
    if (count <= best.inliers) continue;
    best = {*chosen, inlier, count};
    const double share = static_cast<double>(count) / static_cast<double>(matches.size());
    limit = std::min(limit, std::max(iteration + 1, samples_needed(share, options)));
  }
  if (best.inliers < options.min_inliers) return std::nullopt;
  return best;
}

}  // namespace slambed
