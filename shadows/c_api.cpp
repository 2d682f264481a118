// The C interface: every function is one call of the C++ interface inside guarded(), the only place where exceptions
// become status codes.
#include "halfshade/c_api.h"

#include <atomic>
#include <cstdio>
#include <new>
#include <optional>

#include "shadows/c_convert.h"
#include "shadows/view_access.h"

using namespace halfshade;

// Handles begin with a number that says of which kind they are.
struct halfshade_context {
  static constexpr std::uint32_t kKind = 0x68736378;
  static constexpr const char* kName = "context";
  std::uint32_t kind = kKind;
  std::atomic<bool> busy = false;
  Execution execution;
  char message[1024] = "";
};

struct halfshade_scene {
  static constexpr std::uint32_t kKind = 0x68737363;
  static constexpr const char* kName = "scene";
  std::uint32_t kind = kKind;
  ShadowScene value;
};

struct halfshade_solver {
  static constexpr std::uint32_t kKind = 0x6873736f;
  static constexpr const char* kName = "solver";
  std::uint32_t kind = kKind;
  ShadowSolver value;
};

struct halfshade_workspace {
  static constexpr std::uint32_t kKind = 0x68737773;
  static constexpr const char* kName = "workspace";
  std::uint32_t kind = kKind;
  Workspace value;
  std::vector<Light> lights = {};  // of the call that runs, kept for their memory
};

struct halfshade_gbuffer {
  static constexpr std::uint32_t kKind = 0x68736762;
  static constexpr const char* kName = "gbuffer";
  std::uint32_t kind = kKind;
  GBuffer value = {};
};

namespace {

template <class Handle>
bool is_valid(const Handle* handle) {
  return handle != nullptr && handle->kind == Handle::kKind;
}

/// The handle's object. Throws Error{kUsage} for NULL and handles of another kind.
template <class Handle>
Handle& checked(Handle* handle) {
  const char* name = std::remove_const_t<Handle>::kName;
  if (handle == nullptr) throw Error(ErrorCode::kUsage, std::string(name) + " is NULL");
  if (!is_valid(handle)) throw Error(ErrorCode::kUsage, std::string(name) + " is not a " + name);
  return *handle;
}

template <class Value>
Value& checked_out(Value* out, const char* name) {
  if (out == nullptr) throw Error(ErrorCode::kUsage, std::string(name) + " is NULL");
  return *out;
}

template <class Handle>
void destroy(Handle** handle) {
  if (handle == nullptr || !is_valid(*handle)) return;
  (*handle)->kind = 0;
  delete *handle;
  *handle = nullptr;
}

halfshade_status status_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUsage:
      return HALFSHADE_ERROR_USAGE;
    case ErrorCode::kBadInput:
      return HALFSHADE_ERROR_BAD_INPUT;
    case ErrorCode::kLimit:
      return HALFSHADE_ERROR_LIMIT;
    case ErrorCode::kOutput:
      return HALFSHADE_ERROR_OUTPUT;
    case ErrorCode::kCancelled:
      return HALFSHADE_ERROR_CANCELLED;
  }
  return HALFSHADE_ERROR_INTERNAL;
}

/// body(), its exceptions as a status and as text in `message`. Text that is too long is cut: a message that had to be
/// allocated could not say that memory is out.
template <class Body, std::size_t n>
halfshade_status caught(const Body& body, char (&message)[n]) noexcept {
  const auto failed = [&](halfshade_status status, const char* text) {
    std::snprintf(message, n, "%s", text);
    return status;
  };
  try {
    message[0] = '\0';
    body();
    return HALFSHADE_OK;
  } catch (const Error& e) {
    return failed(status_of(e.code()), e.what());
  } catch (const std::bad_alloc&) {
    return failed(HALFSHADE_ERROR_OUT_OF_MEMORY, "out of memory");
  } catch (const std::exception& e) {
    return failed(HALFSHADE_ERROR_INTERNAL, e.what());
  } catch (...) {
    return failed(HALFSHADE_ERROR_INTERNAL, "unknown exception");
  }
}

/// caught() for a context, which serves one call at a time.
template <class Body>
halfshade_status guarded(halfshade_context* context, const Body& body) noexcept {
  if (!is_valid(context) || context->busy.exchange(true)) return HALFSHADE_ERROR_USAGE;
  const halfshade_status status = caught(body, context->message);
  context->busy.store(false);
  return status;
}

Execution to_execution(const halfshade_context_desc* given) {
  Execution execution;
  if (given == nullptr) return execution;
  const halfshade_context_desc desc = read_struct(given, "context");
  switch (number_of(desc.executor)) {
    case HALFSHADE_EXECUTOR_ARENA:
      execution.executor = Executor::kArena;
      break;
    case HALFSHADE_EXECUTOR_SERIAL:
      execution.executor = Executor::kSerial;
      break;
    case HALFSHADE_EXECUTOR_HOST:
      execution.executor = Executor::kHost;
      if (desc.parallel_for == nullptr) throw Error(ErrorCode::kUsage, "context.parallel_for is NULL");
      break;
    default:
      throw Error(ErrorCode::kUsage, "context.executor is not one of 0, 1, 2");
  }
  execution.concurrency = desc.concurrency;
  if (desc.parallel_for != nullptr) {
    execution.parallel_for = [run = desc.parallel_for, user = desc.parallel_for_user](std::size_t count,
                                                                                      TaskBody body) {
      const auto call = [](const void* context, std::size_t index) { (*static_cast<const TaskBody*>(context))(index); };
      run(user, count, call, &body);
    };
  }
  if (desc.progress != nullptr) {
    execution.progress = [ask = desc.progress, user = desc.progress_user](double done) { return ask(user, done) != 0; };
  }
  return execution;
}

bool is_empty(const ReceiverView& receivers) { return receivers.positions.count == 0; }
bool is_empty(const GBuffer& gbuffer) { return gbuffer.width == 0 || gbuffer.height == 0; }

template <class Receivers>
void solve(halfshade_context* context, const halfshade_solver* solver, const halfshade_scene* scene,
           halfshade_workspace* workspace, const Receivers& receivers, const halfshade_light* lights,
           std::size_t light_count, const halfshade_output* output) {
  halfshade_workspace& work = checked(workspace);
  to_lights(lights, light_count, work.lights);
  checked(solver).value.solve(checked(scene).value, receivers, work.lights, work.value,
                              to_output(output, !is_empty(receivers) && light_count != 0), context->execution);
}

}  // namespace

uint32_t halfshade_version(void) { return HALFSHADE_VERSION; }

const char* halfshade_status_name(halfshade_status status) {
  switch (status) {
    case HALFSHADE_OK:
      return "ok";
    case HALFSHADE_ERROR_USAGE:
      return "usage";
    case HALFSHADE_ERROR_BAD_INPUT:
      return "bad input";
    case HALFSHADE_ERROR_LIMIT:
      return "limit";
    case HALFSHADE_ERROR_OUTPUT:
      return "output";
    case HALFSHADE_ERROR_CANCELLED:
      return "cancelled";
    case HALFSHADE_ERROR_OUT_OF_MEMORY:
      return "out of memory";
    case HALFSHADE_ERROR_INTERNAL:
      return "internal";
  }
  return "unknown";
}

halfshade_status halfshade_context_create(const halfshade_context_desc* desc, halfshade_context** context) {
  if (context == nullptr) return HALFSHADE_ERROR_USAGE;
  char message[64];  // nobody can ask for it: there is no context yet
  return caught([&] { *context = new halfshade_context{.execution = to_execution(desc)}; }, message);
}
void halfshade_context_destroy(halfshade_context** context) { destroy(context); }

const char* halfshade_last_error(const halfshade_context* context) {
  return is_valid(context) ? context->message : "context is NULL or not a context";
}

halfshade_status halfshade_place_sun(halfshade_context* context, const halfshade_light* sun, const double* low,
                                     const double* high, halfshade_light* placed) {
  return guarded(context, [&] {
    Light light;
    to_light(sun, "sun", light);
    checked_out(low, "low");
    checked_out(high, "high");
    light = place_sun(light, {low[0], low[1], low[2]}, {high[0], high[1], high[2]});
    halfshade_light result = read_struct(sun, "sun");
    result.shape = static_cast<halfshade_light_shape>(light.shape);
    result.radius = light.radius;
    for (int axis = 0; axis < 3; ++axis) {
      result.center[axis] = light.center[axis];
      result.normal[axis] = light.normal[axis];
    }
    write_struct(placed, result, "placed");
  });
}

halfshade_status halfshade_scene_create(halfshade_context* context, const halfshade_scene_desc* desc,
                                        halfshade_scene** scene) {
  return guarded(context, [&] {
    halfshade_scene*& out = checked_out(scene, "scene");
    SceneConfig config;
    if (desc != nullptr) {
      const halfshade_scene_desc known = read_struct(desc, "scene");
      config = {.rebuild_cost = known.rebuild_cost, .back_face_casters = known.back_face_casters != 0};
    }
    out = new halfshade_scene{.value = ShadowScene(config)};
  });
}
void halfshade_scene_destroy(halfshade_scene** scene) { destroy(scene); }

halfshade_status halfshade_scene_add_alpha_map(halfshade_context* context, halfshade_scene* scene,
                                               const halfshade_alpha_desc* desc, uint32_t* number) {
  return guarded(context, [&] {
    const std::uint32_t added = checked(scene).value.add_alpha_map(to_view(desc));
    if (number != nullptr) *number = added;
  });
}

halfshade_status halfshade_scene_add_mesh(halfshade_context* context, halfshade_scene* scene,
                                          const halfshade_mesh_desc* desc, uint32_t* number) {
  return guarded(context, [&] {
    const std::uint32_t added = checked(scene).value.add_mesh(to_view(desc));
    if (number != nullptr) *number = added;
  });
}

halfshade_status halfshade_scene_remove_mesh(halfshade_context* context, halfshade_scene* scene, uint32_t mesh) {
  return guarded(context, [&] { checked(scene).value.remove_mesh(mesh); });
}

halfshade_status halfshade_scene_set_positions(halfshade_context* context, halfshade_scene* scene, uint32_t mesh,
                                               const halfshade_points* positions) {
  return guarded(context, [&] {
    checked(scene).value.set_positions(mesh, to_view(checked_out(positions, "positions"), "positions"));
  });
}

halfshade_status halfshade_scene_set_transform(halfshade_context* context, halfshade_scene* scene, uint32_t mesh,
                                               const double* transform) {
  return guarded(context, [&] { checked(scene).value.set_transform(mesh, to_transform(transform)); });
}

halfshade_status halfshade_scene_extend_points(halfshade_context* context, halfshade_scene* scene,
                                               const halfshade_points* points) {
  return guarded(context, [&] { checked(scene).value.extend(to_view(checked_out(points, "points"), "points")); });
}

halfshade_status halfshade_scene_extend_light(halfshade_context* context, halfshade_scene* scene,
                                              const halfshade_light* light) {
  return guarded(context, [&] {
    Light known;
    to_light(light, "light", known);
    checked(scene).value.extend(known);
  });
}

halfshade_status halfshade_scene_commit(halfshade_context* context, halfshade_scene* scene) {
  return guarded(context, [&] { checked(scene).value.commit(context->execution); });
}

halfshade_status halfshade_scene_reach(halfshade_context* context, const halfshade_scene* scene, double* low,
                                       double* high) {
  return guarded(context, [&] {
    checked_out(low, "low");
    checked_out(high, "high");
    const std::array<dvec3, 2> box = checked(scene).value.reach();
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = box[0][axis];
      high[axis] = box[1][axis];
    }
  });
}

halfshade_status halfshade_scene_to_world(halfshade_context* context, const halfshade_scene* scene,
                                          const halfshade_points* local, double* world) {
  return guarded(context, [&] {
    const ShadowScene& from = checked(scene).value;
    const PointView points = to_view(checked_out(local, "local"), "local");
    if (points.count != 0) checked_out(world, "world");
    for (std::size_t i = 0; i < points.count; ++i) {
      const dvec3 p = from.to_world(element(points, i));
      for (std::size_t axis = 0; axis < 3; ++axis) world[3 * i + axis] = p[static_cast<int>(axis)];
    }
  });
}

halfshade_status halfshade_scene_get_stats(halfshade_context* context, const halfshade_scene* scene,
                                           halfshade_scene_stats* stats) {
  return guarded(context, [&] {
    const SceneStats& s = checked(scene).value.stats();
    write_struct(stats,
                 {.struct_size = sizeof(halfshade_scene_stats),
                  .commits = s.commits,
                  .frame_changes = s.frame_changes,
                  .meshes_rounded = s.meshes_rounded,
                  .certificates_made = s.certificates_made,
                  .tree_builds = s.tree_builds,
                  .tree_cost = s.tree_cost,
                  .commit_ms = s.commit_ms,
                  .tree_ms = s.tree_ms,
                  .meshes = s.meshes,
                  .triangles = s.triangles,
                  .vertices = s.vertices,
                  .certified_triangles = s.certified_triangles,
                  .bytes = s.bytes},
                 "stats");
  });
}

halfshade_status halfshade_solver_create(halfshade_context* context, const halfshade_solver_desc* desc,
                                         halfshade_solver** solver) {
  return guarded(context, [&] {
    halfshade_solver*& out = checked_out(solver, "solver");
    out = new halfshade_solver{.value = ShadowSolver(desc == nullptr ? ShadowConfig() : to_config(desc))};
  });
}
void halfshade_solver_destroy(halfshade_solver** solver) { destroy(solver); }

halfshade_status halfshade_solver_sample_count(halfshade_context* context, const halfshade_solver* solver,
                                               const halfshade_light* light, uint32_t* samples) {
  return guarded(context, [&] {
    Light known;
    to_light(light, "light", known);
    checked_out(samples, "samples") = checked(solver).value.sample_count(known);
  });
}

halfshade_status halfshade_solver_mask_words(halfshade_context* context, const halfshade_solver* solver,
                                             const halfshade_light* lights, size_t light_count, size_t* words) {
  return guarded(context, [&] {
    std::vector<Light> known;
    to_lights(lights, light_count, known);
    checked_out(words, "words") = checked(solver).value.mask_words(known);
  });
}

halfshade_status halfshade_workspace_create(halfshade_context* context, const halfshade_workspace_desc* desc,
                                            halfshade_workspace** workspace) {
  return guarded(context, [&] {
    halfshade_workspace*& out = checked_out(workspace, "workspace");
    WorkspaceConfig config;
    if (desc != nullptr) config.kept_lights = read_struct(desc, "workspace").kept_lights;
    out = new halfshade_workspace{.value = Workspace(config)};
  });
}
void halfshade_workspace_destroy(halfshade_workspace** workspace) { destroy(workspace); }

halfshade_status halfshade_workspace_clear(halfshade_context* context, halfshade_workspace* workspace) {
  return guarded(context, [&] { checked(workspace).value.clear(); });
}

halfshade_status halfshade_workspace_get_stats(halfshade_context* context, const halfshade_workspace* workspace,
                                               halfshade_solve_stats* stats) {
  return guarded(context, [&] {
    const SolveStats& s = checked(workspace).value.stats();
    write_struct(stats,
                 {.struct_size = sizeof(halfshade_solve_stats),
                  .build_ms = s.build_ms,
                  .index_ms = s.index_ms,
                  .cull_ms = s.cull_ms,
                  .test_ms = s.test_ms,
                  .receivers = s.receivers,
                  .triangles = s.triangles,
                  .pairs_tested = s.pairs_tested,
                  .sample_tests = s.sample_tests,
                  .exact_fallbacks = s.exact_fallbacks,
                  .bytes = s.bytes,
                  .lights_kept = s.lights_kept,
                  .lights_made = s.lights_made},
                 "stats");
  });
}

halfshade_status halfshade_solve(halfshade_context* context, const halfshade_solver* solver,
                                 const halfshade_scene* scene, halfshade_workspace* workspace,
                                 const halfshade_receivers* receivers, const halfshade_light* lights,
                                 size_t light_count, const halfshade_output* output) {
  return guarded(context,
                 [&] { solve(context, solver, scene, workspace, to_view(receivers), lights, light_count, output); });
}

halfshade_status halfshade_gbuffer_create(halfshade_context* context, halfshade_gbuffer** gbuffer) {
  return guarded(context, [&] { checked_out(gbuffer, "gbuffer") = new halfshade_gbuffer; });
}
void halfshade_gbuffer_destroy(halfshade_gbuffer** gbuffer) { destroy(gbuffer); }

halfshade_status halfshade_rasterize(halfshade_context* context, const halfshade_scene* scene,
                                     const halfshade_camera* camera, halfshade_gbuffer* gbuffer) {
  return guarded(context, [&] {
    const halfshade_camera known = read_struct(camera, "camera");
    const auto point = [](const double(&xyz)[3]) { return dvec3(xyz[0], xyz[1], xyz[2]); };
    rasterize(
        checked(scene).value,
        {.eye = point(known.eye), .target = point(known.target), .up = point(known.up), .fov_y_deg = known.fov_y_deg},
        {.width = known.width, .height = known.height, .window = {}, .subpixel_offset = {}}, checked(gbuffer).value,
        context->execution);
  });
}

halfshade_status halfshade_gbuffer_get_view(halfshade_context* context, const halfshade_gbuffer* gbuffer,
                                            halfshade_gbuffer_view* view) {
  return guarded(context, [&] {
    const GBuffer& g = checked(gbuffer).value;
    if (g.size() == 0) throw Error(ErrorCode::kUsage, "gbuffer is empty: nothing was rasterized into it");
    write_struct(view,
                 {.struct_size = sizeof(halfshade_gbuffer_view),
                  .width = g.width,
                  .height = g.height,
                  .triangle = g.triangle.data(),
                  .position = &g.position[0].x,
                  .geometric_normal = &g.geometric_normal[0].x,
                  .albedo = &g.albedo[0].x,
                  .depth = g.depth.data(),
                  .shading_normal = &g.shading_normal[0].x},
                 "view");
  });
}

halfshade_status halfshade_scene_triangle_of(halfshade_context* context, const halfshade_scene* scene, uint32_t number,
                                             uint32_t* mesh, uint32_t* triangle) {
  return guarded(context, [&] {
    const MeshTriangle found = checked(scene).value.triangle_of(number);
    checked_out(mesh, "mesh");
    checked_out(triangle, "triangle") = found.triangle;
    *mesh = found.mesh;
  });
}

halfshade_status halfshade_solve_gbuffer(halfshade_context* context, const halfshade_solver* solver,
                                         const halfshade_scene* scene, halfshade_workspace* workspace,
                                         const halfshade_gbuffer* gbuffer, const halfshade_light* lights,
                                         size_t light_count, const halfshade_output* output) {
  return guarded(
      context, [&] { solve(context, solver, scene, workspace, checked(gbuffer).value, lights, light_count, output); });
}
