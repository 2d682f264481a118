// The renderer of embree_host.cpp: its scene, what its camera sees, and its own shadow rays in every way that Embree 3
// offers. Nothing here knows of halfshade's methods.
#pragma once

#include <embree3/rtcore.h>

#include <algorithm>

#include "halfshade/light.h"
#include "halfshade/scene.h"

namespace embree_host {

using namespace halfshade;

constexpr std::uint32_t kSide = 16, kSamples = kSide * kSide;  // of the light

/// What the host knows of the points that its camera sees.
struct Hits {
  std::vector<std::uint32_t> pixel, triangle;
  std::vector<dvec3> position, normal;  // position: moved off the surface a little
};

struct Host {
  Scene scene;
  Camera camera;
  Light light;
  std::uint32_t size = 512;
  double epsilon = 0.0;        // distance by which points are moved off their surface
  std::vector<vec3> vertices;  // floats, as Embree reads them
  std::vector<vec3> samples;   // [kSamples] points of the light
  RTCDevice device = nullptr;
  RTCScene tree = nullptr;
  Hits hits;
};

using Masks = std::vector<std::uint64_t>;  // [hit][kSamples / 64]

inline void set_blocked(Masks& masks, std::size_t hit, std::uint32_t sample) {
  masks[hit * (kSamples / 64) + sample / 64] |= std::uint64_t{1} << (sample % 64);
}

/// A shadow ray from a hit to just before a sample.
inline void aim(const Host& host, std::size_t hit, std::uint32_t sample, RTCRay& ray) {
  const vec3 from(host.hits.position[hit]), d = host.samples[sample] - from;
  ray = {from.x, from.y, from.z, 0.0f, d.x, d.y, d.z, 0.0f, 1.0f - 0x1p-20f, ~0u, 0, 0};
}

inline void trace_one_by_one(const Host& host, std::size_t hit, RTCIntersectContext& context, Masks& masks) {
  RTCRay ray;
  for (std::uint32_t s = 0; s < kSamples; ++s) {
    aim(host, hit, s, ray);
    rtcOccluded1(host.tree, &context, &ray);
    if (ray.tfar < 0.0f) set_blocked(masks, hit, s);
  }
}

inline void trace_stream(const Host& host, std::size_t hit, RTCIntersectContext& context, Masks& masks) {
  std::array<RTCRay, kSamples> rays;
  for (std::uint32_t s = 0; s < kSamples; ++s) aim(host, hit, s, rays[s]);
  rtcOccluded1M(host.tree, &context, rays.data(), kSamples, sizeof(RTCRay));
  for (std::uint32_t s = 0; s < kSamples; ++s) {
    if (rays[s].tfar < 0.0f) set_blocked(masks, hit, s);
  }
}

/// Packets of 4, 8 or 16 samples of one hit.
template <class Packet, int width, auto occluded>
void trace_packets(const Host& host, std::size_t hit, RTCIntersectContext& context, Masks& masks) {
  alignas(64) int valid[width];
  std::fill_n(valid, width, -1);
  Packet p;
  for (std::uint32_t first = 0; first < kSamples; first += width) {
    for (std::uint32_t k = 0; k < width; ++k) {
      RTCRay ray;
      aim(host, hit, first + k, ray);
      p.org_x[k] = ray.org_x, p.org_y[k] = ray.org_y, p.org_z[k] = ray.org_z, p.tnear[k] = ray.tnear;
      p.dir_x[k] = ray.dir_x, p.dir_y[k] = ray.dir_y, p.dir_z[k] = ray.dir_z, p.tfar[k] = ray.tfar;
      p.time[k] = 0.0f, p.mask[k] = ~0u, p.id[k] = 0, p.flags[k] = 0;
    }
    occluded(valid, host.tree, &context, &p);
    for (std::uint32_t k = 0; k < width; ++k) {
      if (p.tfar[k] < 0.0f) set_blocked(masks, hit, first + k);
    }
  }
}

/// A way to trace all shadow rays of one hit.
struct Way {
  const char* name;
  void (*trace)(const Host&, std::size_t hit, RTCIntersectContext&, Masks&);
};
constexpr Way kWays[] = {{"rtcOccluded1", trace_one_by_one},
                         {"rtcOccluded4", trace_packets<RTCRay4, 4, rtcOccluded4>},
                         {"rtcOccluded8", trace_packets<RTCRay8, 8, rtcOccluded8>},
                         {"rtcOccluded16", trace_packets<RTCRay16, 16, rtcOccluded16>},
                         {"rtcOccluded1M", trace_stream}};

}  // namespace embree_host
