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

/// A flat convex polygon, visible from the side that its normal (axis_s x axis_t) points to.
struct Face {
  Vec3 origin;          ///< where (s, t) = (0, 0), in the body's frame
  Vec3 axis_s, axis_t;  ///< unit vectors
  std::vector<Vec3> corners;
  int texture = 0;
};

/// How a body moves that walks no ellipse: body to world.
class Motion {
 public:
  virtual ~Motion() = default;
  virtual SE3 at(double time_s) const = 0;
};

/// A rigid group of faces. Static things are one body at rest, or several, each drawn only where
/// and while it can be seen; a moving one walks an ellipse or has a motion of its own.
struct Body {
  int first_face = 0, last_face = 0;  ///< [first, last)
  bool moving = false;
  int figure = 0;  ///< the person that it is a part of, from 1; 0: none that is labeled
  std::shared_ptr<const Motion> motion{};
  double from_s = -std::numeric_limits<double>::infinity();  ///< there from here ...
  double until_s = std::numeric_limits<double>::infinity();  ///< ... to here
  Vec3 middle = Vec3::Zero();  ///< of a ball around its corners, in the body's frame
  double reach_m = 0;          ///< radius of that ball; 0: drawn without asking
  Vec3 center = Vec3::Zero();
  double radius_x_m = 0, radius_y_m = 0;
  double period_s = 1, phase = 0;  ///< phase in turns

  /// Body to world at a time of the sequence.
  SE3 pose(double time_s) const;
};

/// Axis-aligned box of a piece of furniture, to keep camera paths out of it.
struct Extent {
  Vec3 low, high;
  double distance_m(const Vec3& p) const;
};

/// Light, baked into the textures: ambient plus lamps below the ceiling, or the sun.
struct Light {
  double ambient = 0.68;
  double lamp_strength = 1.5;
  std::vector<Vec3> lamps;
  Vec3 to_sun = Vec3::Zero();  ///< unit vector
  double sun_strength = 0;
  double at(const Vec3& p, const Vec3& normal) const;
};

/// Faces with their textures. Built once, then only read; rendering threads share it.
class Scene {
 public:
  /// A box turned by yaw (degrees) about the vertical through the middle of its base.
  void add_box(const Vec3& base_center, const Vec3& size, const Material& material,
               double yaw_deg = 0);
  /// Faces pointing inwards: floor, ceiling, four walls.
  void add_room(const Vec3& half, double height, const Material& floor, const Material& wall,
                const Material& ceiling);
  /// A vertical prism of many sides.
  void add_cylinder(const Vec3& base_center, double radius, double height, const Material& material,
                    int sides = 12);
  /// A flat convex polygon with corners counter-clockwise as seen; the first edge is along s.
  void add_polygon(std::span<const Vec3> corners, const Material& material);
  /// Faces added from now on until end_body belong to one moving body.
  void begin_body(const Body& motion);
  /// The same at rest, skipped where its ball is out of sight and outside of its times.
  void begin_group(double from_s = -std::numeric_limits<double>::infinity(),
                   double until_s = std::numeric_limits<double>::infinity());
  void end_body();
  /// Paints all textures; the result does not depend on the number of threads.
  void finish(const Light& light, std::uint64_t seed, int threads);

  /// Leaves nothing out for being out of sight: for tests.
  void draw_everything();
  /// Gray where nothing is.
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
