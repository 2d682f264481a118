/* Soft shadow of a square plate on a floor, as text: minimal.cpp in C. */
#include <stdio.h>
#include <stdlib.h>

#include "halfshade/c_api.h"

#define WIDTH 64
#define HEIGHT 24

int main(void) {
  const float plate[4][3] = {{-1, 2, -1}, {1, 2, -1}, {1, 2, 1}, {-1, 2, 1}};
  const uint32_t triangles[2][3] = {{0, 1, 2}, {0, 2, 3}};
  static double floor_points[HEIGHT * WIDTH][3];
  static float visibility[HEIGHT * WIDTH];
  for (int i = 0; i < HEIGHT * WIDTH; ++i) {
    floor_points[i][0] = (i % WIDTH + 0.5) / WIDTH * 10 - 5;
    floor_points[i][2] = (i / WIDTH + 0.5) / HEIGHT * 7.5 - 3.75;
  }

  halfshade_context* context = NULL;
  halfshade_scene* scene = NULL;
  halfshade_solver* solver = NULL;
  halfshade_workspace* workspace = NULL;
  if (halfshade_context_create(NULL, &context) != HALFSHADE_OK) return EXIT_FAILURE;

  halfshade_mesh_desc mesh = HALFSHADE_MESH_INIT;
  mesh.positions = (halfshade_points){plate, 4, 0, HALFSHADE_FLOAT32};
  mesh.triangles = (halfshade_indices){triangles[0], 2, 0};

  halfshade_light light = HALFSHADE_LIGHT_INIT; /* faces the floor: u x v points down */
  light.center[1] = 5;
  light.u[0] = 2;
  light.v[2] = 2;

  halfshade_receivers receivers = HALFSHADE_RECEIVERS_INIT;
  receivers.positions = (halfshade_points){floor_points, HEIGHT * WIDTH, 0, HALFSHADE_FLOAT64};
  halfshade_output output = HALFSHADE_OUTPUT_INIT;
  output.visibility = visibility;
  output.visibility_count = HEIGHT * WIDTH;

  const int ok = !halfshade_scene_create(context, NULL, &scene) && !halfshade_solver_create(context, NULL, &solver) &&
                 !halfshade_workspace_create(context, NULL, &workspace) &&
                 !halfshade_scene_add_mesh(context, scene, &mesh, NULL) &&
                 !halfshade_scene_extend_points(context, scene, &receivers.positions) &&
                 !halfshade_scene_extend_light(context, scene, &light) && !halfshade_scene_commit(context, scene) &&
                 !halfshade_solve(context, solver, scene, workspace, &receivers, &light, 1, &output);
  if (!ok) fprintf(stderr, "halfshade: %s\n", halfshade_last_error(context));

  for (int i = 0; ok && i < HEIGHT * WIDTH; ++i) {
    putchar("@#*+=-:. "[(int)(visibility[i] * 8.0f)]);
    if (i % WIDTH == WIDTH - 1) putchar('\n');
  }
  halfshade_workspace_destroy(&workspace);
  halfshade_solver_destroy(&solver);
  halfshade_scene_destroy(&scene);
  halfshade_context_destroy(&context);
  return ok ? EXIT_SUCCESS : EXIT_FAILURE;
}
