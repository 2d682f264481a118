/* The C interface as C sees it: what calls return, what they write, and what they do with nonsense. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "halfshade/c_api.h"

static int failures = 0;

#define CHECK(condition)                                              \
  do {                                                                \
    if (!(condition)) {                                               \
      fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
      ++failures;                                                     \
    }                                                                 \
  } while (0)

/* The call fails with `status`, and the message holds `part`. */
#define CHECK_FAILS(call, status, part)                                                                           \
  do {                                                                                                            \
    const halfshade_status got = (call);                                                                          \
    if (got != (status) || strstr(halfshade_last_error(f.context), (part)) == NULL) {                             \
      fprintf(stderr, "%s:%d: status '%s', message \"%s\": %s\n", __FILE__, __LINE__, halfshade_status_name(got), \
              halfshade_last_error(f.context), #call);                                                            \
      ++failures;                                                                                                 \
    }                                                                                                             \
  } while (0)

#define CHECK_OK(call) CHECK_FAILS(call, HALFSHADE_OK, "")

/* Half of a square light is hidden by a half-plane at y = 2, seen from the origin below its edge. */
typedef struct fixture {
  halfshade_context* context;
  halfshade_scene* scene;
  halfshade_solver* solver;
  halfshade_workspace* workspace;
  halfshade_light light;
  halfshade_receivers receivers;
  halfshade_output output;
  uint32_t mesh;
  float visibility[3];
  uint64_t masks[3 * 4];
} fixture;

static const float kHalfPlane[4][3] = {{-64, 2, -64}, {0, 2, -64}, {0, 2, 64}, {-64, 2, 64}};
static const uint32_t kTriangles[2][3] = {{0, 1, 2}, {0, 2, 3}};
static const double kReceivers[3][3] = {{-32, 0, 0}, {0, 0, 0}, {32, 0, 0}};

static halfshade_points floats(const void* data, size_t count) {
  const halfshade_points points = {data, count, 0, HALFSHADE_FLOAT32};
  return points;
}

static halfshade_points doubles(const void* data, size_t count) {
  const halfshade_points points = {data, count, 0, HALFSHADE_FLOAT64};
  return points;
}

static halfshade_mesh_desc half_plane(void) {
  halfshade_mesh_desc mesh = HALFSHADE_MESH_INIT;
  mesh.positions = floats(kHalfPlane, 4);
  mesh.triangles.data = kTriangles[0];
  mesh.triangles.count = 2;
  return mesh;
}

static void set_up(fixture* out, const halfshade_context_desc* desc) {
  fixture f;
  memset(&f, 0, sizeof f);
  CHECK(halfshade_context_create(desc, &f.context) == HALFSHADE_OK);
  CHECK_OK(halfshade_scene_create(f.context, NULL, &f.scene));
  halfshade_solver_desc solver = HALFSHADE_SOLVER_INIT;
  solver.pattern = "uniform";
  CHECK_OK(halfshade_solver_create(f.context, &solver, &f.solver));
  CHECK_OK(halfshade_workspace_create(f.context, NULL, &f.workspace));
  const halfshade_mesh_desc mesh = half_plane();
  CHECK_OK(halfshade_scene_add_mesh(f.context, f.scene, &mesh, &f.mesh));
  const halfshade_light light = HALFSHADE_LIGHT_INIT;
  f.light = light;
  f.light.center[1] = 4;
  f.light.u[0] = 2;
  f.light.v[2] = 2;
  const halfshade_receivers receivers = HALFSHADE_RECEIVERS_INIT;
  f.receivers = receivers;
  f.receivers.positions = doubles(kReceivers, 3);
  const halfshade_output output = HALFSHADE_OUTPUT_INIT;
  f.output = output;
  f.output.visibility_count = 3;
  f.output.mask_count = 3 * 4;
  CHECK_OK(halfshade_scene_commit(f.context, f.scene));
  *out = f;
  out->output.visibility = out->visibility;
  out->output.masks = out->masks;
}

static halfshade_status solve(fixture* f) {
  return halfshade_solve(f->context, f->solver, f->scene, f->workspace, &f->receivers, &f->light, 1, &f->output);
}

static void tear_down(fixture* f) {
  halfshade_workspace_destroy(&f->workspace);
  halfshade_solver_destroy(&f->solver);
  halfshade_scene_destroy(&f->scene);
  halfshade_context_destroy(&f->context);
  CHECK(f->workspace == NULL && f->solver == NULL && f->scene == NULL && f->context == NULL);
}

static void half_of_the_light_is_hidden(void) {
  fixture f;
  set_up(&f, NULL);
  CHECK_OK(solve(&f));
  CHECK(f.visibility[0] == 0.0f && f.visibility[1] == 0.5f && f.visibility[2] == 1.0f);
  uint32_t samples = 0;
  size_t words = 0;
  CHECK_OK(halfshade_solver_sample_count(f.context, f.solver, &f.light, &samples));
  CHECK_OK(halfshade_solver_mask_words(f.context, f.solver, &f.light, 1, &words));
  CHECK(samples == 256 && words == 4);
  for (size_t i = 0; i < 4; ++i) CHECK(f.masks[i] == ~(uint64_t)0 && f.masks[8 + i] == 0);

  halfshade_solve_stats stats = {.struct_size = sizeof stats};
  CHECK_OK(halfshade_workspace_get_stats(f.context, f.workspace, &stats));
  CHECK(stats.receivers == 3);
  halfshade_scene_stats counts = {.struct_size = sizeof counts};
  CHECK_OK(halfshade_scene_get_stats(f.context, f.scene, &counts));
  CHECK(counts.triangles == 2 && counts.meshes == 1 && counts.commits == 1);
  tear_down(&f);
}

static void meshes_move_and_go(void) {
  fixture f;
  set_up(&f, NULL);
  const double moved[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  double aside[12];
  memcpy(aside, moved, sizeof aside);
  aside[3] = -8; /* the edge is at x = -8 then */
  CHECK_OK(halfshade_scene_set_transform(f.context, f.scene, f.mesh, aside));
  CHECK_FAILS(solve(&f), HALFSHADE_ERROR_USAGE, "commit");
  CHECK_OK(halfshade_scene_commit(f.context, f.scene));
  CHECK_OK(solve(&f));
  CHECK(f.visibility[0] == 0.0f && f.visibility[1] == 1.0f);
  CHECK_OK(halfshade_scene_set_transform(f.context, f.scene, f.mesh, moved));
  float vertices[4][3];
  memcpy(vertices, kHalfPlane, sizeof vertices);
  for (int i = 0; i < 4; ++i) vertices[i][1] = -1; /* below the receivers */
  const halfshade_points below = floats(vertices, 4);
  CHECK_OK(halfshade_scene_set_positions(f.context, f.scene, f.mesh, &below));
  CHECK_OK(halfshade_scene_extend_light(f.context, f.scene, &f.light));
  CHECK_OK(halfshade_scene_commit(f.context, f.scene));
  CHECK_OK(solve(&f));
  CHECK(f.visibility[0] == 1.0f);
  CHECK_OK(halfshade_scene_remove_mesh(f.context, f.scene, f.mesh));
  CHECK_FAILS(halfshade_scene_remove_mesh(f.context, f.scene, f.mesh), HALFSHADE_ERROR_USAGE, "");
  tear_down(&f);
}

static void strides_lead_from_element_to_element(void) {
  fixture f;
  set_up(&f, NULL);
  struct vertex {
    uint16_t tag;
    float position[3];
  } vertices[4];
  struct vertex packed_badly[5];
  for (int i = 0; i < 4; ++i) {
    vertices[i].tag = 7;
    memcpy(vertices[i].position, kHalfPlane[i], sizeof vertices[i].position);
  }
  char* odd = (char*)packed_badly + 1; /* no alignment is asked for */
  memcpy(odd, vertices, sizeof vertices);
  halfshade_mesh_desc mesh = half_plane();
  mesh.positions.data = odd + offsetof(struct vertex, position);
  mesh.positions.stride_bytes = sizeof(struct vertex);
  CHECK_OK(halfshade_scene_remove_mesh(f.context, f.scene, f.mesh));
  CHECK_OK(halfshade_scene_add_mesh(f.context, f.scene, &mesh, NULL));
  CHECK_OK(halfshade_scene_commit(f.context, f.scene));
  CHECK_OK(solve(&f));
  CHECK(f.visibility[0] == 0.0f && f.visibility[1] == 0.5f && f.visibility[2] == 1.0f);
  tear_down(&f);
}

static int stop(void* asked, double done) {
  CHECK(done >= 0.0 && done <= 1.0);
  ++*(int*)asked;
  return 0;
}

static void progress_cancels(void) {
  fixture f;
  int asked = 0;
  halfshade_context_desc desc = HALFSHADE_CONTEXT_INIT;
  set_up(&f, NULL);
  desc.progress = stop;
  desc.progress_user = &asked;
  halfshade_context* stopping = NULL;
  CHECK(halfshade_context_create(&desc, &stopping) == HALFSHADE_OK);
  CHECK(halfshade_solve(stopping, f.solver, f.scene, f.workspace, &f.receivers, &f.light, 1, &f.output) ==
        HALFSHADE_ERROR_CANCELLED);
  CHECK(asked == 1);
  CHECK(strlen(halfshade_last_error(stopping)) > 0);
  CHECK_OK(solve(&f)); /* everything is as usable as before */
  CHECK(f.visibility[1] == 0.5f);
  halfshade_context_destroy(&stopping);
  tear_down(&f);
}

static void backwards(void* calls, size_t count, void (*body)(const void*, size_t), const void* body_context) {
  ++*(int*)calls;
  for (size_t i = count; i-- > 0;) body(body_context, i);
}

static void loops_run_where_the_host_says(void) {
  fixture f;
  int calls = 0;
  halfshade_context_desc desc = HALFSHADE_CONTEXT_INIT;
  desc.executor = HALFSHADE_EXECUTOR_HOST;
  desc.parallel_for = backwards;
  desc.parallel_for_user = &calls;
  desc.concurrency = 2;
  set_up(&f, &desc);
  enum { MANY = 20000 };
  static double points[MANY][3];
  static float visibility[MANY];
  for (int i = 0; i < MANY; ++i) points[i][0] = i % 2 == 0 ? -32 : 32;
  f.receivers.positions = doubles(points, MANY);
  f.output.visibility = visibility;
  f.output.visibility_count = MANY;
  f.output.masks = NULL;
  f.output.mask_count = 0;
  CHECK_OK(solve(&f));
  CHECK(calls > 0);
  for (int i = 0; i < MANY; ++i) CHECK(visibility[i] == (float)(i % 2));
  tear_down(&f);

  desc.executor = HALFSHADE_EXECUTOR_SERIAL;
  set_up(&f, &desc);
  CHECK_OK(solve(&f));
  CHECK(f.visibility[1] == 0.5f);
  tear_down(&f);
}

static void pictures(void) {
  fixture f;
  set_up(&f, NULL);
  const float ground[4][3] = {{-32, 0, -32}, {-32, 0, 32}, {32, 0, 32}, {32, 0, -32}};
  halfshade_mesh_desc mesh = half_plane();
  mesh.positions = floats(ground, 4);
  uint32_t ground_mesh = 0;
  CHECK_OK(halfshade_scene_add_mesh(f.context, f.scene, &mesh, &ground_mesh));
  CHECK_OK(halfshade_scene_commit(f.context, f.scene));
  halfshade_gbuffer* gbuffer = NULL;
  CHECK_OK(halfshade_gbuffer_create(f.context, &gbuffer));
  halfshade_gbuffer_view view = {.struct_size = sizeof view};
  CHECK_FAILS(halfshade_gbuffer_get_view(f.context, gbuffer, &view), HALFSHADE_ERROR_USAGE, "empty");
  halfshade_camera camera = HALFSHADE_CAMERA_INIT;
  const double eye[3] = {0, 1, 12};
  memcpy(camera.eye, eye, sizeof eye);
  camera.width = 32;
  camera.height = 16;
  CHECK_OK(halfshade_rasterize(f.context, f.scene, &camera, gbuffer));
  CHECK_OK(halfshade_gbuffer_get_view(f.context, gbuffer, &view));
  CHECK(view.width == 32 && view.height == 16);
  uint32_t found_mesh = 0, found_triangle = 9;
  const uint32_t seen = view.triangle[12 * 32 + 16];
  CHECK_OK(halfshade_scene_triangle_of(f.context, f.scene, seen, &found_mesh, &found_triangle));
  CHECK(found_mesh == ground_mesh && found_triangle < 2);
  float picture[16 * 32];
  f.output.visibility = picture;
  f.output.visibility_count = 16 * 32;
  f.output.masks = NULL;
  f.output.mask_count = 0;
  CHECK_OK(halfshade_solve_gbuffer(f.context, f.solver, f.scene, f.workspace, gbuffer, &f.light, 1, &f.output));
  CHECK(picture[12 * 32 + 2] < 0.1f && picture[12 * 32 + 29] > 0.9f); /* shadow on the left */
  CHECK(fabsf(view.shading_normal[3 * (12 * 32 + 16) + 1] - 1.0f) < 1e-6f);
  /* Entries of a row, put to world space, are receivers with the same result. */
  double world[32 * 3];
  uint32_t meshes[32], triangles[32];
  float row[32];
  const halfshade_points local = doubles(view.position + 3 * 12 * 32, 32);
  CHECK_OK(halfshade_scene_to_world(f.context, f.scene, &local, world));
  for (int i = 0; i < 32; ++i) {
    CHECK(fabs(world[3 * i + 1]) < 1e-6);
    CHECK_OK(halfshade_scene_triangle_of(f.context, f.scene, view.triangle[12 * 32 + i], &meshes[i], &triangles[i]));
  }
  CHECK(world[0] < -1.0 && world[3 * 31] > 1.0 && world[2] < eye[2]);
  halfshade_receivers of_row = HALFSHADE_RECEIVERS_INIT;
  of_row.positions = doubles(world, 32);
  of_row.normals = floats(view.geometric_normal + 3 * 12 * 32, 32);
  of_row.meshes.data = meshes;
  of_row.triangles.data = triangles;
  of_row.meshes.count = of_row.triangles.count = 32;
  of_row.first = 12 * 32;
  f.output.visibility = row;
  f.output.visibility_count = 32;
  CHECK_OK(halfshade_solve(f.context, f.solver, f.scene, f.workspace, &of_row, &f.light, 1, &f.output));
  for (int i = 0; i < 32; ++i) CHECK(row[i] == picture[12 * 32 + i]);
  CHECK_FAILS(halfshade_scene_to_world(f.context, f.scene, &local, NULL), HALFSHADE_ERROR_USAGE, "world");
  CHECK_FAILS(halfshade_scene_to_world(f.context, f.scene, NULL, world), HALFSHADE_ERROR_USAGE, "local");
  f.output.visibility = picture;
  f.output.visibility_count = 0; /* of an array that is wanted */
  CHECK_FAILS(halfshade_solve_gbuffer(f.context, f.solver, f.scene, f.workspace, gbuffer, &f.light, 1, &f.output),
              HALFSHADE_ERROR_USAGE, "visibility");
  f.output.visibility_count = 5;
  CHECK_FAILS(halfshade_solve_gbuffer(f.context, f.solver, f.scene, f.workspace, gbuffer, &f.light, 1, &f.output),
              HALFSHADE_ERROR_USAGE, "visibility");
  /* A moved light needs no new picture, a moved mesh does. */
  f.output.visibility_count = 16 * 32;
  f.light.center[0] = 1;
  CHECK_OK(halfshade_solve_gbuffer(f.context, f.solver, f.scene, f.workspace, gbuffer, &f.light, 1, &f.output));
  const double moved[12] = {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0};
  CHECK_OK(halfshade_scene_set_transform(f.context, f.scene, f.mesh, moved));
  CHECK_OK(halfshade_scene_commit(f.context, f.scene));
  picture[0] = -1;
  CHECK_FAILS(halfshade_solve_gbuffer(f.context, f.solver, f.scene, f.workspace, gbuffer, &f.light, 1, &f.output),
              HALFSHADE_ERROR_USAGE, "older than a commit");
  CHECK(picture[0] == -1);
  CHECK_OK(halfshade_rasterize(f.context, f.scene, &camera, gbuffer));
  CHECK_OK(halfshade_solve_gbuffer(f.context, f.solver, f.scene, f.workspace, gbuffer, &f.light, 1, &f.output));
  fixture other;
  set_up(&other, NULL);
  CHECK_FAILS(halfshade_solve_gbuffer(f.context, f.solver, other.scene, f.workspace, gbuffer, &f.light, 1, &f.output),
              HALFSHADE_ERROR_USAGE, "another scene");
  tear_down(&other);
  halfshade_gbuffer_destroy(&gbuffer);
  tear_down(&f);
}

static void null_handles_are_refused(void) {
  fixture f;
  set_up(&f, NULL);
  CHECK(halfshade_context_create(NULL, NULL) == HALFSHADE_ERROR_USAGE);
  CHECK(halfshade_scene_commit(NULL, f.scene) == HALFSHADE_ERROR_USAGE);
  CHECK(strlen(halfshade_last_error(NULL)) > 0);
  CHECK_FAILS(halfshade_scene_commit(f.context, NULL), HALFSHADE_ERROR_USAGE, "scene is NULL");
  CHECK_FAILS(halfshade_scene_create(f.context, NULL, NULL), HALFSHADE_ERROR_USAGE, "scene is NULL");
  CHECK_FAILS(halfshade_scene_add_mesh(f.context, f.scene, NULL, NULL), HALFSHADE_ERROR_USAGE, "mesh is NULL");
  CHECK_FAILS(halfshade_scene_set_transform(f.context, f.scene, 0, NULL), HALFSHADE_ERROR_USAGE, "transform is NULL");
  CHECK_FAILS(halfshade_solve(f.context, NULL, f.scene, f.workspace, &f.receivers, &f.light, 1, &f.output),
              HALFSHADE_ERROR_USAGE, "solver is NULL");
  CHECK_FAILS(halfshade_solve(f.context, f.solver, f.scene, NULL, &f.receivers, &f.light, 1, &f.output),
              HALFSHADE_ERROR_USAGE, "workspace is NULL");
  CHECK_FAILS(halfshade_solve(f.context, f.solver, f.scene, f.workspace, NULL, &f.light, 1, &f.output),
              HALFSHADE_ERROR_USAGE, "receivers is NULL");
  CHECK_FAILS(halfshade_solve(f.context, f.solver, f.scene, f.workspace, &f.receivers, NULL, 1, &f.output),
              HALFSHADE_ERROR_USAGE, "lights");
  CHECK_FAILS(halfshade_solve(f.context, f.solver, f.scene, f.workspace, &f.receivers, &f.light, 1, NULL),
              HALFSHADE_ERROR_USAGE, "output is NULL");
  f.receivers.positions.data = NULL;
  CHECK_FAILS(solve(&f), HALFSHADE_ERROR_USAGE, "receivers.positions");
  tear_down(&f);
  tear_down(&f); /* all NULL now */
  halfshade_scene_destroy(NULL);
}

static void handles_of_another_kind_are_refused(void) {
  fixture f;
  set_up(&f, NULL);
  halfshade_scene* wrong = (halfshade_scene*)(void*)f.workspace;
  CHECK_FAILS(halfshade_scene_commit(f.context, wrong), HALFSHADE_ERROR_USAGE, "not a scene");
  CHECK(halfshade_scene_commit((halfshade_context*)(void*)f.scene, f.scene) == HALFSHADE_ERROR_USAGE);
  halfshade_scene_destroy(&wrong);
  CHECK(wrong != NULL);
  CHECK_OK(solve(&f)); /* the workspace is still there */
  tear_down(&f);
}

static void the_sun_is_a_far_disk(void) {
  fixture f;
  set_up(&f, NULL);
  /* From straight above, the half-plane hides all of the sun from what is left of its edge. */
  const double low[3] = {-64, 0, -64}, high[3] = {64, 2, 64};
  const halfshade_light initial = HALFSHADE_LIGHT_INIT;
  halfshade_light sun = initial;
  sun.shape = HALFSHADE_LIGHT_SUN;
  f.light = sun;
  CHECK_FAILS(solve(&f), HALFSHADE_ERROR_USAGE, "place_sun");
  CHECK_OK(halfshade_place_sun(f.context, &sun, low, high, &f.light));
  CHECK(f.light.shape == HALFSHADE_LIGHT_DISK && f.light.center[1] > 100000 && f.light.struct_size == sizeof f.light);
  const double half_angle = atan(f.light.radius / (f.light.center[1] - 1));
  CHECK(fabs(2 * half_angle * 57.29577951308232 - 0.533) < 1e-9);
  CHECK_FAILS(solve(&f), HALFSHADE_ERROR_BAD_INPUT, "reach");
  CHECK_OK(halfshade_scene_extend_light(f.context, f.scene, &f.light));
  CHECK_OK(halfshade_scene_commit(f.context, f.scene));
  CHECK_OK(solve(&f));
  CHECK(f.visibility[0] == 0.0f && f.visibility[1] > 0.45f && f.visibility[1] < 0.55f && f.visibility[2] == 1.0f);

  halfshade_light placed = initial;
  CHECK_OK(halfshade_place_sun(f.context, &initial, low, high, &placed));
  CHECK(memcmp(&placed, &initial, sizeof placed) == 0); /* no sun: as it was */
  sun.angular_diameter_deg = 61;
  CHECK_FAILS(halfshade_place_sun(f.context, &sun, low, high, &placed), HALFSHADE_ERROR_BAD_INPUT, "60");
  CHECK_FAILS(halfshade_place_sun(f.context, &sun, NULL, high, &placed), HALFSHADE_ERROR_USAGE, "low is NULL");
  CHECK_FAILS(halfshade_place_sun(f.context, &initial, low, high, NULL), HALFSHADE_ERROR_USAGE, "placed is NULL");
  CHECK(memcmp(&placed, &initial, sizeof placed) == 0);
  tear_down(&f);
}

static void lights_without_samples_are_refused(void) {
  fixture f;
  set_up(&f, NULL);
  f.light.shape = HALFSHADE_LIGHT_SAMPLES;
  uint32_t samples = 7;
  size_t words = 7;
  CHECK_FAILS(halfshade_solver_sample_count(f.context, f.solver, &f.light, &samples), HALFSHADE_ERROR_BAD_INPUT,
              "no sample points");
  CHECK_FAILS(halfshade_solver_mask_words(f.context, f.solver, &f.light, 1, &words), HALFSHADE_ERROR_BAD_INPUT,
              "no sample points");
  CHECK(samples == 7 && words == 7);
  CHECK_FAILS(solve(&f), HALFSHADE_ERROR_BAD_INPUT, "no sample points");
  tear_down(&f);
}

static void wrong_sizes_are_refused(void) {
  fixture f;
  set_up(&f, NULL);
  const size_t wrong_sizes[] = {0, 1, sizeof(halfshade_light) - 1, sizeof(halfshade_light) + 100000, (size_t)-1};
  for (size_t i = 0; i < sizeof wrong_sizes / sizeof *wrong_sizes; ++i) {
    f.light.struct_size = wrong_sizes[i];
    CHECK_FAILS(solve(&f), HALFSHADE_ERROR_USAGE, "struct_size");
  }
  f.light.struct_size = sizeof f.light;
  halfshade_scene_stats stats = {.struct_size = 8};
  CHECK_FAILS(halfshade_scene_get_stats(f.context, f.scene, &stats), HALFSHADE_ERROR_USAGE, "struct_size");

  /* A later version's struct: fine as long as what is new in it is zero. */
  struct {
    halfshade_light known;
    double later[2];
  } lights[2];
  memset(lights, 0, sizeof lights);
  lights[0].known = lights[1].known = f.light;
  lights[0].known.struct_size = lights[1].known.struct_size = sizeof lights[0];
  lights[1].known.center[0] = 32;
  float visibility[2][3];
  f.output.visibility = visibility[0];
  f.output.visibility_count = 6;
  f.output.masks = NULL;
  f.output.mask_count = 0;
  CHECK_OK(halfshade_solve(f.context, f.solver, f.scene, f.workspace, &f.receivers, &lights[0].known, 2, &f.output));
  CHECK(visibility[0][1] == 0.5f && visibility[1][1] == 1.0f);
  lights[1].later[1] = 1;
  CHECK_FAILS(halfshade_solve(f.context, f.solver, f.scene, f.workspace, &f.receivers, &lights[0].known, 2, &f.output),
              HALFSHADE_ERROR_USAGE, "later version");
  /* Elements that would lie at odd addresses; one that says it is larger than its place. */
  lights[0].known.struct_size = sizeof(halfshade_light) + 1;
  CHECK_FAILS(halfshade_solve(f.context, f.solver, f.scene, f.workspace, &f.receivers, &lights[0].known, 2, &f.output),
              HALFSHADE_ERROR_USAGE, "struct_size");
  lights[0].known.struct_size = sizeof lights[0];
  lights[1].known.struct_size = sizeof lights[0] + 4000;
  CHECK_FAILS(halfshade_solve(f.context, f.solver, f.scene, f.workspace, &f.receivers, &lights[0].known, 2, &f.output),
              HALFSHADE_ERROR_USAGE, "differ in struct_size");
  /* No lights, no receivers: nothing to do, with whatever arrays. */
  f.output.visibility_count = 0;
  CHECK_OK(halfshade_solve(f.context, f.solver, f.scene, f.workspace, &f.receivers, NULL, 0, &f.output));
  f.receivers.positions.count = 0;
  CHECK_OK(solve(&f));
  tear_down(&f);
}

static void counts_beyond_31_bits_are_refused(void) {
  fixture f;
  set_up(&f, NULL);
  const size_t too_many = (size_t)1 << 31;
  halfshade_mesh_desc mesh = half_plane();
  mesh.positions.count = too_many;
  CHECK_FAILS(halfshade_scene_add_mesh(f.context, f.scene, &mesh, NULL), HALFSHADE_ERROR_LIMIT, "mesh.positions");
  mesh = half_plane();
  mesh.triangles.count = too_many;
  CHECK_FAILS(halfshade_scene_add_mesh(f.context, f.scene, &mesh, NULL), HALFSHADE_ERROR_LIMIT, "mesh.triangles");
  mesh = half_plane();
  mesh.positions.stride_bytes = too_many;
  CHECK_FAILS(halfshade_scene_add_mesh(f.context, f.scene, &mesh, NULL), HALFSHADE_ERROR_LIMIT, "stride");
  mesh = half_plane();
  mesh.positions.stride_bytes = 4;
  CHECK_FAILS(halfshade_scene_add_mesh(f.context, f.scene, &mesh, NULL), HALFSHADE_ERROR_USAGE, "stride");
  CHECK_FAILS(halfshade_solve(f.context, f.solver, f.scene, f.workspace, &f.receivers, &f.light, too_many, &f.output),
              HALFSHADE_ERROR_LIMIT, "lights");
  f.output.mask_count = (size_t)-1;
  CHECK_FAILS(solve(&f), HALFSHADE_ERROR_LIMIT, "output.masks");
  tear_down(&f);
}

static void wrong_content_is_named(void) {
  fixture f;
  set_up(&f, NULL);
  float vertices[4][3];
  memcpy(vertices, kHalfPlane, sizeof vertices);
  vertices[3][1] = (float)NAN;
  halfshade_mesh_desc mesh = half_plane();
  mesh.positions = floats(vertices, 4);
  CHECK_FAILS(halfshade_scene_add_mesh(f.context, f.scene, &mesh, NULL), HALFSHADE_ERROR_BAD_INPUT, "3");
  const uint32_t beyond[3] = {0, 1, 4};
  mesh = half_plane();
  mesh.triangles.data = beyond;
  mesh.triangles.count = 1;
  CHECK_FAILS(halfshade_scene_add_mesh(f.context, f.scene, &mesh, NULL), HALFSHADE_ERROR_BAD_INPUT, "4");
  mesh = half_plane();
  mesh.positions.scalar = (halfshade_scalar)7;
  CHECK_FAILS(halfshade_scene_add_mesh(f.context, f.scene, &mesh, NULL), HALFSHADE_ERROR_USAGE, "scalar");
  f.light.shape = (halfshade_light_shape)99;
  CHECK_FAILS(solve(&f), HALFSHADE_ERROR_USAGE, "shape");

  halfshade_solver* solver = NULL;
  halfshade_solver_desc desc = HALFSHADE_SOLVER_INIT;
  desc.light_sample_count = 5000;
  CHECK_FAILS(halfshade_solver_create(f.context, &desc, &solver), HALFSHADE_ERROR_USAGE, "4096");
  desc.light_sample_count = 256;
  desc.method = "magic";
  CHECK_FAILS(halfshade_solver_create(f.context, &desc, &solver), HALFSHADE_ERROR_USAGE, "magic");
  desc.method = "hpc";
  desc.options = "hpc.leaf=8 hpc.leaf=0";
  CHECK_FAILS(halfshade_solver_create(f.context, &desc, &solver), HALFSHADE_ERROR_USAGE, "leaf");
  CHECK(solver == NULL);

  f.light.shape = HALFSHADE_LIGHT_RECTANGLE;
  f.output.mask_count = 11;
  f.masks[0] = 42;
  CHECK_FAILS(solve(&f), HALFSHADE_ERROR_USAGE, "masks");
  CHECK(f.masks[0] == 42);
  float irradiance[9];
  f.output.mask_count = 12;
  f.output.irradiance = irradiance;
  f.output.irradiance_count = 9;
  CHECK_FAILS(solve(&f), HALFSHADE_ERROR_USAGE, "normals");
  f.output.irradiance_count = 8;
  CHECK_FAILS(solve(&f), HALFSHADE_ERROR_USAGE, "multiple of 3");
  tear_down(&f);
}

static halfshade_status reentered;

static int reenter(void* user, double done) {
  fixture* f = *(fixture**)user;
  (void)done;
  reentered = solve(f);
  return 1;
}

static void one_call_at_a_time(void) {
  fixture f;
  fixture* place = &f;
  halfshade_context_desc desc = HALFSHADE_CONTEXT_INIT;
  desc.progress = reenter;
  desc.progress_user = &place;
  memset(&f, 0, sizeof f); /* commit() asks too; there is nothing to enter then */
  set_up(&f, &desc);
  reentered = HALFSHADE_OK;
  CHECK_OK(solve(&f));
  CHECK(reentered == HALFSHADE_ERROR_USAGE);
  tear_down(&f);
}

int main(void) {
  CHECK(halfshade_version() == HALFSHADE_VERSION);
  CHECK(strcmp(halfshade_status_name(HALFSHADE_ERROR_BAD_INPUT), "bad input") == 0);
  CHECK(strcmp(halfshade_status_name((halfshade_status)99), "unknown") == 0);
  half_of_the_light_is_hidden();
  meshes_move_and_go();
  strides_lead_from_element_to_element();
  progress_cancels();
  loops_run_where_the_host_says();
  pictures();
  null_handles_are_refused();
  handles_of_another_kind_are_refused();
  the_sun_is_a_far_disk();
  lights_without_samples_are_refused();
  wrong_sizes_are_refused();
  counts_beyond_31_bits_are_refused();
  wrong_content_is_named();
  one_call_at_a_time();
  if (failures == 0) puts("all checks passed");
  return failures == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
