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

#define HALFSHADE_VERSION_MAJOR 0
#define HALFSHADE_VERSION_MINOR 1
#define HALFSHADE_VERSION_PATCH 0
#define HALFSHADE_VERSION \
  (HALFSHADE_VERSION_MAJOR * 1000000u + HALFSHADE_VERSION_MINOR * 1000u + HALFSHADE_VERSION_PATCH)

/* "No such number": a receiver without a triangle of its own, a mesh without an alpha map. */
#define HALFSHADE_NONE 0xffffffffu

typedef enum halfshade_status {
  HALFSHADE_OK = 0,
  HALFSHADE_ERROR_USAGE = 1,         /* a call that makes no sense */
  HALFSHADE_ERROR_BAD_INPUT = 2,     /* an array whose content is wrong */
  HALFSHADE_ERROR_LIMIT = 3,         /* the work would exceed a stated limit */
  HALFSHADE_ERROR_OUTPUT = 4,        /* a result could not be written */
  HALFSHADE_ERROR_CANCELLED = 5,     /* progress returned 0 */
  HALFSHADE_ERROR_OUT_OF_MEMORY = 6, /* the objects are as usable as before */
  HALFSHADE_ERROR_INTERNAL = 7       /* anything else: a defect of the library */
} halfshade_status;

typedef struct halfshade_context halfshade_context;
typedef struct halfshade_scene halfshade_scene;
typedef struct halfshade_solver halfshade_solver;
typedef struct halfshade_workspace halfshade_workspace;
typedef struct halfshade_gbuffer halfshade_gbuffer;

/* Of the library that runs, as HALFSHADE_VERSION. */
HALFSHADE_API uint32_t halfshade_version(void);
/* "cancelled" ... */
HALFSHADE_API const char* halfshade_status_name(halfshade_status status);

/* ---- Contexts: execution.h ---- */

typedef enum halfshade_executor {
  HALFSHADE_EXECUTOR_ARENA = 0,  /* TBB, in the arena of the calling thread */
  HALFSHADE_EXECUTOR_SERIAL = 1, /* the calling thread alone */
  HALFSHADE_EXECUTOR_HOST = 2    /* parallel_for */
} halfshade_executor;

typedef struct halfshade_context_desc {
  size_t struct_size;
  halfshade_executor executor;
  /* HOST: calls body(body_context, i) exactly once for every i < count, on threads of its choice, and returns when all
   * of these calls have returned. May be called again from inside a body. */
  void (*parallel_for)(void* parallel_for_user, size_t count, void (*body)(const void* body_context, size_t index),
                       const void* body_context);
  void* parallel_for_user;
  size_t concurrency; /* HOST: about how many threads parallel_for uses */
  /* Called now and then on the calling thread with the share done, 0..1; returning 0 stops the call with
   * HALFSHADE_ERROR_CANCELLED. May be NULL. */
  int (*progress)(void* progress_user, double done);
  void* progress_user;
} halfshade_context_desc;
#define HALFSHADE_CONTEXT_INIT \
  { .struct_size = sizeof(halfshade_context_desc), .executor = HALFSHADE_EXECUTOR_ARENA }

/* desc == NULL: the defaults. */
HALFSHADE_API halfshade_status halfshade_context_create(const halfshade_context_desc* desc,
                                                        halfshade_context** context);
HALFSHADE_API void halfshade_context_destroy(halfshade_context** context);
/* Message of the last call with this context, "" when it was HALFSHADE_OK. Valid until the next call with it. */
HALFSHADE_API const char* halfshade_last_error(const halfshade_context* context);

/* ---- Arrays: views.h ---- */

typedef enum halfshade_scalar { HALFSHADE_FLOAT32 = 0, HALFSHADE_FLOAT64 = 1 } halfshade_scalar;

typedef struct halfshade_points { /* x, y, z */
  const void* data;
  size_t count;
  size_t stride_bytes;
  halfshade_scalar scalar;
} halfshade_points;

typedef struct halfshade_indices { /* one number each; or three, where triangles are asked for */
  const uint32_t* data;
  size_t count; /* numbers, or triangles */
  size_t stride_bytes;
} halfshade_indices;

typedef struct halfshade_uvs { /* u, v */
  const float* data;
  size_t count;
  size_t stride_bytes;
} halfshade_uvs;

/* ---- Lights: light.h ---- */

typedef enum halfshade_light_shape {
  HALFSHADE_LIGHT_POINT = 0,     /* center */
  HALFSHADE_LIGHT_RECTANGLE = 1, /* center, u, v: full edge vectors; faces u x v */
  HALFSHADE_LIGHT_DISK = 2,      /* center, normal, radius */
  HALFSHADE_LIGHT_SPHERE = 3,    /* center, radius */
  HALFSHADE_LIGHT_SAMPLES = 4,   /* points: explicit sample positions */
  HALFSHADE_LIGHT_ELLIPSOID = 5, /* center, axes: half-axis vectors */
  HALFSHADE_LIGHT_POLYGON = 6,   /* points: corners of a flat, convex polygon */
  HALFSHADE_LIGHT_SUN = 7        /* normal: the way its light travels, angular_diameter_deg; for halfshade_place_sun */
} halfshade_light_shape;

typedef struct halfshade_light {
  size_t struct_size;
  halfshade_light_shape shape;
  double center[3], u[3], v[3], normal[3], radius;
  double axes[3][3];
  halfshade_points points;
  int two_sided;
  float emission[3]; /* linear RGB >= 0 */
  /* RECTANGLE: replaces emission unless NULL; [height][width][3] linear RGB >= 0, row 0 is the edge at +v / 2. */
  const float* emission_image;
  uint32_t image_width, image_height;
  double angular_diameter_deg; /* SUN: 0 < angle <= 60 */
} halfshade_light;
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

typedef struct halfshade_scene_desc {
  size_t struct_size;
  double rebuild_cost;   /* 1.5 */
  int back_face_casters; /* 1 */
} halfshade_scene_desc;
#define HALFSHADE_SCENE_INIT \
  { .struct_size = sizeof(halfshade_scene_desc), .rebuild_cost = 1.5, .back_face_casters = 1 }

typedef struct halfshade_alpha_desc { /* 8-bit opacities, row 0 is v = 1 */
  size_t struct_size;
  const uint8_t* data;
  uint32_t width, height;
  size_t row_bytes, texel_bytes; /* 0 = packed */
} halfshade_alpha_desc;
#define HALFSHADE_ALPHA_INIT \
  { .struct_size = sizeof(halfshade_alpha_desc) }

typedef struct halfshade_mesh_desc {
  size_t struct_size;
  halfshade_points positions;  /* object space */
  halfshade_indices triangles; /* triples; empty: vertices 0 1 2, 3 4 5, ... */
  double transform[3][4];      /* object to world: rows of an affine map */
  halfshade_uvs uvs;           /* per vertex; needed with an alpha map */
  uint32_t alpha_map;          /* what halfshade_scene_add_alpha_map gave, or HALFSHADE_NONE */
  float alpha_cutoff;          /* a texel is opaque where alpha / 255 >= alpha_cutoff */
  float albedo[3];             /* linear RGB, for G-buffers */
} halfshade_mesh_desc;
#define HALFSHADE_MESH_INIT                                                                              \
  {                                                                                                      \
    .struct_size = sizeof(halfshade_mesh_desc), .transform = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}, \
    .alpha_map = HALFSHADE_NONE, .alpha_cutoff = 0.5f, .albedo = {                                       \
      0.8f,                                                                                              \
      0.8f,                                                                                              \
      0.8f                                                                                               \
    }                                                                                                    \
  }

typedef struct halfshade_scene_stats {
  size_t struct_size;
  uint64_t commits, frame_changes, meshes_rounded, certificates_made, tree_builds;
  double tree_cost, commit_ms, tree_ms;
  uint64_t meshes, triangles, vertices, certified_triangles, bytes;
} halfshade_scene_stats;

/* desc == NULL: the defaults. */
HALFSHADE_API halfshade_status halfshade_scene_create(halfshade_context* context, const halfshade_scene_desc* desc,
                                                      halfshade_scene** scene);
HALFSHADE_API void halfshade_scene_destroy(halfshade_scene** scene);
/* `number` may be NULL, here and below. */
HALFSHADE_API halfshade_status halfshade_scene_add_alpha_map(halfshade_context* context, halfshade_scene* scene,
                                                             const halfshade_alpha_desc* desc, uint32_t* number);
HALFSHADE_API halfshade_status halfshade_scene_add_mesh(halfshade_context* context, halfshade_scene* scene,
                                                        const halfshade_mesh_desc* desc, uint32_t* number);
HALFSHADE_API halfshade_status halfshade_scene_remove_mesh(halfshade_context* context, halfshade_scene* scene,
                                                           uint32_t mesh);
HALFSHADE_API halfshade_status halfshade_scene_set_positions(halfshade_context* context, halfshade_scene* scene,
                                                             uint32_t mesh, const halfshade_points* positions);
HALFSHADE_API halfshade_status halfshade_scene_set_transform(halfshade_context* context, halfshade_scene* scene,
                                                             uint32_t mesh, const double* transform /* 12: rows */);
/* Where meshes, receivers or lights will be that lie far from all meshes now; world space. */
HALFSHADE_API halfshade_status halfshade_scene_extend_points(halfshade_context* context, halfshade_scene* scene,
                                                             const halfshade_points* points);
HALFSHADE_API halfshade_status halfshade_scene_extend_light(halfshade_context* context, halfshade_scene* scene,
                                                            const halfshade_light* light);
HALFSHADE_API halfshade_status halfshade_scene_commit(halfshade_context* context, halfshade_scene* scene);
/* Lowest and highest corner of the box that receivers and lights may be in; world space. */
HALFSHADE_API halfshade_status halfshade_scene_reach(halfshade_context* context, const halfshade_scene* scene,
                                                     double low[3], double high[3]);
/* Points in the local frame of the last commit, as a G-buffer has them, to world space: [local->count][3] numbers. */
HALFSHADE_API halfshade_status halfshade_scene_to_world(halfshade_context* context, const halfshade_scene* scene,
                                                        const halfshade_points* local, double* world);
/* Set stats->struct_size before. */
HALFSHADE_API halfshade_status halfshade_scene_get_stats(halfshade_context* context, const halfshade_scene* scene,
                                                         halfshade_scene_stats* stats);

/* ---- Solvers and workspaces: shadow_solver.h ---- */

typedef struct halfshade_solver_desc {
  size_t struct_size;
  const char* method;          /* "exact", "afsm", ...; NULL = "exact" */
  const char* pattern;         /* "rows", "uniform", "stratified", "low-discrepancy", "poisson-disk"; NULL = "rows" */
  uint32_t light_sample_count; /* 1..4096 */
  uint32_t sample_sets;        /* 1..256 */
  uint32_t seed;
  uint32_t frame;      /* temporal jitter */
  int interleave;      /* 16 sets by place in the picture */
  int rotate_sets;     /* sets are rotated copies of one */
  const char* options; /* of single methods, "hpc.leaf=8 gears.grid=64", separated by blanks; NULL = none */
} halfshade_solver_desc;
#define HALFSHADE_SOLVER_INIT \
  { .struct_size = sizeof(halfshade_solver_desc), .light_sample_count = 256, .sample_sets = 1 }

typedef struct halfshade_workspace_desc {
  size_t struct_size;
  uint32_t kept_lights; /* 1..256: lights whose samples and tree are kept from call to call */
} halfshade_workspace_desc;
#define HALFSHADE_WORKSPACE_INIT \
  { .struct_size = sizeof(halfshade_workspace_desc), .kept_lights = 1 }

/* As far as rounding asks for, and as the receivers of a G-buffer. */
#define HALFSHADE_DEFAULT_LIFT (-1.0)

typedef struct halfshade_receivers {
  size_t struct_size;
  halfshade_points positions;          /* world space */
  halfshade_points normals;            /* geometric, on the side that is asked, of any length; or empty */
  halfshade_indices meshes, triangles; /* own triangle: numbers, or HALFSHADE_NONE; both empty: none has one */
  double lift;                         /* along the normals, in half-widths of the local frame, or DEFAULT_LIFT */
  uint32_t first;                      /* number of receiver 0, from which sets of light samples are chosen */
  uint32_t frame;                      /* instead of the solver's, unless HALFSHADE_NONE */
} halfshade_receivers;
#define HALFSHADE_RECEIVERS_INIT \
  { .struct_size = sizeof(halfshade_receivers), .lift = HALFSHADE_DEFAULT_LIFT, .frame = HALFSHADE_NONE }

/* Each array is NULL (not wanted) or has exactly as many elements as stated; the counts are there to be checked. */
typedef struct halfshade_output {
  size_t struct_size;
  uint64_t* masks; /* [light][receiver][word]: bit i is set where sample i of the light is hidden */
  size_t mask_count;
  float* visibility; /* [light][receiver]: fraction of samples not hidden */
  size_t visibility_count;
  float* irradiance; /* [light][receiver][3] linear RGB; needs normals */
  size_t irradiance_count;
  float* total_irradiance; /* [receiver][3]: sum over lights */
  size_t total_irradiance_count;
} halfshade_output;
#define HALFSHADE_OUTPUT_INIT \
  { .struct_size = sizeof(halfshade_output) }

typedef struct halfshade_solve_stats {
  size_t struct_size;
  double build_ms, index_ms, cull_ms, test_ms;
  uint64_t receivers, triangles, pairs_tested, sample_tests, exact_fallbacks, bytes;
  uint64_t lights_kept, lights_made;
} halfshade_solve_stats;

HALFSHADE_API halfshade_status halfshade_solver_create(halfshade_context* context, const halfshade_solver_desc* desc,
                                                       halfshade_solver** solver);
HALFSHADE_API void halfshade_solver_destroy(halfshade_solver** solver);
HALFSHADE_API halfshade_status halfshade_solver_sample_count(halfshade_context* context, const halfshade_solver* solver,
                                                             const halfshade_light* light, uint32_t* samples);
/* 64-bit words per receiver and light. `lights` is an array of light_count elements that lie lights[0].struct_size
 * bytes apart, here and below. */
HALFSHADE_API halfshade_status halfshade_solver_mask_words(halfshade_context* context, const halfshade_solver* solver,
                                                           const halfshade_light* lights, size_t light_count,
                                                           size_t* words);

HALFSHADE_API halfshade_status halfshade_workspace_create(halfshade_context* context,
                                                          const halfshade_workspace_desc* desc,
                                                          halfshade_workspace** workspace);
HALFSHADE_API void halfshade_workspace_destroy(halfshade_workspace** workspace);
HALFSHADE_API halfshade_status halfshade_workspace_clear(halfshade_context* context, halfshade_workspace* workspace);
/* Of the last solve. Set stats->struct_size before. */
HALFSHADE_API halfshade_status halfshade_workspace_get_stats(halfshade_context* context,
                                                             const halfshade_workspace* workspace,
                                                             halfshade_solve_stats* stats);

HALFSHADE_API halfshade_status halfshade_solve(halfshade_context* context, const halfshade_solver* solver,
                                               const halfshade_scene* scene, halfshade_workspace* workspace,
                                               const halfshade_receivers* receivers, const halfshade_light* lights,
                                               size_t light_count, const halfshade_output* output);

/* ---- Pictures: rasterizer.h ---- */

typedef struct halfshade_camera {
  size_t struct_size;
  double eye[3], target[3], up[3], fov_y_deg;
  uint32_t width, height; /* 1..16384 each */
} halfshade_camera;
#define HALFSHADE_CAMERA_INIT                                                                                  \
  {                                                                                                            \
    .struct_size = sizeof(halfshade_camera), .eye = {0, 0, 5}, .up = {0, 1, 0}, .fov_y_deg = 45, .width = 512, \
    .height = 512                                                                                              \
  }

/* What a G-buffer holds, [height][width], row 0 = top; belongs to it and is valid until the next rasterize into it. */
typedef struct halfshade_gbuffer_view {
  size_t struct_size;
  uint32_t width, height;
  const uint32_t* triangle;      /* visible triangle, or HALFSHADE_NONE for the background */
  const double* position;        /* [3], local frame of the scene: see halfshade_scene_to_world */
  const float* geometric_normal; /* [3], unit, on the camera's side */
  const float* albedo;           /* [3], linear RGB */
  const float* depth;            /* along the camera's axis, local frame units */
  const float* shading_normal;   /* [3], unit, interpolated; = geometric_normal where the scene has none */
} halfshade_gbuffer_view;

HALFSHADE_API halfshade_status halfshade_gbuffer_create(halfshade_context* context, halfshade_gbuffer** gbuffer);
HALFSHADE_API void halfshade_gbuffer_destroy(halfshade_gbuffer** gbuffer);
HALFSHADE_API halfshade_status halfshade_rasterize(halfshade_context* context, const halfshade_scene* scene,
                                                   const halfshade_camera* camera, halfshade_gbuffer* gbuffer);
/* Set view->struct_size before. */
HALFSHADE_API halfshade_status halfshade_gbuffer_get_view(halfshade_context* context, const halfshade_gbuffer* gbuffer,
                                                          halfshade_gbuffer_view* view);
/* Which triangle of which mesh has this number in a G-buffer. */
HALFSHADE_API halfshade_status halfshade_scene_triangle_of(halfshade_context* context, const halfshade_scene* scene,
                                                           uint32_t number, uint32_t* mesh, uint32_t* triangle);
/* Receivers are the entries of a G-buffer of the same scene, made since its last commit. */
HALFSHADE_API halfshade_status halfshade_solve_gbuffer(halfshade_context* context, const halfshade_solver* solver,
                                                       const halfshade_scene* scene, halfshade_workspace* workspace,
                                                       const halfshade_gbuffer* gbuffer, const halfshade_light* lights,
                                                       size_t light_count, const halfshade_output* output);

#ifdef __cplusplus
}
#endif

#endif
