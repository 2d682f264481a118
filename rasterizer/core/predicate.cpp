#include "rasterizer/core/predicate.h"

namespace halfshade {

Int128 orient3d_exact(const vec3& a, const vec3& b, const vec3& c, const vec3& d) {
  struct Units {
    Int128 x, y, z;
  };
  const auto from_d = [&d](const vec3& p) {
    return Units{lattice_units(p.x) - lattice_units(d.x), lattice_units(p.y) - lattice_units(d.y),
                 lattice_units(p.z) - lattice_units(d.z)};
  };
  const Units u = from_d(a), v = from_d(b), w = from_d(c);
  return u.z * (v.x * w.y - v.y * w.x) + v.z * (w.x * u.y - w.y * u.x) + w.z * (u.x * v.y - u.y * v.x);
}

}  // namespace halfshade
