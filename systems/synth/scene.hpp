// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "geometry/se3.hpp"
#include "synth/painter.hpp"
#include "synth/texture.hpp"

namespace slambed::synth {

using Vec3 = Eigen::Vector3d;

/// A flat convex polygon, visible only from the side to which its normal (axis_s x axis_t) points.
struct Face {
  Vec3 origin;          ///< where (s, t) = (0, 0), in the body's frame
  Vec3 axis_s, axis_t;  ///< unit vectors
  std::vector<Vec3> corners;
  int texture = 0;
};

/// A body's own motion, body to world, for bodies that do not walk an ellipse.
class Motion {
 public:
  virtual ~Motion() = default;
  virtual SE3 at(double time_s) const = 0;
};

/// A rigid group of faces, which may be skipped while it is out of sight. A moving body follows its
/// own motion or walks an ellipse.
struct Body {
  int first_face = 0, last_face = 0;  ///< [first, last)
  bool moving = false;
  int figure = 0;  ///< labeled person that it is a part of, from 1; 0: none
  std::shared_ptr<const Motion> motion{};
  double from_s = -std::numeric_limits<double>::infinity();  ///< it exists in [from_s, until_s)
  double until_s = std::numeric_limits<double>::infinity();
  Vec3 middle = Vec3::Zero();  ///< center of its bounding sphere, in the body's frame
  double reach_m = 0;          ///< radius of that sphere; 0: always drawn
  Vec3 center = Vec3::Zero();
  double radius_x_m = 0, radius_y_m = 0;
  double period_s = 1, phase = 0;  ///< phase in turns

  /// Returns body to world at a time of the sequence.
  SE3 pose(double time_s) const;
};

/// Axis-aligned box around an object, used to keep camera paths clear of it.
struct Extent {
  Vec3 low, high;
  double distance_m(const Vec3& p) const;
};

/// Light that is baked into the textures: ambient plus lamps below the ceiling, or the sun.
struct Light {
  double ambient = 0.68;
  double lamp_strength = 1.5;
  std::vector<Vec3> lamps;
  Vec3 to_sun = Vec3::Zero();  ///< unit vector
  double sun_strength = 0;
  double at(const Vec3& p, const Vec3& normal) const;
};

/// Faces with their textures. It is built once and then read-only, so rendering threads share it.
class Scene {
 public:
  /// Adds a box rotated by yaw_deg about the vertical axis through the middle of its base.
  void add_box(const Vec3& base_center, const Vec3& size, const Material& material,
               double yaw_deg = 0);
  /// Adds floor, ceiling and four walls that face inwards.
  void add_room(const Vec3& half, double height, const Material& floor, const Material& wall,
                const Material& ceiling);
  /// Adds a vertical prism of `sides` sides with a lid and without a bottom.
  void add_cylinder(const Vec3& base_center, double radius, double height, const Material& material,
                    int sides = 12);
  /// Adds a flat convex polygon. Its corners are counter-clockwise as seen; the first edge is along
  /// s.
  void add_polygon(std::span<const Vec3> corners, const Material& material);
  /// Starts a moving body, which gets all faces added before end_body().
  void begin_body(const Body& motion);
  /// Starts a static body that is skipped outside of [from_s, until_s) and while its bounding
  /// sphere is out of sight.
  void begin_group(double from_s = -std::numeric_limits<double>::infinity(),
                   double until_s = std::numeric_limits<double>::infinity());
  void end_body();
  /// Paints all textures; the result does not depend on the number of threads.
  void finish(const Light& light, std::uint64_t seed, int threads);

  /// Turns culling by bounding spheres off, for tests.
  void draw_everything();
  /// Sets the gray level of pixels without a surface.
  void set_background(float gray) { background_ = gray; }
  float background() const { return background_; }

  const std::vector<Face>& faces() const { return faces_; }
  const std::vector<Texture>& textures() const { return textures_; }
  const std::vector<Body>& bodies() const { return bodies_; }

 private:
  void add_face(const Vec3& origin, const Vec3& edge_s, const Vec3& edge_t,
                const Material& material);
  void paint_face(int face, const Light& light, std::uint64_t seed);

  std::vector<Face> faces_;
  std::vector<Material> materials_;  ///< per face
  std::vector<Texture> textures_;
  std::vector<Body> bodies_;
  bool in_body_ = false;
  float background_ = 0;
};

}  // namespace slambed::synth
