#include "fuzz/fuzz_target.h"

#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "rasterizer/io/image.h"

namespace halfshade::fuzz {
namespace {

namespace fs = std::filesystem;

class ProcessDirectory {
 public:
  ProcessDirectory() {
    std::string pattern = (fs::temp_directory_path() / "halfshade-fuzz-XXXXXX").string();
    require(::mkdtemp(pattern.data()) != nullptr, "no directory can be made: " + pattern);
    path_ = fs::canonical(pattern);
    write("a.mtl", "newmtl a\nKd .5 .5 .5\nmap_d a.png\nnewmtl b\nd .5\nTf .2 .4 .6\nmap_Kd a.png\n");
    const float y[] = {0.0f, 0.5f, 2.0f, 0.18f};
    write_png(path_ / "a.png", 2, 2, 1, y, true, 8, {});
    const ImageChannel channel{"Y", ImageChannel::Type::kFloat, y};
    write_exr(path_ / "a.exr", 2, 2, {&channel, 1}, {});
  }
  ~ProcessDirectory() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  ProcessDirectory(const ProcessDirectory&) = delete;
  ProcessDirectory& operator=(const ProcessDirectory&) = delete;

  const fs::path& path() const { return path_; }
  fs::path write(const std::string& name, std::string_view bytes) const {
    std::ofstream stream(path_ / name, std::ios::binary);
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    require(stream.good(), "cannot write " + name);
    return path_ / name;
  }

 private:
  fs::path path_;
};

const ProcessDirectory& process_directory() {
  static const ProcessDirectory directory;
  return directory;
}

}  // namespace

void require(bool holds, const std::string& what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", what.c_str());
  std::fflush(stderr);
  std::abort();
}

Refusal refusal_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    const bool may_be =
        error.code() == ErrorCode::kBadInput || error.code() == ErrorCode::kLimit || error.code() == ErrorCode::kUsage;
    require(may_be && error.what()[0] != '\0', std::string("an input is refused as such: ") + error.what());
    return {true, error.what()};
  }
  return {};
}

std::string_view as_text(Bytes input) { return {reinterpret_cast<const char*>(input.data()), input.size()}; }

const fs::path& directory() { return process_directory().path(); }
fs::path write_file(const std::string& name, std::string_view bytes) { return process_directory().write(name, bytes); }

}  // namespace halfshade::fuzz
