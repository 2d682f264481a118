// Random sequences of C calls: no call may do anything but return a documented status, and whatever changes led to a
// scene, its masks are those of a fresh scene with the same content, and of the oracle.
#include "halfshade/c_api.h"

#include <cmath>
#include <cstring>
#include <optional>

#include "fuzz/coordinates.h"

namespace halfshade::fuzz {
namespace {

constexpr std::size_t kMostCalls = 48;
constexpr std::size_t kMostMeshes = 6;

struct Mesh {
  std::vector<dvec3> positions;
  std::vector<std::uint32_t> indices;
  std::array<double, 12> transform{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
};

/// What the scene should hold, as far as calls were accepted.
struct Model {
  std::vector<std::optional<Mesh>> meshes;  // [number]; removed ones keep their place
  std::vector<dvec3> reach;                 // points it was extended to
};

halfshade_points view_of(const std::vector<dvec3>& points) {
  return {points.data(), points.size(), 0, HALFSHADE_FLOAT64};
}

class Host {
 public:
  explicit Host(Bytes input) : in_(input) {
    halfshade_context_desc desc = HALFSHADE_CONTEXT_INIT;
    desc.executor = in_.flag() ? HALFSHADE_EXECUTOR_SERIAL : HALFSHADE_EXECUTOR_ARENA;
    desc.progress_user = this;
    desc.progress = [](void* self, double done) {
      require(done >= 0.0 && done <= 1.0, "progress is 0..1");
      return static_cast<int>(static_cast<Host*>(self)->reports_left_-- != 0);
    };
    require(halfshade_context_create(&desc, &context_) == HALFSHADE_OK, "a context can be made");
    make_scene(), make_solver(), make_workspace();
    require(halfshade_gbuffer_create(context_, &gbuffer_) == HALFSHADE_OK, "a G-buffer can be made");
  }

  ~Host() {
    for (int twice = 0; twice < 2; ++twice) {
      halfshade_gbuffer_destroy(&gbuffer_);
      halfshade_workspace_destroy(&workspace_);
      halfshade_solver_destroy(&solver_);
      halfshade_scene_destroy(&scene_);
      halfshade_context_destroy(&context_);
      require(context_ == nullptr && scene_ == nullptr, "destroyed handles are NULL");
    }
  }
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  void run() {
    for (std::size_t k = 0; k < kMostCalls && !in_.empty(); ++k) call();
    reports_left_ = -1;
    if (ok(halfshade_scene_commit(context_, scene_))) compare_with_fresh_scene();
  }

 private:
  using Masks = std::vector<std::uint64_t>;

  void call() {
    reports_left_ = in_.below(8) == 0 ? static_cast<int>(in_.below(6)) : -1;
    switch (in_.below(14)) {
      case 0:
      case 1:
        return add_mesh();
      case 2:
        return change_mesh();
      case 3:
        return extend();
      case 4:
      case 5:
        ok(halfshade_scene_commit(context_, scene_));
        return;
      case 6:
      case 7:
        return solve();
      case 8:
        return draw();
      case 9:
        return make_anew();
      case 10:
        return misuse_handles();
      case 11:
        return misuse_structs();
      case 12:
        return ask();
      default:
        return add_alpha_map();
    }
  }

  /// True for HALFSHADE_OK; anything else must be a refusal with a message.
  bool ok(halfshade_status status) {
    const std::string message = halfshade_last_error(context_);
    require(status >= HALFSHADE_OK && status <= HALFSHADE_ERROR_CANCELLED,
            std::string("a status that a wrong call can have: ") + halfshade_status_name(status) + ", " + message);
    require((status == HALFSHADE_OK) == message.empty(), "a message for every failure, and for nothing else");
    return status == HALFSHADE_OK;
  }
  void refused(halfshade_status status) { require(!ok(status), "a call that makes no sense is refused"); }

  void make_scene() {
    halfshade_scene_desc desc = HALFSHADE_SCENE_INIT;
    desc.back_face_casters = in_.flag();
    desc.rebuild_cost = in_.flag() ? 1.5 : 1.0;
    model_ = {};
    require(ok(halfshade_scene_create(context_, &desc, &scene_)), "a scene can be made");
  }

  void make_solver() {
    constexpr const char* methods[] = {"exact", "exact", "afsm", "hpc", "gears", "stsv", "oracle"};
    constexpr const char* patterns[] = {"rows", "uniform", "stratified", "low-discrepancy", "poisson-disk"};
    constexpr std::uint32_t counts[] = {1, 5, 16, 64};
    solver_desc_ = HALFSHADE_SOLVER_INIT;
    solver_desc_.method = methods[in_.below(std::size(methods))];
    solver_desc_.pattern = patterns[in_.below(std::size(patterns))];
    solver_desc_.light_sample_count = counts[in_.below(std::size(counts))];
    solver_desc_.sample_sets = 1 + in_.below(3);
    require(ok(halfshade_solver_create(context_, &solver_desc_, &solver_)), "a solver can be made");
  }

  void make_workspace() {
    halfshade_workspace_desc desc = HALFSHADE_WORKSPACE_INIT;
    desc.kept_lights = 1 + in_.below(2);
    require(ok(halfshade_workspace_create(context_, &desc, &workspace_)), "a workspace can be made");
  }

  void make_anew() {
    switch (in_.below(4)) {
      case 0:
        halfshade_scene_destroy(&scene_);
        return make_scene();
      case 1:
        halfshade_solver_destroy(&solver_);
        return make_solver();
      case 2:
        halfshade_workspace_destroy(&workspace_);
        return make_workspace();
      default:
        ok(halfshade_workspace_clear(context_, workspace_));
    }
  }

  std::vector<dvec3> points(std::uint32_t most) {
    std::vector<dvec3> result;
    for (std::uint32_t n = in_.below(most + 1); n > 0; --n) result.push_back(in_.point());
    return result;
  }

  /// The mesh as a description; valid as long as the mesh.
  static halfshade_mesh_desc desc_of(const Mesh& mesh) {
    halfshade_mesh_desc desc = HALFSHADE_MESH_INIT;
    desc.positions = view_of(mesh.positions);
    desc.triangles = {mesh.indices.data(), mesh.indices.size() / 3, 0};
    for (std::size_t k = 0; k < 12; ++k) desc.transform[k / 4][k % 4] = mesh.transform[k];
    return desc;
  }

  std::array<double, 12> transform() {
    std::array<double, 12> t{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    for (std::uint32_t n = in_.below(4); n > 0; --n) {
      const std::uint32_t entry = in_.below(12);
      t[entry] = in_.coordinate();
    }
    return t;
  }

  void add_mesh() {
    if (model_.meshes.size() >= kMostMeshes) return;
    Mesh mesh;
    mesh.positions = points(10);
    const auto count = static_cast<std::uint32_t>(mesh.positions.size());
    for (std::uint32_t n = 3 * in_.below(9); n > 0 && count > 0; --n) {
      mesh.indices.push_back(in_.broken() ? in_.take<std::uint32_t>() : in_.below(count));
    }
    mesh.transform = transform();
    const halfshade_mesh_desc desc = desc_of(mesh);
    std::uint32_t number = 0;
    if (!ok(halfshade_scene_add_mesh(context_, scene_, &desc, &number))) return;
    require(number == model_.meshes.size(), "meshes are numbered in order");
    model_.meshes.emplace_back(std::move(mesh));
  }

  void change_mesh() {
    const std::uint32_t number = in_.below(kMostMeshes);
    const bool there = number < model_.meshes.size() && model_.meshes[number].has_value();
    switch (in_.below(3)) {
      case 0:
        require(ok(halfshade_scene_remove_mesh(context_, scene_, number)) == there,
                "meshes that are there are removed");
        if (there) model_.meshes[number].reset();
        return;
      case 1: {
        const auto moved = points(10);
        const halfshade_points view = view_of(moved);
        if (!ok(halfshade_scene_set_positions(context_, scene_, number, &view))) return;
        require(there && moved.size() == model_.meshes[number]->positions.size(), "positions fit the mesh");
        model_.meshes[number]->positions = moved;
        return;
      }
      default: {
        const auto t = transform();
        if (!ok(halfshade_scene_set_transform(context_, scene_, number, t.data()))) return;
        require(there, "meshes that are there are moved");
        model_.meshes[number]->transform = t;
      }
    }
  }

  void extend() {
    const auto to = points(3);
    const halfshade_points view = view_of(to);
    if (ok(halfshade_scene_extend_points(context_, scene_, &view))) {
      model_.reach.insert(model_.reach.end(), to.begin(), to.end());
    }
  }

  void add_alpha_map() {
    const std::uint8_t texels[6] = {255, 0, 0, 255, 9, 200};
    halfshade_alpha_desc desc = HALFSHADE_ALPHA_INIT;
    desc.data = in_.broken() ? nullptr : texels;
    desc.width = 2, desc.height = in_.below(3);  // 2 x 2 texels within six bytes, or none
    desc.row_bytes = in_.flag() ? 3 : 0;
    ok(halfshade_scene_add_alpha_map(context_, scene_, &desc, nullptr));
  }

  halfshade_light light() {
    halfshade_light light = HALFSHADE_LIGHT_INIT;
    const std::uint32_t shape = in_.broken() ? 8 : in_.below(8);  // 8 is none
    std::memcpy(&light.shape, &shape, sizeof shape);
    light.two_sided = in_.flag();
    light_points_ = points(5);
    light.points = view_of(light_points_);
    const auto put = [](const dvec3& p, double* to) { to[0] = p.x, to[1] = p.y, to[2] = p.z; };
    put(in_.point(), light.center);
    put(in_.point(), light.u), put(in_.point(), light.v), put(in_.point(), light.normal);
    for (int k = 0; k < 3; ++k) put(in_.point(), light.axes[k]);
    light.radius = in_.coordinate();
    if (shape == HALFSHADE_LIGHT_SUN && in_.flag()) place(light);
    return light;
  }

  void place(halfshade_light& sun) {
    const dvec3 low = in_.point(), high = in_.point();
    sun.angular_diameter_deg = in_.coordinate();
    if (!ok(halfshade_place_sun(context_, &sun, &low.x, &high.x, &sun))) return;
    require(sun.shape == HALFSHADE_LIGHT_DISK && sun.radius >= 0.0, "a placed sun is a disk");
  }

  /// Masks of `receivers`, if the call is accepted.
  bool masks_of(const halfshade_scene* scene, const halfshade_solver* solver, halfshade_workspace* workspace,
                const halfshade_receivers& receivers, const halfshade_light& light, Masks& masks) {
    std::size_t words = 0;
    if (!ok(halfshade_solver_mask_words(context_, solver, &light, 1, &words))) return false;
    require(words >= 1 && words <= 64, "lights have 1 to 4096 samples");
    masks.assign(words * receivers.positions.count, ~std::uint64_t{0});
    halfshade_output output = HALFSHADE_OUTPUT_INIT;
    output.masks = masks.data(), output.mask_count = masks.size();
    return ok(halfshade_solve(context_, solver, scene, workspace, &receivers, &light, 1, &output));
  }

  struct Question {
    std::vector<dvec3> positions, normals;
    std::vector<std::uint32_t> meshes, triangles;
    halfshade_receivers view = HALFSHADE_RECEIVERS_INIT;
    halfshade_light light = HALFSHADE_LIGHT_INIT;
  };

  void make_question(Question& q) {
    q.positions = points(6);
    if (in_.flag()) {
      for (std::size_t k = q.positions.size(); k > 0; --k) q.normals.push_back(in_.point());
    }
    if (in_.flag()) {
      for (std::size_t k = q.positions.size(); k > 0; --k) {
        const bool none = in_.flag();
        q.meshes.push_back(none ? HALFSHADE_NONE : in_.below(kMostMeshes));
        q.triangles.push_back(none ? HALFSHADE_NONE : in_.below(9));
      }
    }
    q.view.positions = view_of(q.positions), q.view.normals = view_of(q.normals);
    q.view.meshes = {q.meshes.data(), q.meshes.size(), 0};
    q.view.triangles = {q.triangles.data(), q.triangles.size(), 0};
    q.light = light();
  }

  void solve() {
    Question q;
    make_question(q);
    if (in_.flag()) ok(halfshade_scene_commit(context_, scene_));
    Masks masks, truth;
    const bool solved = masks_of(scene_, solver_, workspace_, q.view, q.light, masks);
    solve_all_outputs(q);
    if (!solved) return;
    reports_left_ = -1;
    halfshade_solver_desc desc = solver_desc_;
    desc.method = "oracle";
    halfshade_solver* oracle = nullptr;
    require(ok(halfshade_solver_create(context_, &desc, &oracle)), "an oracle can be made");
    require(masks_of(scene_, oracle, workspace_, q.view, q.light, truth), "the oracle answers as well");
    halfshade_solver_destroy(&oracle);
    require(masks == truth, std::string("method ") + solver_desc_.method + " has the oracle's bits");
  }

  /// Every output at once, sometimes of the wrong length.
  void solve_all_outputs(const Question& q) {
    const std::size_t count = q.positions.size();
    std::vector<float> visibility(count), irradiance(3 * count), total(3 * count);
    halfshade_output output = HALFSHADE_OUTPUT_INIT;
    output.visibility = visibility.data(), output.visibility_count = visibility.size();
    if (in_.flag()) {
      output.irradiance = irradiance.data(), output.irradiance_count = irradiance.size();
      output.total_irradiance = total.data(), output.total_irradiance_count = total.size();
    }
    const bool wrong = in_.broken() && count > 0;
    if (wrong) --output.visibility_count;
    const bool solved = ok(halfshade_solve(context_, solver_, scene_, workspace_, &q.view, &q.light, 1, &output));
    require(!(solved && wrong), "outputs of the wrong length are refused");
    if (!solved) return;
    for (const float v : visibility) require(v >= 0.0f && v <= 1.0f, "visibility is 0..1");
  }

  void draw() {
    halfshade_camera camera = HALFSHADE_CAMERA_INIT;
    const auto put = [](const dvec3& p, double* to) { to[0] = p.x, to[1] = p.y, to[2] = p.z; };
    put(in_.point(), camera.eye), put(in_.point(), camera.target);
    camera.width = in_.below(12), camera.height = in_.below(12);
    if (!ok(halfshade_rasterize(context_, scene_, &camera, gbuffer_))) return;
    halfshade_gbuffer_view view{};
    view.struct_size = sizeof view;
    require(ok(halfshade_gbuffer_get_view(context_, gbuffer_, &view)), "what was drawn can be seen");
    require(view.width == camera.width && view.height == camera.height, "the picture has the size asked for");
    for (std::size_t i = 0; i < std::size_t{view.width} * view.height; ++i) {
      std::uint32_t mesh = 0, triangle = 0;
      if (view.triangle[i] == HALFSHADE_NONE) continue;
      require(ok(halfshade_scene_triangle_of(context_, scene_, view.triangle[i], &mesh, &triangle)),
              "triangles are known");
      require(mesh < model_.meshes.size() && model_.meshes[mesh].has_value(), "what is seen is there");
      require(std::isfinite(view.depth[i]) && std::isfinite(view.position[3 * i]), "what is seen is somewhere");
    }
    const halfshade_light lit = light();
    std::vector<float> visibility(std::size_t{view.width} * view.height);
    halfshade_output output = HALFSHADE_OUTPUT_INIT;
    output.visibility = visibility.data(), output.visibility_count = visibility.size();
    ok(halfshade_solve_gbuffer(context_, solver_, scene_, workspace_, gbuffer_, &lit, 1, &output));
  }

  void misuse_handles() {
    const halfshade_receivers none = HALFSHADE_RECEIVERS_INIT;
    const halfshade_light lit = HALFSHADE_LIGHT_INIT;
    const halfshade_output output = HALFSHADE_OUTPUT_INIT;
    refused(halfshade_scene_commit(context_, nullptr));
    refused(halfshade_scene_commit(context_, reinterpret_cast<halfshade_scene*>(solver_)));
    refused(halfshade_workspace_clear(context_, reinterpret_cast<halfshade_workspace*>(scene_)));
    refused(halfshade_solve(context_, nullptr, scene_, workspace_, &none, &lit, 1, &output));
    refused(halfshade_solve(context_, solver_, nullptr, workspace_, &none, &lit, 1, &output));
    refused(halfshade_solve(context_, solver_, scene_, nullptr, &none, &lit, 1, &output));
    refused(halfshade_solve(context_, solver_, scene_, workspace_, nullptr, &lit, 1, &output));
    refused(halfshade_solve(context_, solver_, scene_, workspace_, &none, nullptr, 1, &output));
    refused(halfshade_solve(context_, solver_, scene_, workspace_, &none, &lit, 1, nullptr));
    refused(halfshade_scene_add_mesh(context_, scene_, nullptr, nullptr));
    refused(halfshade_scene_set_transform(context_, scene_, 0, nullptr));
    require(halfshade_scene_commit(nullptr, scene_) == HALFSHADE_ERROR_USAGE, "a NULL context is refused");
    require(halfshade_scene_commit(reinterpret_cast<halfshade_context*>(scene_), scene_) == HALFSHADE_ERROR_USAGE,
            "a scene is no context");
  }

  void misuse_structs() {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    halfshade_mesh_desc desc = desc_of(mesh);
    desc.struct_size = in_.below(8);
    refused(halfshade_scene_add_mesh(context_, scene_, &desc, nullptr));
    halfshade_light lit = HALFSHADE_LIGHT_INIT;
    lit.struct_size = in_.below(8);
    std::uint32_t samples = 0;
    refused(halfshade_solver_sample_count(context_, solver_, &lit, &samples));
    halfshade_solver_desc solver = HALFSHADE_SOLVER_INIT;
    solver.method = "none";
    halfshade_solver* made = nullptr;
    refused(halfshade_solver_create(context_, &solver, &made));
    require(made == nullptr, "what was refused wrote nothing");
  }

  void ask() {
    double low[3] = {}, high[3] = {};
    if (ok(halfshade_scene_reach(context_, scene_, low, high))) {
      for (int k = 0; k < 3; ++k) require(low[k] <= high[k], "reach is a box");
    }
    halfshade_scene_stats stats{};
    stats.struct_size = sizeof stats;
    require(ok(halfshade_scene_get_stats(context_, scene_, &stats)), "statistics can always be asked for");
    halfshade_solve_stats solve_stats{};
    solve_stats.struct_size = sizeof solve_stats;
    require(ok(halfshade_workspace_get_stats(context_, workspace_, &solve_stats)),
            "statistics can always be asked for");
    std::uint32_t mesh = 0, triangle = 0;
    ok(halfshade_scene_triangle_of(context_, scene_, in_.take<std::uint32_t>(), &mesh, &triangle));
  }

  /// Equal content gives equal bits, whatever changes led to it.
  void compare_with_fresh_scene() {
    Question q;
    make_question(q);
    halfshade_scene* fresh = nullptr;
    require(ok(halfshade_scene_create(context_, nullptr, &fresh)), "a scene can be made");
    std::vector<std::uint32_t> number_in_fresh(kMostMeshes, HALFSHADE_NONE);
    for (std::size_t i = 0; i < model_.meshes.size(); ++i) {
      if (!model_.meshes[i].has_value()) continue;
      const halfshade_mesh_desc desc = desc_of(*model_.meshes[i]);
      require(ok(halfshade_scene_add_mesh(context_, fresh, &desc, &number_in_fresh[i])),
              "accepted once, accepted again");
    }
    const halfshade_points reach = view_of(model_.reach);
    require(ok(halfshade_scene_extend_points(context_, fresh, &reach)), "accepted once, accepted again");
    require(ok(halfshade_scene_commit(context_, fresh)), "committed once, committed again");
    Masks old_masks, fresh_masks;
    const bool solved = masks_of(scene_, solver_, workspace_, q.view, q.light, old_masks);
    for (std::uint32_t& mesh : q.meshes) mesh = mesh < kMostMeshes ? number_in_fresh[mesh] : mesh;
    bool comparable = true;  // a removed mesh has no number in the fresh scene; half a pair is another question
    for (std::size_t i = 0; i < q.meshes.size(); ++i) {
      comparable = comparable && (q.meshes[i] == HALFSHADE_NONE) == (q.triangles[i] == HALFSHADE_NONE);
    }
    if (comparable) {
      require(masks_of(fresh, solver_, workspace_, q.view, q.light, fresh_masks) == solved,
              "both scenes answer or none");
      require(!solved || old_masks == fresh_masks, "equal content gives equal bits");
    }
    halfshade_scene_destroy(&fresh);
  }

  CoordinateReader in_;
  Model model_;
  int reports_left_ = -1;  // until a call is stopped; negative: never
  halfshade_context* context_ = nullptr;
  halfshade_scene* scene_ = nullptr;
  halfshade_solver* solver_ = nullptr;
  halfshade_solver_desc solver_desc_ = HALFSHADE_SOLVER_INIT;
  halfshade_workspace* workspace_ = nullptr;
  halfshade_gbuffer* gbuffer_ = nullptr;
  std::vector<dvec3> light_points_;
};

}  // namespace

void fuzz_c_api(Bytes input) { Host(input).run(); }

}  // namespace halfshade::fuzz
