#include "shadows/workspace.h"

namespace halfshade {
namespace {

template <class T>
std::uint64_t bytes_of(const std::vector<T>& values) {
  return values.capacity() * sizeof(T);
}

std::uint64_t bytes_of(const KeptLight& kept) {
  std::uint64_t bytes =
      bytes_of(kept.samples.points) + bytes_of(kept.samples.st) + bytes_of(kept.image.rgb) + bytes_of(kept.weights);
  for (const ExactSide& side : kept.exact.sides) bytes += side.fit.bytes() + bytes_of(side.cloud.place);
  return bytes;
}

std::uint64_t bytes_of(const CallReceivers& r) {
  return bytes_of(r.position) + bytes_of(r.normal) + bytes_of(r.own) + bytes_of(r.number) + bytes_of(r.quad) +
         bytes_of(r.absent);
}

std::uint64_t bytes_of(const LitReceivers& r) {
  return bytes_of(r.array.position) + bytes_of(r.array.normal) + bytes_of(r.array.triangle) + bytes_of(r.array.sample) +
         bytes_of(r.array.set) + bytes_of(r.place) + bytes_of(r.counts) + bytes_of(r.offsets);
}

std::uint64_t bytes_of(const ExactWork& work) {
  const KernelReceivers& r = work.receivers;
  return bytes_of(work.curve.keys) + bytes_of(work.curve.scratch) + bytes_of(work.side) + bytes_of(work.order) +
         bytes_of(r.x) + bytes_of(r.y) + bytes_of(r.z) + bytes_of(r.own) + bytes_of(r.open) + bytes_of(r.set) +
         bytes_of(r.mask_at);
}

}  // namespace

bool SampleKey::operator==(const SampleKey& o) const {
  return pattern == o.pattern && count == o.count && sets == o.sets && seed == o.seed && frame == o.frame &&
         interleave == o.interleave && rotate == o.rotate && local.box_min == o.local.box_min &&
         local.half_extent == o.local.half_extent && local.scale == o.local.scale;
}

Workspace::Workspace(const WorkspaceConfig& config) {
  if (config.kept_lights < 1 || config.kept_lights > 256) {
    throw Error(ErrorCode::kUsage, "kept lights: " + std::to_string(config.kept_lights) + " is not in 1..256");
  }
  impl_ = std::make_unique<Impl>(config);
}

Workspace::~Workspace() = default;
Workspace::Workspace(Workspace&&) noexcept = default;
Workspace& Workspace::operator=(Workspace&&) noexcept = default;

void Workspace::clear() {
  impl_ = std::make_unique<Impl>(WorkspaceConfig{static_cast<std::uint32_t>(impl_->lights.size())});
}

std::uint64_t Workspace::bytes() const {
  std::uint64_t bytes =
      bytes_of(impl_->receivers) + bytes_of(impl_->lit) + bytes_of(impl_->masks.words) + bytes_of(impl_->visibility);
  bytes += bytes_of(impl_->exact);
  for (const KeptLight& kept : impl_->lights) bytes += bytes_of(kept);
  return bytes;
}

const SolveStats& Workspace::stats() const { return impl_->stats; }

}  // namespace halfshade
