/* halfshade from C: the embedding interface of shadow_scene.h and shadow_solver.h, which say what the calls mean.
 *
 * Status: every function that can fail returns a halfshade_status and writes its outputs only when that is
 * HALFSHADE_OK; a call that was cancelled may have written some of them. The context keeps the message of its last
 * call, which names the argument at fault.
 *
 * Contexts say how calls run and keep the message. One thread at a time may use a context; objects belong to none, so
 * that several threads, each with a context and a workspace of its own, may share a scene and a solver.
 *
 * Structs that may grow start with struct_size. Begin with the HALFSHADE_..._INIT macro, which sets it and the
 * defaults. Bytes of a struct that this version of the library does not know must be zero.
 *
 * Arrays: pointer, count, and distance in bytes from one element to the next (0 = packed). Read during the call, not
 * kept after it. Nothing may count more than 2^31 - 1 elements.
 *
 * Handles are made by ..._create and freed by ..._destroy, which takes their address and makes them NULL. A NULL
 * handle, or a handle of another kind, is HALFSHADE_ERROR_USAGE; ..._destroy ignores it.
 *
 * Callbacks must return: neither longjmp nor a C++ exception may leave them. They must not use the context of the call
 * that they serve.
 */
#ifndef HALFSHADE_C_API_H
#define HALFSHADE_C_API_H

#include <stddef.h>
#include <stdint.h>

#include "halfshade/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Of this header: changes that break programs. While it is 0, a new minor version may break them as well. */
#define HALFSHADE_VERSION_MAJOR 0
/* Of this header: additions. */
#define HALFSHADE_VERSION_MINOR 1
/* Of this header: corrections. */
#define HALFSHADE_VERSION_PATCH 0
/* Of this header, as one number: major * 1000000 + minor * 1000 + patch. */
#define HALFSHADE_VERSION \
  (HALFSHADE_VERSION_MAJOR * 1000000u + HALFSHADE_VERSION_MINOR * 1000u + HALFSHADE_VERSION_PATCH)

/* "No such number": a receiver without a triangle of its own, a mesh without an alpha map. */
#define HALFSHADE_NONE 0xffffffffu

/* How a call ended; halfshade_last_error has the details. */
typedef enum halfshade_status {
  HALFSHADE_OK = 0,                  /* everything asked for was done */
  HALFSHADE_ERROR_USAGE = 1,         /* a call that makes no sense */
  HALFSHADE_ERROR_BAD_INPUT = 2,     /* an array whose content is wrong */
  HALFSHADE_ERROR_LIMIT = 3,         /* the work would exceed a stated limit */
  HALFSHADE_ERROR_OUTPUT = 4,        /* a result could not be written */
  HALFSHADE_ERROR_CANCELLED = 5,     /* progress returned 0 */
  HALFSHADE_ERROR_OUT_OF_MEMORY = 6, /* the objects are as usable as before */
  HALFSHADE_ERROR_INTERNAL = 7       /* anything else: a defect of the library */
} halfshade_status;

/* How calls run, and the message of the last one. One thread at a time; a call that finds it in use by another returns
 * HALFSHADE_ERROR_USAGE. */
typedef struct halfshade_context halfshade_context;
/* Meshes in world space and what is built over them. Functions that take it as const may run concurrently with each
 * other, in contexts of their own; others with nothing on the same scene. */
typedef struct halfshade_scene halfshade_scene;
/* A configuration, immutable: any number of threads may share it. */
typedef struct halfshade_solver halfshade_solver;
/* Scratch memory of one solve at a time, and what is kept from one to the next; of any scenes and solvers, in turn. A
 * solve that finds it in use by another returns HALFSHADE_ERROR_USAGE. */
typedef struct halfshade_workspace halfshade_workspace;
/* What a camera saw of a scene. Written by one halfshade_rasterize at a time, then read by any number of threads. */
typedef struct halfshade_gbuffer halfshade_gbuffer;

/* Version of the library that runs, as HALFSHADE_VERSION; less than that of the header: it may not know all of it. */
HALFSHADE_API uint32_t halfshade_version(void);
/* Lower-case words, "out of memory"; "unknown" for other numbers. Never NULL; lives as long as the library. */
HALFSHADE_API const char* halfshade_status_name(halfshade_status status);

/* ---- Contexts: execution.h ---- */

/* Who runs the loops of a call. Results never depend on it. */
typedef enum halfshade_executor {
  HALFSHADE_EXECUTOR_ARENA = 0,  /* TBB, in the arena of the calling thread */
  HALFSHADE_EXECUTOR_SERIAL = 1, /* the calling thread alone */
  HALFSHADE_EXECUTOR_HOST = 2    /* parallel_for */
} halfshade_executor;

/* How the calls with a context run. Functions and what they are given must stay valid until it is destroyed. */
typedef struct halfshade_context_desc {
  size_t struct_size;          /* sizeof(halfshade_context_desc) */
  halfshade_executor executor; /* who runs the loops */
  /* HOST, else not looked at: calls body(body_context, i) exactly once for every i < count, on threads of its choice,
   * and returns when all of these calls have returned. May be called again from inside a body. */
  void (*parallel_for)(void* parallel_for_user, size_t count, void (*body)(const void* body_context, size_t index),
                       const void* body_context);
  void* parallel_for_user; /* first argument of parallel_for; may be NULL */
  /* HOST: about how many threads parallel_for uses; into how many pieces work is split. 0 = 8. */
  size_t concurrency;
  /* Called now and then on the calling thread with the share done, 0..1; returning 0 stops the call with
   * HALFSHADE_ERROR_CANCELLED. May be NULL: nobody watches. */
  int (*progress)(void* progress_user, double done);
  void* progress_user; /* first argument of progress; may be NULL */
} halfshade_context_desc;
/* In the arena of the calling thread, unwatched. */
#define HALFSHADE_CONTEXT_INIT \
  { .struct_size = sizeof(halfshade_context_desc), .executor = HALFSHADE_EXECUTOR_ARENA }

/* desc == NULL: the defaults. There is no context yet to keep a message: USAGE stands for `context` NULL, an executor
 * that does not exist, or HOST without parallel_for. */
HALFSHADE_API halfshade_status halfshade_context_create(const halfshade_context_desc* desc,
                                                        halfshade_context** context);
/* Frees it and makes *context NULL; not during a call with it. Objects made with it stay as they are. */
HALFSHADE_API void halfshade_context_destroy(halfshade_context** context);
/* Message of the last call with this context, "" when it was HALFSHADE_OK; at most 1023 bytes, never NULL. Valid until
 * the next call with the context, which must not be running. */
HALFSHADE_API const char* halfshade_last_error(const halfshade_context* context);

/* ---- Arrays: views.h ---- */

/* Type of coordinates. */
typedef enum halfshade_scalar {
  HALFSHADE_FLOAT32 = 0, /* float */
  HALFSHADE_FLOAT64 = 1  /* double */
} halfshade_scalar;

/* Points or vectors: x, y, z one behind the other. All zero: no points. */
typedef struct halfshade_points {
  const void* data;        /* the first x, at any address; may be NULL when count is 0 */
  size_t count;            /* points, not numbers */
  size_t stride_bytes;     /* from one x to the next, at least the size of a point; 0 = packed */
  halfshade_scalar scalar; /* of all coordinates */
} halfshade_points;

/* Numbers; or triples of vertex numbers where triangles are asked for. All zero: none. */
typedef struct halfshade_indices {
  const uint32_t* data; /* the first number, at any address; may be NULL when count is 0 */
  size_t count;         /* numbers, or triangles */
  size_t stride_bytes;  /* from one number or triangle to the next, at least its size; 0 = packed */
} halfshade_indices;

/* Texture coordinates: u, v one behind the other. All zero: none. */
typedef struct halfshade_uvs {
  const float* data;   /* the first u, at any address; may be NULL when count is 0 */
  size_t count;        /* pairs */
  size_t stride_bytes; /* from one u to the next, at least the size of a pair; 0 = packed */
} halfshade_uvs;

/* ---- Lights: light.h ---- */

/* Shapes of lights, and which members of halfshade_light say where they are; the others are not looked at. */
typedef enum halfshade_light_shape {
  HALFSHADE_LIGHT_POINT = 0,     /* center; always one sample */
  HALFSHADE_LIGHT_RECTANGLE = 1, /* center, u, v; faces u x v */
  HALFSHADE_LIGHT_DISK = 2,      /* center, normal, radius; faces normal */
  HALFSHADE_LIGHT_SPHERE = 3,    /* center, radius */
  HALFSHADE_LIGHT_SAMPLES = 4,   /* points: 1..4096 explicit sample positions */
  HALFSHADE_LIGHT_ELLIPSOID = 5, /* center, axes */
  HALFSHADE_LIGHT_POLYGON = 6,   /* points: 3..64 corners, flat and convex; faces who sees them counter-clockwise */
  HALFSHADE_LIGHT_SUN = 7        /* normal, angular_diameter_deg; for halfshade_place_sun, which makes a disk of it */
} halfshade_light_shape;

/* A light in world space. Flat lights give nothing to receivers at or behind their plane, unless two-sided. */
typedef struct halfshade_light {
  size_t struct_size;          /* sizeof(halfshade_light); in an array, also the distance between its elements */
  halfshade_light_shape shape; /* says which of the others count */
  double center[3];            /* world space */
  double u[3];                 /* RECTANGLE: a full edge vector, world space */
  double v[3];                 /* RECTANGLE: the other one; 0 0 0 in one or both is a segment or a point */
  double normal[3];            /* DISK: the side that shines; SUN: the way its light travels; of any length but 0 */
  double radius;               /* DISK, SPHERE: world units, >= 0 */
  double axes[3][3];           /* ELLIPSOID: three half-axis vectors, world space, not necessarily orthogonal */
  halfshade_points points;     /* SAMPLES, POLYGON: world space */
  int two_sided;               /* flat shapes: 0 = one side shines, else both */
  float emission[3];           /* linear RGB >= 0; radiance, of POINT and SAMPLES intensity */
  /* RECTANGLE: replaces emission unless NULL; [image_height][image_width][3] linear RGB >= 0, seen from the lit side
   * with u to the right and row 0 at the edge +v / 2. */
  const float* emission_image;
  uint32_t image_width;        /* texels, >= 1 with an image */
  uint32_t image_height;       /* texels, >= 1 with an image */
  double angular_diameter_deg; /* SUN: as seen from the scene, 0 < angle <= 60 degrees */
} halfshade_light;
/* A white square of side 1 in the plane y = 0, with the normal and axes that other shapes may want to keep. */
#define HALFSHADE_LIGHT_INIT                                                                                    \
  {                                                                                                             \
    .struct_size = sizeof(halfshade_light), .shape = HALFSHADE_LIGHT_RECTANGLE, .u = {1, 0, 0}, .v = {0, 0, 1}, \
    .normal = {0, -1, 0}, .axes = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, .emission = {1, 1, 1},                     \
    .angular_diameter_deg = 0.533                                                                               \
  }

/* The sun of a scene between `low` and `high` (world space): a disk far away. Lights of other shapes stay as they are.
 * Set placed->struct_size before; `placed` may be `sun`. */
HALFSHADE_API halfshade_status halfshade_place_sun(halfshade_context* context, const halfshade_light* sun,
                                                   const double low[3], const double high[3], halfshade_light* placed);

/* ---- Scenes: shadow_scene.h ---- */

/* How a scene keeps its tree; changes times, never results. */
typedef struct halfshade_scene_desc {
  size_t struct_size; /* sizeof(halfshade_scene_desc) */
  /* The order of the tree is made anew once moving meshes have made a query this many times as expensive as when it was
   * built; >= 1, or 0 = never. */
  double rebuild_cost;
  int back_face_casters; /* not 0: meshes proved closed cast by their back faces alone */
} halfshade_scene_desc;
/* Rebuilds at 1.5 times the cost; closed meshes cast by their back faces. */
#define HALFSHADE_SCENE_INIT \
  { .struct_size = sizeof(halfshade_scene_desc), .rebuild_cost = 1.5, .back_face_casters = 1 }

/* 8-bit opacities of a texture, which repeats outside 0..1; row 0 is v = 1. One channel of a picture with several will
 * do: data is its first byte. */
typedef struct halfshade_alpha_desc {
  size_t struct_size;  /* sizeof(halfshade_alpha_desc) */
  const uint8_t* data; /* the top left texel */
  uint32_t width;      /* texels, 1..65536 */
  uint32_t height;     /* texels, 1..65536 */
  size_t row_bytes;    /* from one row to the next, not shorter than a row; 0 = width * texel_bytes */
  size_t texel_bytes;  /* from one texel to the next; 0 = 1 */
} halfshade_alpha_desc;
/* No texels yet: data, width and height are to be set. */
#define HALFSHADE_ALPHA_INIT \
  { .struct_size = sizeof(halfshade_alpha_desc) }

/* A mesh as the caller holds it. */
typedef struct halfshade_mesh_desc {
  size_t struct_size;          /* sizeof(halfshade_mesh_desc) */
  halfshade_points positions;  /* object space, finite */
  halfshade_indices triangles; /* counter-clockwise seen from outside; empty: vertices 0 1 2, 3 4 5, ... */
  double transform[3][4];      /* object to world: rows of an affine map, finite; all 0 puts the mesh into one point */
  halfshade_uvs uvs;           /* per vertex, within -2^30..2^30; needed with an alpha map, not looked at without */
  uint32_t alpha_map;          /* what halfshade_scene_add_alpha_map gave, or HALFSHADE_NONE */
  float alpha_cutoff;          /* a texel is opaque where alpha / 255 >= alpha_cutoff; >= 0, and 0 = all are */
  float albedo[3];             /* linear RGB, for G-buffers */
} halfshade_mesh_desc;
/* No vertices yet, identity, no alpha map, grey. */
#define HALFSHADE_MESH_INIT                                                                              \
  {                                                                                                      \
    .struct_size = sizeof(halfshade_mesh_desc), .transform = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}, \
    .alpha_map = HALFSHADE_NONE, .alpha_cutoff = 0.5f, .albedo = {                                       \
      0.8f,                                                                                              \
      0.8f,                                                                                              \
      0.8f                                                                                               \
    }                                                                                                    \
  }

/* What commits had to do since the scene was made, and what there is since the last one. */
typedef struct halfshade_scene_stats {
  size_t struct_size;           /* sizeof(halfshade_scene_stats), set by the caller */
  uint64_t commits;             /* that found something to do */
  uint64_t frame_changes;       /* everything was rounded anew: content left the local frame, or shrank far below it */
  uint64_t meshes_rounded;      /* times that the vertices of a mesh were rounded to the lattice */
  uint64_t certificates_made;   /* times that a mesh was searched for closed parts */
  uint64_t tree_builds;         /* times that the tree's order was made from scratch */
  double tree_cost;             /* of a query now, relative to when the tree's order was made */
  double commit_ms;             /* last commit, wall time in milliseconds */
  double tree_ms;               /* its share for the tree */
  uint64_t meshes;              /* now */
  uint64_t triangles;           /* now, of all meshes */
  uint64_t vertices;            /* now, of all meshes */
  uint64_t certified_triangles; /* now, of parts proved closed */
  uint64_t bytes;               /* memory that the scene holds, without workspaces */
} halfshade_scene_stats;

/* An empty scene, to be committed like any other. desc == NULL: the defaults. USAGE for a rebuild_cost out of range. */
HALFSHADE_API halfshade_status halfshade_scene_create(halfshade_context* context, const halfshade_scene_desc* desc,
                                                      halfshade_scene** scene);
/* Frees it and makes *scene NULL; not during a call that uses it. Workspaces and G-buffers stay as they are. */
HALFSHADE_API void halfshade_scene_destroy(halfshade_scene** scene);
/* Copies the opacities; *number is what halfshade_mesh_desc.alpha_map wants, 0, 1, 2, ... `number` may be NULL, here
 * and below. BAD_INPUT for a size out of range. */
HALFSHADE_API halfshade_status halfshade_scene_add_alpha_map(halfshade_context* context, halfshade_scene* scene,
                                                             const halfshade_alpha_desc* desc, uint32_t* number);
/* Copies the mesh; *number stands for it from now on and is never given again. BAD_INPUT names the first vertex that is
 * not finite, index out of range, or array of the wrong length; LIMIT beyond 2^31 - 1 triangles in the scene. */
HALFSHADE_API halfshade_status halfshade_scene_add_mesh(halfshade_context* context, halfshade_scene* scene,
                                                        const halfshade_mesh_desc* desc, uint32_t* number);
/* USAGE for a number that stands for no mesh, here and below. The numbers of other meshes stay. */
HALFSHADE_API halfshade_status halfshade_scene_remove_mesh(halfshade_context* context, halfshade_scene* scene,
                                                           uint32_t mesh);
/* New object-space positions, as many as before (else BAD_INPUT); triangles stay. */
HALFSHADE_API halfshade_status halfshade_scene_set_positions(halfshade_context* context, halfshade_scene* scene,
                                                             uint32_t mesh, const halfshade_points* positions);
/* Another place for the mesh: 12 finite numbers, object to world, row by row as in halfshade_mesh_desc. */
HALFSHADE_API halfshade_status halfshade_scene_set_transform(halfshade_context* context, halfshade_scene* scene,
                                                             uint32_t mesh, const double* transform);
/* Widens the box that the frame is made for, by places where meshes or receivers will be that lie far from all meshes
 * now; world space. It never shrinks. */
HALFSHADE_API halfshade_status halfshade_scene_extend_points(halfshade_context* context, halfshade_scene* scene,
                                                             const halfshade_points* points);
/* Makes the frame reach all of a light, however far it is: the scene stays in its middle. */
HALFSHADE_API halfshade_status halfshade_scene_extend_light(halfshade_context* context, halfshade_scene* scene,
                                                            const halfshade_light* light);
/* Does all that changed; costs nothing when nothing did. A commit that fails leaves all changes noted and may be called
 * again; until it is HALFSHADE_OK, what needs a committed scene returns USAGE. */
HALFSHADE_API halfshade_status halfshade_scene_commit(halfshade_context* context, halfshade_scene* scene);
/* Lowest and highest corner of the box that receivers and lights may be in, of the last commit; world space. */
HALFSHADE_API halfshade_status halfshade_scene_reach(halfshade_context* context, const halfshade_scene* scene,
                                                     double low[3], double high[3]);
/* Points in the local frame of the last commit, as a G-buffer has them, to world space: `world` has room for
 * [local->count][3] numbers, and may be where the points are if those are packed doubles. */
HALFSHADE_API halfshade_status halfshade_scene_to_world(halfshade_context* context, const halfshade_scene* scene,
                                                        const halfshade_points* local, double* world);
/* Set stats->struct_size before. What has changed since the last commit is not in them. */
HALFSHADE_API halfshade_status halfshade_scene_get_stats(halfshade_context* context, const halfshade_scene* scene,
                                                         halfshade_scene_stats* stats);

/* ---- Solvers and workspaces: shadow_solver.h ---- */

/* A configuration. Members that belong to one method are ignored by the others. */
typedef struct halfshade_solver_desc {
  size_t struct_size;          /* sizeof(halfshade_solver_desc) */
  const char* method;          /* "exact", "afsm", ...; NULL = "exact" */
  const char* pattern;         /* "rows", "uniform", "stratified", "low-discrepancy", "poisson-disk"; NULL = "rows" */
  uint32_t light_sample_count; /* per light, 1..4096; POINT always has 1, SAMPLES its own number */
  uint32_t sample_sets;        /* 1..256 different sets of light samples, chosen per receiver by number and seed */
  uint32_t seed;               /* any; same seed, same bits, on every platform */
  uint32_t frame;              /* temporal jitter: every frame shows each receiver other samples; 0..2^25 - 1 */
  int interleave;              /* not 0: 16 sets by place in the picture, whatever sample_sets is */
  int rotate_sets;             /* not 0: the sets of DISK and SPHERE are rotated copies of a single one */
  const char* options;         /* of single methods, "hpc.leaf=8 gears.grid=64", separated by blanks; NULL = none */
} halfshade_solver_desc;
/* Method exact, 256 samples in rows, one set, seed 0. */
#define HALFSHADE_SOLVER_INIT \
  { .struct_size = sizeof(halfshade_solver_desc), .light_sample_count = 256, .sample_sets = 1 }

/* What a workspace keeps between calls. */
typedef struct halfshade_workspace_desc {
  size_t struct_size; /* sizeof(halfshade_workspace_desc) */
  /* 1..256 lights whose samples, and about 10 bytes per triangle, are kept from call to call. Light i of a call
   * uses place i modulo this. */
  uint32_t kept_lights;
} halfshade_workspace_desc;
/* One light is kept. */
#define HALFSHADE_WORKSPACE_INIT \
  { .struct_size = sizeof(halfshade_workspace_desc), .kept_lights = 1 }

/* halfshade_receivers.lift: as far as rounding asks for, and as the receivers of a G-buffer. */
#define HALFSHADE_DEFAULT_LIFT (-1.0)

/* Points that ask for light. */
typedef struct halfshade_receivers {
  size_t struct_size;         /* sizeof(halfshade_receivers) */
  halfshade_points positions; /* world space, finite, within halfshade_scene_reach */
  /* Geometric, on the side that is asked, of any length but 0; or empty. With them receivers are lifted, samples at or
   * below a receiver's tangent plane do not light it, and irradiance can be asked for. */
  halfshade_points normals;
  halfshade_indices meshes;    /* per receiver: mesh of its own triangle, or HALFSHADE_NONE; or empty */
  halfshade_indices triangles; /* per receiver: that triangle's number in the mesh, or NONE; empty as `meshes` is */
  double lift;    /* along the normals, in half-widths of the local frame, 0..1; or HALFSHADE_DEFAULT_LIFT */
  uint32_t first; /* number of receiver 0, from which sets of light samples are chosen: where these are a part of all */
  uint32_t frame; /* instead of the solver's, 0..2^25 - 1; or HALFSHADE_NONE */
} halfshade_receivers;
/* No receivers yet, lifted by default, in the solver's frame. */
#define HALFSHADE_RECEIVERS_INIT \
  { .struct_size = sizeof(halfshade_receivers), .lift = HALFSHADE_DEFAULT_LIFT, .frame = HALFSHADE_NONE }

/* Where results go. Each array is NULL (not wanted) or has exactly as many elements as stated; the counts, in elements
 * of the pointer's type, are there to be checked. [light] runs over the lights of the call, [receiver] over the
 * receivers, of a G-buffer over its entries row by row; [word] over halfshade_solver_mask_words of these lights. */
typedef struct halfshade_output {
  size_t struct_size; /* sizeof(halfshade_output) */
  uint64_t* masks;    /* [light][receiver][word]: bit i is set where sample i of the light is hidden; others are 0 */
  size_t mask_count;  /* lights * receivers * words */
  float* visibility;  /* [light][receiver]: fraction of samples not hidden, 0..1 */
  size_t visibility_count; /* lights * receivers */
  /* [light][receiver][3] linear RGB: what visible samples send to a surface with the receiver's normal, as
   * ShadowOutput::irradiance in shadow_solver.h; needs normals. */
  float* irradiance;
  size_t irradiance_count;       /* lights * receivers * 3 */
  float* total_irradiance;       /* [receiver][3]: sum over lights, in their order; needs normals */
  size_t total_irradiance_count; /* receivers * 3 */
} halfshade_output;
/* Nothing is wanted yet. */
#define HALFSHADE_OUTPUT_INIT \
  { .struct_size = sizeof(halfshade_output) }

/* Counters and times of one solve, summed over its lights. Milliseconds are wall time. */
typedef struct halfshade_solve_stats {
  size_t struct_size;       /* sizeof(halfshade_solve_stats), set by the caller */
  double build_ms;          /* what a static scene keeps: tree, certificates */
  double index_ms;          /* receivers into the light's lists */
  double cull_ms;           /* where blockers can matter */
  double test_ms;           /* blockers against receivers and samples */
  uint64_t receivers;       /* that the lights can reach */
  uint64_t triangles;       /* that may block */
  uint64_t pairs_tested;    /* (blocker, receiver) that reached the kernel */
  uint64_t sample_tests;    /* (blocker, receiver, sample) by the float filter */
  uint64_t exact_fallbacks; /* of these, decided by the exact predicate */
  uint64_t bytes;           /* most working memory of the method for a light, without masks */
  uint64_t lights_kept;     /* whose samples and tree were still there from an earlier call */
  uint64_t lights_made;     /* whose samples and tree were made by this call */
} halfshade_solve_stats;

/* desc == NULL: the defaults. Names and options are not kept. USAGE for names, numbers or options that do not exist or
 * are out of range, and for method raytrace, which is not in the library. */
HALFSHADE_API halfshade_status halfshade_solver_create(halfshade_context* context, const halfshade_solver_desc* desc,
                                                       halfshade_solver** solver);
/* Frees it and makes *solver NULL; not during a call that uses it. */
HALFSHADE_API void halfshade_solver_destroy(halfshade_solver** solver);
/* *samples: light_sample_count; 1 for POINT, their number for SAMPLES (BAD_INPUT for none or more than 4096). */
HALFSHADE_API halfshade_status halfshade_solver_sample_count(halfshade_context* context, const halfshade_solver* solver,
                                                             const halfshade_light* light, uint32_t* samples);
/* 64-bit words per receiver and light that hold the masks of any of these lights: one number for all of them, since a
 * call gives every light as many. 0 lights have 0. `lights` is an array of light_count elements that lie
 * lights[0].struct_size bytes apart, here and below. */
HALFSHADE_API halfshade_status halfshade_solver_mask_words(halfshade_context* context, const halfshade_solver* solver,
                                                           const halfshade_light* lights, size_t light_count,
                                                           size_t* words);

/* Allocates little; the first solve does. desc == NULL: the defaults. */
HALFSHADE_API halfshade_status halfshade_workspace_create(halfshade_context* context,
                                                          const halfshade_workspace_desc* desc,
                                                          halfshade_workspace** workspace);
/* Frees it and makes *workspace NULL; not during a call that uses it. */
HALFSHADE_API void halfshade_workspace_destroy(halfshade_workspace** workspace);
/* Gives all memory back; the next solve starts from nothing. */
HALFSHADE_API halfshade_status halfshade_workspace_clear(halfshade_context* context, halfshade_workspace* workspace);
/* Of the last solve, whether it succeeded or not. Set stats->struct_size before. */
HALFSHADE_API halfshade_status halfshade_workspace_get_stats(halfshade_context* context,
                                                             const halfshade_workspace* workspace,
                                                             halfshade_solve_stats* stats);

/* The lights' visibility from all receivers. USAGE: a scene that is not committed, arrays whose lengths do not fit, a
 * workspace in use, irradiance without normals, masks or irradiance from a method that has no masks; BAD_INPUT names
 * the first receiver or light that is not finite, degenerate or out of reach. Nothing is written then. Without
 * receivers or lights there is nothing to do, which succeeds. */
HALFSHADE_API halfshade_status halfshade_solve(halfshade_context* context, const halfshade_solver* solver,
                                               const halfshade_scene* scene, halfshade_workspace* workspace,
                                               const halfshade_receivers* receivers, const halfshade_light* lights,
                                               size_t light_count, const halfshade_output* output);

/* ---- Pictures: rasterizer.h ---- */

/* Pinhole camera, right-handed, and the size of its picture. */
typedef struct halfshade_camera {
  size_t struct_size; /* sizeof(halfshade_camera) */
  double eye[3];      /* world space */
  double target[3];   /* world space: what it looks at, not the eye itself */
  double up[3];       /* of any length but 0, not parallel to the direction of view */
  double fov_y_deg;   /* between the picture's lower and upper edge, 0 < angle < 180 degrees */
  uint32_t width;     /* entries, 1..16384 */
  uint32_t height;    /* entries, 1..16384 */
} halfshade_camera;
/* From (0, 0, 5) towards the origin, 45 degrees, 512 x 512. */
#define HALFSHADE_CAMERA_INIT                                                                                  \
  {                                                                                                            \
    .struct_size = sizeof(halfshade_camera), .eye = {0, 0, 5}, .up = {0, 1, 0}, .fov_y_deg = 45, .width = 512, \
    .height = 512                                                                                              \
  }

/* What a G-buffer holds, [height][width], row 0 = top; belongs to it and is valid until the next halfshade_rasterize
 * into it, or until it is destroyed. Entries that show the background have zeros but for `triangle`. */
typedef struct halfshade_gbuffer_view {
  size_t struct_size;            /* sizeof(halfshade_gbuffer_view), set by the caller */
  uint32_t width;                /* entries */
  uint32_t height;               /* entries */
  const uint32_t* triangle;      /* visible triangle, or HALFSHADE_NONE for the background */
  const double* position;        /* [3], local frame of the scene: see halfshade_scene_to_world */
  const float* geometric_normal; /* [3], unit, on the camera's side */
  const float* albedo;           /* [3], linear RGB */
  const float* depth;            /* along the camera's axis, local frame units */
  const float* shading_normal;   /* [3], unit, interpolated; = geometric_normal where the scene has none */
} halfshade_gbuffer_view;

/* An empty one. */
HALFSHADE_API halfshade_status halfshade_gbuffer_create(halfshade_context* context, halfshade_gbuffer** gbuffer);
/* Frees it and makes *gbuffer NULL; not during a call that uses it. */
HALFSHADE_API void halfshade_gbuffer_destroy(halfshade_gbuffer** gbuffer);
/* Draws the committed scene into it, using its memory again. USAGE for a scene that is not committed, a size out of
 * range or a degenerate camera. A call that fails leaves it as it was or empty. */
HALFSHADE_API halfshade_status halfshade_rasterize(halfshade_context* context, const halfshade_scene* scene,
                                                   const halfshade_camera* camera, halfshade_gbuffer* gbuffer);
/* Set view->struct_size before. USAGE for an empty G-buffer. */
HALFSHADE_API halfshade_status halfshade_gbuffer_get_view(halfshade_context* context, const halfshade_gbuffer* gbuffer,
                                                          halfshade_gbuffer_view* view);
/* Which triangle of which mesh has this number in a G-buffer of the scene, since its last commit. USAGE for a number
 * that is not there. */
HALFSHADE_API halfshade_status halfshade_scene_triangle_of(halfshade_context* context, const halfshade_scene* scene,
                                                           uint32_t number, uint32_t* mesh, uint32_t* triangle);
/* As halfshade_solve; receivers are the entries of a G-buffer of the same scene, with their geometric normals. Entries
 * that show the background are hidden from every sample. USAGE as well for a G-buffer of another scene, or from before
 * a commit that added, removed or moved meshes, or the frame. */
HALFSHADE_API halfshade_status halfshade_solve_gbuffer(halfshade_context* context, const halfshade_solver* solver,
                                                       const halfshade_scene* scene, halfshade_workspace* workspace,
                                                       const halfshade_gbuffer* gbuffer, const halfshade_light* lights,
                                                       size_t light_count, const halfshade_output* output);

#ifdef __cplusplus
}
#endif

#endif
