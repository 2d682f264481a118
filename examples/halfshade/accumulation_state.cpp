#include "accumulation_state.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "halfshade/error.h"
#include "input_hashes.h"
#include "rasterizer/io/atomic_file.h"

namespace halfshade {
namespace {

using nlohmann::ordered_json;

constexpr const char* kSchema = "halfshade.accumulation/1";
constexpr std::size_t kLongestHeader = 4096;

static_assert(std::endian::native == std::endian::little, "arrays of the state are little-endian");

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& reason) {
  throw Error(ErrorCode::kBadInput, fmt::format("{}: {}", path.string(), reason));
}

template <class T>
void append(std::string& bytes, std::span<const T> values) {
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
}

/// Takes arrays off the front of a payload whose length has been checked.
class PayloadReader {
 public:
  explicit PayloadReader(std::string_view bytes) : bytes_(bytes) {}
  template <class T>
  std::vector<T> take(std::size_t count) {
    std::vector<T> values(count);
    if (count != 0) std::memcpy(values.data(), bytes_.data(), count * sizeof(T));
    bytes_.remove_prefix(count * sizeof(T));
    return values;
  }

 private:
  std::string_view bytes_;
};

std::string payload_of(const AccumulationState& state) {
  std::string bytes;
  for (const VisibilityAccumulator& light : state.lights) {
    append(bytes, light.visible());
    append(bytes, light.total());
  }
  append(bytes, state.color.sums());
  for (const FrameRecord& frame : state.frames) {
    const std::array<double, 2> errors = {frame.error.rmse, frame.error.worst};
    append(bytes, std::span<const double>(errors));
  }
  return bytes;
}

std::size_t payload_size(const AccumulationState& state, std::size_t frames) {
  std::size_t bytes = state.color.size() * 8 + frames * 16;
  for (const VisibilityAccumulator& light : state.lights) bytes += light.size() * 8;
  return bytes;
}

std::string read_bytes(const std::filesystem::path& path, std::size_t most) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) fail(path, "cannot be opened");
  std::string bytes;
  std::array<char, 65536> block;
  while (stream.read(block.data(), block.size()), stream.gcount() > 0) {
    bytes.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (bytes.size() > most) fail(path, "is longer than a state of this picture");
  }
  return bytes;
}

/// The number of frames, after checking that the header belongs to this run and this payload.
std::size_t checked_frames(const std::filesystem::path& path, const std::string& line, std::string_view payload,
                           const AccumulationState& expected) {
  const ordered_json header = ordered_json::parse(line, nullptr, false);
  const auto text = [&](const char* key) {
    return header.is_object() && header.contains(key) && header[key].is_string() ? header[key].get<std::string>() : "";
  };
  if (text("schema") != kSchema) fail(path, "is not a state of 'halfshade accumulate'");
  if (text("options_hash") != expected.options_hash) {
    fail(path, "was made with other options or another scene; remove it or run without --resume");
  }
  const auto frames = header.contains("frames") && header["frames"].is_number_unsigned()
                          ? header["frames"].get<std::uint64_t>()
                          : std::uint64_t{1} << 32;
  if (frames > (1u << 25) || payload.size() != payload_size(expected, frames) || text("xxh3_128") != hash_of(payload)) {
    fail(path, "is damaged");
  }
  return frames;
}

}  // namespace

void write_state(const std::filesystem::path& path, const AccumulationState& state) {
  const std::string payload = payload_of(state);
  const ordered_json header = {{"schema", kSchema},
                               {"options_hash", state.options_hash},
                               {"frames", state.frames.size()},
                               {"lights", state.lights.size()},
                               {"entries", state.lights.empty() ? 0 : state.lights[0].size()},
                               {"color_values", state.color.size()},
                               {"xxh3_128", hash_of(payload)}};
  write_file_atomically(path, header.dump() + "\n" + payload);
}

void read_state(const std::filesystem::path& path, AccumulationState& state) {
  const std::string bytes = read_bytes(path, kLongestHeader + payload_size(state, 1u << 25));
  const std::size_t line = bytes.find('\n');
  if (line > kLongestHeader) fail(path, "is not a state of 'halfshade accumulate'");
  const std::string_view payload = std::string_view(bytes).substr(line + 1);
  const std::size_t frames = checked_frames(path, bytes.substr(0, line), payload, state);
  PayloadReader reader(payload);
  for (VisibilityAccumulator& light : state.lights) {
    std::vector<std::uint32_t> visible = reader.take<std::uint32_t>(light.size());
    light = VisibilityAccumulator(std::move(visible), reader.take<std::uint32_t>(light.size()));
  }
  state.color = ColorAccumulator(reader.take<std::uint64_t>(state.color.size()), static_cast<std::uint32_t>(frames));
  state.frames.resize(frames);
  for (FrameRecord& frame : state.frames) {
    const std::vector<double> errors = reader.take<double>(2);
    frame.error = {errors[0], errors[1], 0};
  }
}

}  // namespace halfshade
