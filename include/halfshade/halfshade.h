// halfshade: exact soft shadows from area lights, and the rasterizer that goes with them.
//
// Space        right-handed; +y is up in the built-in scenes, no axis is special to the library. World coordinates are
//              double; any unit. Light edge vectors are full lengths. Triangles wind counter-clockwise seen from
//              outside, but both sides block light.
// Images       row 0 is the top; pixel (x, y) has its centre at (x + 0.5, y + 0.5).
// Threads      work runs in the TBB arena of the calling thread, or as an Execution says. Const objects may be shared.
// Determinism  equal inputs and configuration give equal bits for any number of threads and any instruction set.
// Exactness    a light sample is blocked where, in exact arithmetic on the rounded points, receiver and sample lie
//              strictly on opposite sides of a triangle's plane and the segment between them meets the closed triangle,
//              which is neither translucent nor the receiver's own, at an opaque texel.
#pragma once

#include "halfshade/accumulation.h"
#include "halfshade/depth_complexity.h"
#include "halfshade/emission.h"
#include "halfshade/error.h"
#include "halfshade/execution.h"
#include "halfshade/light.h"
#include "halfshade/names.h"
#include "halfshade/rasterizer.h"
#include "halfshade/scene.h"
#include "halfshade/shadow_scene.h"
#include "halfshade/shadow_solver.h"
#include "halfshade/shadows.h"
#include "halfshade/stream.h"
#include "halfshade/transmittance.h"
#include "halfshade/types.h"
#include "halfshade/views.h"
