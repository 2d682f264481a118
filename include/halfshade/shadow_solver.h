// Shadows in a scene that lives longer than a frame, into the caller's memory.
#pragma once

#include "halfshade/rasterizer.h"
#include "halfshade/shadow_scene.h"
#include "halfshade/shadows.h"

namespace halfshade {

/// Distance by which receivers are lifted off their surface, in half-widths of the local frame: 4 units in the last
/// place of a float coordinate of size 1.
inline constexpr double kReceiverLift = 0x1p-21;

/// The same where far lights make the scene small in its frame and this is less: times the power of two from the
/// meshes' largest coordinate on.
inline constexpr double kReceiverLiftOfScene = 0x1p-18;

/// ReceiverView::lift: as above, and as the receivers of a G-buffer.
inline constexpr double kDefaultLift = -1.0;

/// Points that ask for light, in the caller's memory.
struct ReceiverView {
  PointView positions = {};  // world space
  /// Geometric normals on the side that is asked, of any length; or empty. With normals, receivers are lifted, samples
  /// at or below a receiver's tangent plane do not light it (a receiver for which that is all of them is blocked in
  /// every sample without being traced), and irradiance can be asked for.
  PointView normals = {};
  /// Own triangle, which never blocks the receiver: number of the mesh, and of the triangle in it; kNone = none. Both
  /// empty: none has one.
  IndexView meshes = {}, triangles = {};
  /// Along the normals, in half-widths of the local frame, 0..1; or kDefaultLift. Counts for nothing without normals.
  double lift = kDefaultLift;
  /// Number of receiver 0, from which sets of light samples are chosen (ShadowConfig::sample_sets): a part of the
  /// receivers gets the same samples as in a call for all of them.
  std::uint32_t first = 0;
  /// Takes the place of ShadowConfig::frame (temporal jitter): every frame shows each receiver other samples.
  std::uint32_t frame = kNone;
};

/// Where results go: each span is empty (not wanted) or has the stated length. [light] runs over the lights of the call
/// in their order, [receiver] over the receivers.
struct ShadowOutput {
  /// [light][receiver][word], words = ShadowSolver::mask_words(lights): bit i is set where sample i of the light is
  /// hidden. Bits past a light's sample count are zero.
  std::span<std::uint64_t> masks = {};
  std::span<float> visibility = {};  // [light][receiver]: fraction of samples not hidden, in [0, 1]
  /// [light][receiver] linear RGB: what the light's visible samples send to a surface with the receiver's normal,
  ///   E = sum over visible samples of emission * area / samples * cos(receiver) * cos(light) / distance^2
  /// in world units; emission is radiance. Spheres and ellipsoids emit from their surface. Points and explicit samples
  /// have neither area nor cos(light): emission is intensity, shared by the samples. An emission image replaces
  /// `emission` sample by sample. Two-sided lights emit to both sides.
  std::span<vec3> irradiance = {};
  std::span<vec3> total_irradiance = {};  // [receiver]: sum over lights, in their order
};

/// Counters and times of one call, summed over its lights.
struct SolveStats : ShadowStats {
  std::uint64_t lights_kept = 0;  // whose samples and tree were still there from an earlier call
  std::uint64_t lights_made = 0;  // whose samples and tree were made by this call
};

/// What a workspace keeps between calls.
struct WorkspaceConfig {
  /// Lights whose samples, and about 10 bytes per triangle (100 more if alpha-tested) for each of their sides that
  /// receivers are on (of two, or six of a light without a plane), are kept from call to call, 1..256. Light number i
  /// of a call uses place i modulo this: what was there before is replaced. So of more lights than places, those that
  /// share theirs with no other light of the call are kept.
  std::uint32_t kept_lights = 1;
};

/// Scratch memory of one call at a time, and what can be kept between calls. Method `exact` allocates nothing in a call
/// that follows others with as many receivers, a scene whose meshes are the same, and lights of the same shapes
/// that all have a place here. Meshes and lights may have moved. Lists grow to the longest that was needed, so that the
/// first frames of a movement may still allocate.
/// Receivers in the plane of a light, or near to a light that has none, and other methods allocate as they need.
/// Distinct Workspaces may be used concurrently; one Workspace may not: a call that finds it in use throws
/// Error{kUsage}.
class HALFSHADE_API Workspace {
 public:
  /// Allocates little; the first call does. Throws Error{kUsage} for a configuration out of range.
  explicit Workspace(const WorkspaceConfig& config = {});
  ~Workspace();
  Workspace(Workspace&&) noexcept;
  Workspace& operator=(Workspace&&) noexcept;

  /// Gives all memory back; the next call starts from nothing.
  void clear();
  std::uint64_t bytes() const;  // memory held now
  /// Of the last call that returned or threw.
  const SolveStats& stats() const;

  struct HALFSHADE_LOCAL Impl;
  Impl& impl() { return *impl_; }  // for the library's own use

 private:
  std::unique_ptr<Impl> impl_;
};

/// Immutable after construction; const calls may run concurrently, each with a Workspace of its own.
///
/// Equal scene content, receivers, lights and configuration give equal bits for any number of threads, any executor,
/// any instruction set, any history of scene and workspace.
///
/// The floating-point environment of the calling thread, and of all threads that help, is saved, set to round to
/// nearest with denormals, and restored.
class HALFSHADE_API ShadowSolver {
 public:
  /// Throws Error{kUsage} for a configuration out of range, and for method raytrace, which is not in the library.
  /// config.progress is called if the Execution of a call has none. For method exact, back_face_casters is the scene's.
  explicit ShadowSolver(const ShadowConfig& config = {});
  const ShadowConfig& config() const { return config_; }  // as given

  /// Number of samples of a light: config().light_sample_count, 1 for points, their number for explicit samples. Throws
  /// what solve() throws when explicit samples are none or too many; so does mask_words().
  std::uint32_t sample_count(const Light& light) const;
  /// 64-bit words per receiver and light that hold the masks of any of these lights.
  std::size_t mask_words(std::span<const Light> lights) const;
  /// The same for one light.
  std::size_t mask_words(const Light& light) const { return mask_words({&light, 1}); }

  /// Throws Error{kUsage}: scene not committed, workspace in use, wrong length of a span, masks or irradiance from a
  /// method that yields no masks, irradiance without normals; Error{kBadInput}: a receiver or light that is not finite,
  /// outside scene.reach(), or degenerate, emission that is negative or not finite, an emission image of another
  /// size than it says, an own triangle that is not there, all named by number (texels of an image are looked at where
  /// irradiance is asked for);
  /// Error{kCancelled}; std::bad_alloc; what `execution` throws. Nothing is written where an argument is wrong.
  void solve(const ShadowScene& scene, const ReceiverView& receivers, std::span<const Light> lights,
             Workspace& workspace, const ShadowOutput& output, const Execution& execution = {}) const;
  /// One light.
  void solve(const ShadowScene& scene, const ReceiverView& receivers, const Light& light, Workspace& workspace,
             const ShadowOutput& output, const Execution& execution = {}) const {
    solve(scene, receivers, std::span(&light, 1), workspace, output, execution);
  }

  /// Receivers are the entries of a G-buffer that rasterize() made of the same scene, with their geometric normals;
  /// sets of samples go by their place in the whole picture. Entries that show the background get what receivers get
  /// that are blocked in every sample. Throws Error{kUsage} as well for a G-buffer of another scene or from before a
  /// commit that added, removed or moved meshes, added alpha maps or moved the frame (GBuffer::drawn); Error{kBadInput}
  /// for arrays of another size than its window, and values that cannot be this scene's in one filled by hand.
  void solve(const ShadowScene& scene, const GBuffer& gbuffer, std::span<const Light> lights, Workspace& workspace,
             const ShadowOutput& output, const Execution& execution = {}) const;

 private:
  ShadowConfig config_;
};

}  // namespace halfshade
