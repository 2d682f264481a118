#include "shadows/crossing.h"

namespace halfshade {
namespace {

/// Sign of the first component of (a-r) x (b-r) that is not zero: how the determinant changes when l moves along x,
/// then y, then z. Products of differences stay below 2^81.
int moved_sign(const vec3& a, const vec3& b, const vec3& r) {
  std::array<Int128, 3> p, q;
  for (int k = 0; k < 3; ++k) {
    p[k] = lattice_units(a[k]) - lattice_units(r[k]);
    q[k] = lattice_units(b[k]) - lattice_units(r[k]);
  }
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3, last = (k + 2) % 3;
    const int sign = sign_of(p[next] * q[last] - p[last] * q[next]);
    if (sign != 0) return sign;
  }
  return 0;
}

}  // namespace

int orient3d_moved(const vec3& a, const vec3& b, const vec3& l, const vec3& r) {
  const int sign = orient3d(a, b, l, r);
  return sign != 0 ? sign : moved_sign(a, b, r);
}

bool crosses(const vec3& a, const vec3& b, const vec3& c, const vec3& r, const vec3& l) {
  const int side = orient3d(a, b, c, r);
  if (side == 0 || orient3d(a, b, c, l) != -side) return false;
  return orient3d_moved(a, b, l, r) == side && orient3d_moved(b, c, l, r) == side && orient3d_moved(c, a, l, r) == side;
}

}  // namespace halfshade
