#include "shadows/blocker_stream.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <numeric>

#include "rasterizer/core/parallel.h"
#include "shadows/hierarchical_penumbra_casting.h"
#include "shadows/receiver_request.h"
#include "shadows/solver.h"

namespace halfshade {
namespace {

constexpr int kExponentOffset = 2200;  // exponents of doubles reach from -1073 to 1024; sizes are their squares

struct OpaqueRecord {
  std::array<vec3, 3> corners;
  std::uint32_t number;
};
struct AlphaRecord {
  OpaqueRecord blocker;
  std::uint32_t material;
  std::array<vec2, 3> uvs;
};
static_assert(sizeof(OpaqueRecord) == 40 && sizeof(AlphaRecord) == 68, "records are written as they are");

[[noreturn]] void fail(const std::filesystem::path& directory, const char* what) {
  throw Error(ErrorCode::kOutput,
              "bucket file in " + directory.string() + ": cannot " + what + ": " + std::strerror(errno));
}

void put(std::FILE* file, const void* record, std::size_t size, const std::filesystem::path& directory) {
  if (std::fwrite(record, size, 1, file) != 1) fail(directory, "write");
}

/// Up to `most` records; fewer at the end of the file.
template <class Record>
void get(std::FILE* file, std::size_t most, const std::filesystem::path& directory, std::vector<Record>& records) {
  records.resize(most);
  records.resize(std::fread(records.data(), sizeof(Record), most, file));
  if (records.size() < most && std::ferror(file) != 0) fail(directory, "read");
}

void add_blocker(const OpaqueRecord& record, LatticeMesh& mesh, std::vector<std::uint32_t>& numbers) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), record.corners.begin(), record.corners.end());
  mesh.triangles.push_back({first, first + 1, first + 2});
  numbers.push_back(record.number);
}

double world_size(const Scene& piece, const std::array<std::uint32_t, 3>& t) {
  const dvec3 a = piece.positions[t[0]];
  const dvec3 n = glm::cross(piece.positions[t[1]] - a, piece.positions[t[2]] - a);
  return glm::dot(n, n);
}

void scan_piece(const Scene& piece, StreamScan& scan) {
  if (scan.triangles == 0 && !piece.positions.empty()) scan.low = scan.high = piece.positions[0];
  for (const dvec3& p : piece.positions) {
    if (!is_finite(p)) throw Error(ErrorCode::kBadInput, "a position is not finite");
    scan.low = glm::min(scan.low, p), scan.high = glm::max(scan.high, p);
  }
  for (std::size_t t = 0; t < piece.triangles.size(); ++t) {
    const double size = world_size(piece, piece.triangles[t]);
    int exponent = 0;
    if (size > 0.0 && std::isfinite(size)) std::frexp(size, &exponent);
    ++scan.areas[static_cast<std::size_t>(exponent + kExponentOffset)];
    scan.translucent += piece.materials[piece.triangle_materials[t]].translucent();
  }
  scan.triangles += piece.triangles.size();
  scan.largest_piece = std::max<std::uint64_t>(scan.largest_piece, piece.triangles.size());
}

ReceiverArray part_of(const ReceiverArray& all, std::size_t first, std::size_t end) {
  ReceiverArray part;
  for (std::size_t i = first; i < end; ++i) {
    part.push_back(all.position[i], all.normal[i], all.triangle[i], all.sample[i], all.set[i]);
  }
  return part;
}

}  // namespace

LocalFrame StreamScan::frame(std::span<const dvec3> extra) const {
  return make_local_frame(std::array{low, high}, extra);
}

AreaBuckets StreamScan::buckets(const LocalFrame& frame, std::uint32_t buckets) const {
  AreaBuckets result;
  int scale = 0;
  std::frexp(frame.scale, &scale);
  for (std::size_t i = 0; i < areas.size(); ++i) {
    // A size is a length to the fourth power; the frame's scale is a power of two.
    if (areas[i] != 0) result.add(static_cast<int>(i) - kExponentOffset + 4 * (scale - 1), areas[i]);
  }
  result.finish(std::max(1u, buckets));
  return result;
}

StreamScan scan_stream(SceneStream& stream) {
  StreamScan scan;
  scan.areas.assign(2 * kExponentOffset, 0);
  for (stream.rewind(); stream.next(stream.piece);) scan_piece(stream.piece, scan);
  if (scan.triangles == 0) throw Error(ErrorCode::kBadInput, "the scene has no triangles");
  if (scan.triangles >= kNone) throw Error(ErrorCode::kLimit, "more than 2^32 - 2 triangles");
  return scan;
}

BlockerFiles::BlockerFiles(const std::filesystem::path& directory, const AreaBuckets& areas, std::uint32_t buckets)
    : directory_(directory.empty() ? std::filesystem::temp_directory_path() : directory),
      areas_(areas),
      buckets_(std::max(1u, buckets)),
      files_(2 * std::size_t{buckets_}) {
  file(0);
}

std::FILE* BlockerFiles::file(std::size_t index) {
  if (files_[index]) return files_[index].get();
  std::string name = (directory_ / "halfshade-blockers-XXXXXX").string();
  const int descriptor = ::mkostemp(name.data(), O_CLOEXEC);
  if (descriptor < 0) fail(directory_, "create");
  ::unlink(name.c_str());
  std::FILE* stream = ::fdopen(descriptor, "w+b");
  if (stream == nullptr) {
    ::close(descriptor);
    fail(directory_, "open");
  }
  files_[index].reset(stream);
  return stream;
}

void BlockerFiles::add(const LatticeMesh& piece, std::uint32_t first) {
  for (std::uint32_t t = 0; t < piece.triangles.size(); ++t) {
    if (piece.translucent(t)) continue;
    const OpaqueRecord opaque{piece.corners(t), first + t};
    const std::uint32_t bucket = areas_.bucket_of(opaque.corners);
    ++blockers_;
    if (piece.alpha_map(t) == kNone) {
      put(file(bucket), &opaque, sizeof opaque, directory_);
      bytes_ += sizeof opaque;
    } else {
      const AlphaRecord alpha{opaque, piece.scene->triangle_materials[t], piece.scene->triangle_uvs[t]};
      put(file(buckets_ + bucket), &alpha, sizeof alpha, directory_);
      bytes_ += sizeof alpha;
    }
  }
}

void BlockerFiles::read(
    Scene& scene, const std::function<void(const LatticeMesh& mesh, std::span<const std::uint32_t> numbers)>& take) {
  std::vector<OpaqueRecord> opaque;
  std::vector<AlphaRecord> alpha;
  std::vector<std::uint32_t> numbers;
  LatticeMesh mesh;
  for (std::size_t f = 0; f < files_.size(); ++f) {
    if (!files_[f]) continue;
    std::FILE* file = files_[f].get();
    if (std::fflush(file) != 0 || std::fseek(file, 0, SEEK_SET) != 0) fail(directory_, "write");
    for (;;) {
      mesh.positions.clear(), mesh.triangles.clear(), numbers.clear();
      scene.triangle_materials.clear(), scene.triangle_uvs.clear();
      if (f < buckets_) {
        get(file, kPerPiece, directory_, opaque);
        for (const OpaqueRecord& record : opaque) add_blocker(record, mesh, numbers);
      } else {
        get(file, kPerPiece, directory_, alpha);
        for (const AlphaRecord& record : alpha) {
          add_blocker(record.blocker, mesh, numbers);
          scene.triangle_materials.push_back(record.material);
          scene.triangle_uvs.push_back(record.uvs);
        }
      }
      mesh.scene = f < buckets_ ? nullptr : &scene;
      if (numbers.empty()) break;
      take(mesh, numbers);
    }
  }
}

double most_bytes_per_receiver(std::uint32_t samples) {
  const double mask = 8.0 * std::ceil(samples / 64.0);
  // Receiver arrays 33 and their copy in the hierarchy's order 37, order and sources 16, mask pointers 8, nodes 40 for
  // at least every fourth receiver (leaves of one point would need more), and as much again while a part is rebuilt.
  return 2.0 * mask + 33.0 + 37.0 + 16.0 + 8.0 + 20.0 + 30.0;
}

std::size_t parts_for(std::size_t receivers, std::uint32_t samples, std::uint64_t max_bytes) {
  if (max_bytes == 0) return 1;
  const double bytes = static_cast<double>(receivers) * most_bytes_per_receiver(samples);
  const double parts = std::ceil(bytes / static_cast<double>(max_bytes));
  return static_cast<std::size_t>(std::clamp(parts, 1.0, static_cast<double>(std::max<std::size_t>(1, receivers))));
}

void cast_from_files(BlockerFiles& files, Scene& scene, const ReceiverArray& receivers, const Light& light,
                     const LightSamples& samples, const ShadowConfig& config, std::size_t parts,
                     const std::function<void(std::size_t first, const VisibilityMasks& masks)>& take,
                     ShadowStats& stats) {
  std::vector<std::uint32_t> order(BlockerFiles::kPerPiece);
  std::iota(order.begin(), order.end(), 0u);
  const double total = static_cast<double>(files.blockers()) * static_cast<double>(parts);
  std::uint64_t before = 0;
  stats.receivers = receivers.size();
  stats.triangles = files.blockers();
  for (std::size_t p = 0; p < parts; ++p) {
    const std::size_t first = receivers.size() * p / parts, end = receivers.size() * (p + 1) / parts;
    const ReceiverArray part = part_of(receivers, first, end);
    VisibilityMasks masks;
    masks.reset(part.size(), samples.count);
    {
      PenumbraCaster caster(part, light, samples, config);
      files.read(scene, [&](const LatticeMesh& mesh, std::span<const std::uint32_t> numbers) {
        caster.cast(mesh, std::span(order).first(numbers.size()), numbers, [&](std::size_t done) {
          report_progress(config, static_cast<double>(before + done) / std::max(1.0, total));
        });
        before += numbers.size();
      });
      caster.write_masks(masks);
      stats.details.clear();
      caster.write_stats(stats);
    }
    take(first, masks);
  }
  stats.details.emplace_back("hpc.receiver_parts", static_cast<double>(parts));
  stats.details.emplace_back("hpc.bucket_file_bytes", static_cast<double>(files.bytes()));
}

void solve_shadows(SceneStream& stream, std::span<const Receiver> receivers, const Light& light,
                   const ShadowConfig& config, const StreamOptions& options, VisibilityMasks& masks,
                   ShadowStats* stats) {
  const FpEnvironment environment;
  check_penumbra_casting(config.hpc);
  const StreamScan scan = scan_stream(stream);
  const ReceiverRequest request =
      make_receiver_request(scan.frame(receiver_reach(receivers, light)), receivers, light, config);
  BlockerFiles files(options.directory, scan.buckets(request.frame, config.hpc.area_buckets), config.hpc.area_buckets);
  std::uint32_t first = 0;
  for (stream.rewind(); stream.next(stream.piece); first += static_cast<std::uint32_t>(stream.piece.triangles.size())) {
    files.add(make_lattice_mesh(stream.piece, request.frame), first);
  }
  VisibilityMasks solved;
  solved.reset(request.receivers.size(), request.samples.count);
  ShadowStats own;
  ShadowStats& counted = stats != nullptr ? *stats : own;
  counted = {};
  cast_from_files(
      files, stream.piece, request.receivers, light, request.samples, config,
      parts_for(request.receivers.size(), request.samples.count, options.max_bytes),
      [&](std::size_t begin, const VisibilityMasks& part) {
        std::copy(part.words.begin(), part.words.end(), solved.words.begin() + begin * solved.words_per_receiver);
      },
      counted);
  spread_masks(request, solved, receivers.size(), masks);
}

}  // namespace halfshade
