// SPDX-License-Identifier: Apache-2.0
#include "synth/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "synth/texture_filter.hpp"

namespace slambed::synth {
namespace {

constexpr double kNear_m = 0.03;
constexpr int kMaxCorners = 32;

struct Pixel {
  double x, y;
};

/// Clips a polygon in camera coordinates at the near plane. Returns the number of its corners.
int clip_near(const Vec3* in, int n, Vec3* out) {
  int kept = 0;
  for (int i = 0; i < n; ++i) {
    const Vec3 &a = in[i], &b = in[(i + 1) % n];
    const bool a_in = a.z() >= kNear_m, b_in = b.z() >= kNear_m;
    if (a_in) out[kept++] = a;
    if (a_in != b_in) {
      // Always interpolate from the near to the far end, so that adjacent faces get the same point.
      const Vec3 &near = a_in ? b : a, &far = a_in ? a : b;
      out[kept++] = near + (far - near) * ((kNear_m - near.z()) / (far.z() - near.z()));
    }
  }
  return kept;
}

}  // namespace

Renderer::Renderer(std::shared_ptr<const Scene> scene, const Camera& camera)
    : scene_(std::move(scene)), camera_(camera) {
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * camera.height;
  inverse_depth_.resize(pixels);
  face_at_.resize(pixels);
  last_row_ = camera.height;
}

void Renderer::accumulate(const SE3& T_wc, double time_s, double offset_x_px, double offset_y_px,
                          std::vector<float>& gray) {
  rasterize(T_wc, time_s, offset_x_px, offset_y_px);
  shade(gray);
}

void Renderer::accumulate_rows(const SE3& T_wc, double time_s, double offset_x_px,
                               double offset_y_px, int first_row, int last_row,
                               std::vector<float>& gray) {
  first_row_ = first_row;
  last_row_ = last_row;
  accumulate(T_wc, time_s, offset_x_px, offset_y_px, gray);
  first_row_ = 0;
  last_row_ = camera_.height;
}

void Renderer::render_depth(const SE3& T_wc, double time_s, std::vector<float>& depth_m) {
  rasterize(T_wc, time_s, 0, 0);
  depth_m.resize(inverse_depth_.size());
  for (std::size_t i = 0; i < depth_m.size(); ++i)
    depth_m[i] = inverse_depth_[i] > 0 ? 1 / inverse_depth_[i] : 0;
}

Renderer::FigureView Renderer::render_figures(const SE3& T_wc, double time_s) {
  FigureView view;
  render_depth(T_wc, time_s, view.depth_m);
  for (const std::uint16_t id : face_at_)
    view.figure_at.push_back(id == 0 ? std::uint16_t{0} : planes_[id - 1].figure);
  return view;
}

Picture Renderer::render(const SE3& T_wc, double time_s) {
  Picture picture{camera_.width, camera_.height, std::vector<float>(inverse_depth_.size()), {}};
  render_depth(T_wc, time_s, picture.depth_m);
  shade(picture.gray);
  return picture;
}

void Renderer::rasterize(const SE3& T_wc, double time_s, double offset_x, double offset_y) {
  const auto first = static_cast<std::ptrdiff_t>(first_row_) * camera_.width;
  const auto last = static_cast<std::ptrdiff_t>(last_row_) * camera_.width;
  std::fill(inverse_depth_.begin() + first, inverse_depth_.begin() + last, 0.0f);
  std::fill(face_at_.begin() + first, face_at_.begin() + last, std::uint16_t{0});
  planes_.clear();
  const SE3 T_cw = T_wc.inverse();
  for (const Body& body : scene_->bodies()) {
    const SE3 T_cb = body.moving ? T_cw * body.pose(time_s) : T_cw;
    if (!in_sight(body, T_cb, time_s)) continue;
    for (int i = body.first_face; i < body.last_face; ++i)
      draw_face(scene_->faces()[i], body.figure, T_cb, offset_x, offset_y);
  }
}

/// Returns whether a body exists at this time and its bounding sphere reaches into the drawn rows.
bool Renderer::in_sight(const Body& body, const SE3& T_cb, double time_s) const {
  if (time_s < body.from_s || time_s >= body.until_s) return false;
  if (body.reach_m == 0) return true;
  const Vec3 p = T_cb * body.middle;
  const double reach = body.reach_m;
  if (p.z() < -reach) return false;
  // Four planes through the camera center, with a margin of one pixel for sample offsets.
  const double left = (camera_.cx + 1) / camera_.fx;
  const double right = (camera_.width - camera_.cx) / camera_.fx;
  const double above = (camera_.cy + 1 - first_row_) / camera_.fy;
  const double below = (last_row_ - camera_.cy) / camera_.fy;
  const auto outside = [&](double beyond, double slope) {
    return beyond - slope * p.z() > reach * std::sqrt(1 + slope * slope);
  };
  return !outside(-p.x(), left) && !outside(p.x(), right) && !outside(-p.y(), above) &&
         !outside(p.y(), below);
}

void Renderer::draw_face(const Face& face, int figure, const SE3& T_cb, double offset_x,
                         double offset_y) {
  const Vec3 o = T_cb * face.origin;
  const Vec3 a = T_cb.R * face.axis_s, b = T_cb.R * face.axis_t;
  const Vec3 normal = a.cross(b);
  const double det = o.dot(normal);  // negative if the camera is in front of the plane
  if (det > -1e-6) return;

  Vec3 corners[kMaxCorners], clipped[kMaxCorners];
  const int n = static_cast<int>(face.corners.size());
  for (int i = 0; i < n; ++i) corners[i] = T_cb * face.corners[i];
  const int kept = clip_near(corners, n, clipped);
  if (kept < 3) return;
  Pixel polygon[kMaxCorners];
  double low_x = 1e9, high_x = -1e9, low_y = 1e9, high_y = -1e9;
  const double cx = camera_.cx - offset_x, cy = camera_.cy - offset_y;
  for (int i = 0; i < kept; ++i) {
    const double inverse = 1 / clipped[i].z();
    polygon[i] = {camera_.fx * clipped[i].x() * inverse + cx,
                  camera_.fy * clipped[i].y() * inverse + cy};
    low_x = std::min(low_x, polygon[i].x);
    high_x = std::max(high_x, polygon[i].x);
    low_y = std::min(low_y, polygon[i].y);
    high_y = std::max(high_y, polygon[i].y);
  }
  if (high_x < 0 || low_x > camera_.width - 1 || high_y < first_row_ || low_y > last_row_ - 1)
    return;

  // A point o + s a + t b = z d on the pixel's ray d gives (s/z, t/z, 1/z) = [a b o]^-1 d.
  const Vec3 rows[3] = {b.cross(o) / det, o.cross(a) / det, normal / det};
  Plane plane;
  const double per_m = scene_->textures()[face.texture].texels_per_m();
  const double scale[3] = {per_m, per_m, 1};
  float* coefficients[3] = {plane.s, plane.t, plane.w};
  for (int k = 0; k < 3; ++k) {
    const double dx = rows[k].x() / camera_.fx, dy = rows[k].y() / camera_.fy;
    coefficients[k][0] = static_cast<float>(scale[k] * (rows[k].z() - dx * cx - dy * cy));
    coefficients[k][1] = static_cast<float>(scale[k] * dx);
    coefficients[k][2] = static_cast<float>(scale[k] * dy);
  }
  plane.texture = face.texture;
  plane.figure = static_cast<std::uint16_t>(figure);
  if (planes_.size() == std::numeric_limits<std::uint16_t>::max())
    throw bad_input("more than 65,535 faces in one picture; leave some things out");
  planes_.push_back(plane);
  const auto id = static_cast<std::uint16_t>(planes_.size());

  const int y_begin = std::max(first_row_, static_cast<int>(std::ceil(low_y)));
  const int y_end = std::min(last_row_ - 1, static_cast<int>(std::floor(high_y)));
  for (int y = y_begin; y <= y_end; ++y) {
    double left = 1e9, right = -1e9;
    for (int i = 0; i < kept; ++i) {
      const Pixel &p = polygon[i], &q = polygon[(i + 1) % kept];
      // Lower end first, so that both faces at an edge get the same crossing.
      const Pixel &up = p.y < q.y ? p : q, &down = p.y < q.y ? q : p;
      if (y < up.y || y >= down.y) continue;
      const double x = up.x + (down.x - up.x) * ((y - up.y) / (down.y - up.y));
      left = std::min(left, x);
      right = std::max(right, x);
    }
    if (left > right) continue;
    const int begin = std::max(0, static_cast<int>(std::ceil(std::max(left, -1.0))));
    const int end = static_cast<int>(std::ceil(std::min(right, camera_.width + 0.0)));
    const float w0 = plane.w[0] + plane.w[2] * static_cast<float>(y), w1 = plane.w[1];
    float* depth = inverse_depth_.data() + static_cast<std::size_t>(y) * camera_.width;
    std::uint16_t* ids = face_at_.data() + static_cast<std::size_t>(y) * camera_.width;
    for (int x = begin; x < end; ++x) {
      const float w = w0 + w1 * static_cast<float>(x);
      const bool nearer = w > depth[x];
      depth[x] = nearer ? w : depth[x];
      ids[x] = nearer ? id : ids[x];
    }
  }
}

void Renderer::shade(std::vector<float>& gray) const {
  for (int y = first_row_; y < last_row_; ++y) {
    const std::uint16_t* ids = face_at_.data() + static_cast<std::size_t>(y) * camera_.width;
    float* out = gray.data() + static_cast<std::size_t>(y) * camera_.width;
    for (int begin = 0; begin < camera_.width;) {
      int end = begin + 1;
      while (end < camera_.width && ids[end] == ids[begin]) ++end;
      if (ids[begin] != 0)
        shade_run(planes_[ids[begin] - 1], y, begin, end, out);
      else if (scene_->background() > 0)
        for (int x = begin; x < end; ++x) out[x] += scene_->background();
      begin = end;
    }
  }
}

void Renderer::shade_run(const Plane& p, int y, int begin, int end, float* out) const {
  const TextureFilter filter(scene_->textures()[p.texture]);
  const auto fy = static_cast<float>(y);
  const float w0 = p.w[0] + p.w[2] * fy, s0 = p.s[0] + p.s[2] * fy, t0 = p.t[0] + p.t[2] * fy;
  for (int x = begin; x < end; ++x) {
    const auto fx = static_cast<float>(x);
    const float z = 1 / (w0 + p.w[1] * fx);
    const float s = (s0 + p.s[1] * fx) * z, t = (t0 + p.t[1] * fx) * z;
    const Footprint footprint{(p.s[1] - s * p.w[1]) * z, (p.t[1] - t * p.w[1]) * z,
                              (p.s[2] - s * p.w[2]) * z, (p.t[2] - t * p.w[2]) * z};
    out[x] += filter.read(s, t, footprint);
  }
}

}  // namespace slambed::synth
