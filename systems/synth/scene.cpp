// SPDX-License-Identifier: Apache-2.0
#include "synth/scene.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

namespace slambed::synth {
namespace {

constexpr int kLightStepTexels = 16;  ///< grid of the light, which is interpolated in between

}  // namespace

SE3 Body::pose(double time_s) const {
  if (!moving) return {};
  if (motion) return motion->at(time_s);
  const SinCos a = sincos_turns(time_s / period_s + phase);
  // The body faces along the tangent of the ellipse.
  Vec3 ahead(-radius_x_m * a.sin, radius_y_m * a.cos, 0);
  ahead /= ahead.norm();
  Eigen::Matrix3d R;
  R << ahead.x(), -ahead.y(), 0, ahead.y(), ahead.x(), 0, 0, 0, 1;
  return {R, center + Vec3(radius_x_m * a.cos, radius_y_m * a.sin, 0)};
}

double Extent::distance_m(const Vec3& p) const {
  const Vec3 outside = (low - p).cwiseMax(p - high).cwiseMax(0.0);
  return outside.norm();
}

double Light::at(const Vec3& p, const Vec3& normal) const {
  double sum = ambient;
  if (sun_strength > 0) sum += sun_strength * std::max(0.0, normal.dot(to_sun));
  for (const Vec3& lamp : lamps) {
    const Vec3 to = lamp - p;
    const double d2 = to.squaredNorm();
    const double facing = normal.dot(to) / std::sqrt(d2);
    if (facing > 0) sum += lamp_strength * facing / (1.5 + d2);
  }
  return sum;
}

void Scene::add_face(const Vec3& origin, const Vec3& edge_s, const Vec3& edge_t,
                     const Material& material) {
  Face face;
  face.origin = origin;
  const double width = edge_s.norm(), height = edge_t.norm();
  face.axis_s = edge_s / width;
  face.axis_t = edge_t / height;
  face.corners = {origin, origin + edge_s, origin + edge_s + edge_t, origin + edge_t};
  face.texture = static_cast<int>(textures_.size());
  textures_.emplace_back(width, height, material.texel_m);
  materials_.push_back(material);
  faces_.push_back(std::move(face));
  if (!in_body_) {
    if (bodies_.empty() || bodies_.back().moving || bodies_.back().reach_m > 0)
      bodies_.push_back({.first_face = static_cast<int>(faces_.size()) - 1});
    bodies_.back().last_face = static_cast<int>(faces_.size());
  }
}

void Scene::add_box(const Vec3& base_center, const Vec3& size, const Material& material,
                    double yaw_deg) {
  const SinCos yaw = sincos_deg(yaw_deg);
  const Vec3 x = Vec3(yaw.cos, yaw.sin, 0) * size.x();
  const Vec3 y = Vec3(-yaw.sin, yaw.cos, 0) * size.y();
  const Vec3 z(0, 0, size.z());
  const Vec3 o = base_center - 0.5 * x - 0.5 * y;
  add_face(o + z, x, y, material);       // top
  add_face(o + y, x, -y, material);      // bottom
  add_face(o, x, z, material);           // -y
  add_face(o + x + y, -x, z, material);  // +y
  add_face(o + y, -y, z, material);      // -x
  add_face(o + x, y, z, material);       // +x
}

void Scene::add_room(const Vec3& half, double height, const Material& floor, const Material& wall,
                     const Material& ceiling) {
  const Vec3 x(2 * half.x(), 0, 0), y(0, 2 * half.y(), 0), z(0, 0, height);
  const Vec3 o(-half.x(), -half.y(), 0);
  add_face(o, x, y, floor);
  add_face(o + z + y, x, -y, ceiling);
  add_face(o + x, -x, z, wall);      // wall at -y, seen from +y
  add_face(o + y, x, z, wall);       // wall at +y
  add_face(o, y, z, wall);           // wall at -x
  add_face(o + x + y, -y, z, wall);  // wall at +x
}

void Scene::add_cylinder(const Vec3& base_center, double radius, double height,
                         const Material& material, int sides) {
  std::vector<Vec3> ring;
  for (int i = 0; i < sides; ++i) {
    const SinCos a = sincos_turns(static_cast<double>(i) / sides);
    ring.push_back(base_center + radius * Vec3(a.cos, a.sin, 0));
  }
  const Vec3 up(0, 0, height);
  for (int i = 0; i < sides; ++i) add_face(ring[i], ring[(i + 1) % sides] - ring[i], up, material);
  // The lid is the square around the circle, clipped to the ring.
  add_face(base_center + up - radius * Vec3(1, 1, 0), Vec3(2 * radius, 0, 0),
           Vec3(0, 2 * radius, 0), material);
  for (Vec3& corner : ring) corner += up;
  faces_.back().corners = std::move(ring);
}

void Scene::add_polygon(std::span<const Vec3> corners, const Material& material) {
  const Vec3 along = (corners[1] - corners[0]).normalized();
  const Vec3 normal = along.cross(corners[2] - corners[0]).normalized();
  const Vec3 up = normal.cross(along);
  double low_s = 0, high_s = 0, high_t = 0;  // no corner lies below the first edge
  for (const Vec3& corner : corners) {
    const Vec3 d = corner - corners[0];
    low_s = std::min(low_s, d.dot(along));
    high_s = std::max(high_s, d.dot(along));
    high_t = std::max(high_t, d.dot(up));
  }
  add_face(corners[0] + low_s * along, (high_s - low_s) * along, high_t * up, material);
  faces_.back().corners.assign(corners.begin(), corners.end());
}

void Scene::begin_group(double from_s, double until_s) {
  bodies_.push_back({.first_face = static_cast<int>(faces_.size())});
  bodies_.back().from_s = from_s;
  bodies_.back().until_s = until_s;
  in_body_ = true;
}

void Scene::begin_body(const Body& motion) {
  bodies_.push_back(motion);
  bodies_.back().moving = true;
  bodies_.back().first_face = static_cast<int>(faces_.size());
  in_body_ = true;
}

void Scene::end_body() {
  Body& body = bodies_.back();
  body.last_face = static_cast<int>(faces_.size());
  in_body_ = false;
  if (body.moving && !body.motion) return;  // box figures in rooms are always near: never culled
  Vec3 low = Vec3::Constant(1e9), high = Vec3::Constant(-1e9);
  for (int i = body.first_face; i < body.last_face; ++i)
    for (const Vec3& corner : faces_[i].corners) {
      low = low.cwiseMin(corner);
      high = high.cwiseMax(corner);
    }
  body.middle = 0.5 * (low + high);
  body.reach_m = 0.5 * (high - low).norm();
}

void Scene::draw_everything() {
  for (Body& body : bodies_) body.reach_m = 0;
}

void Scene::paint_face(int i, const Light& light, std::uint64_t seed) {
  const Face& face = faces_[i];
  Texture& texture = textures_[face.texture];
  paint(texture, materials_[i], Random(seed, static_cast<std::uint64_t>(i)));
  const Vec3 normal = face.axis_s.cross(face.axis_t);
  const double texel_m = 1 / texture.texels_per_m();
  const int columns = texture.width() / kLightStepTexels + 2;
  std::vector<float> above(columns), below(columns);
  const auto fill = [&](std::vector<float>& line, int y) {
    for (int c = 0; c < columns; ++c)
      line[c] =
          static_cast<float>(light.at(face.origin + face.axis_s * (c * kLightStepTexels * texel_m) +
                                          face.axis_t * (y * texel_m),
                                      normal));
  };
  for (int y = 0; y < texture.height(); ++y) {
    if (y % kLightStepTexels == 0) {
      fill(above, y);
      fill(below, y + kLightStepTexels);
    }
    const float down = static_cast<float>(y % kLightStepTexels) / kLightStepTexels;
    std::uint8_t* row = texture.row(y);
    for (int c = 0; c * kLightStepTexels < texture.width(); ++c) {
      const float left = above[c] + (below[c] - above[c]) * down;
      const float right = above[c + 1] + (below[c + 1] - above[c + 1]) * down;
      const int begin = c * kLightStepTexels;
      const int end = std::min(texture.width(), begin + kLightStepTexels);
      for (int x = begin; x < end; ++x) {
        const float gain = left + (right - left) * static_cast<float>(x - begin) / kLightStepTexels;
        row[x] = static_cast<std::uint8_t>(std::min(253.0f, row[x] * gain));
      }
    }
  }
  texture.finish();
}

void Scene::finish(const Light& light, std::uint64_t seed, int threads) {
  std::atomic<int> next = 0;
  const auto work = [&] {
    for (int i = next++; i < static_cast<int>(faces_.size()); i = next++)
      paint_face(i, light, seed);
  };
  std::vector<std::jthread> pool;
  for (int t = 1; t < threads; ++t) pool.emplace_back(work);
  work();
}

}  // namespace slambed::synth
