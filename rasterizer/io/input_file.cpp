#include "rasterizer/io/input_file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "halfshade/error.h"

namespace halfshade {
namespace {

namespace fs = std::filesystem;

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

[[noreturn]] void fail_errno(const fs::path& file, const char* action) {
  throw Error(ErrorCode::kBadInput, fmt::format("{}: cannot {}: {}", file.string(), action, std::strerror(errno)));
}

void require_regular(const fs::path& file, const struct stat& status) {
  if (S_ISREG(status.st_mode)) return;
  const char* kind = S_ISDIR(status.st_mode)                              ? "a directory"
                     : S_ISFIFO(status.st_mode)                           ? "a fifo"
                     : S_ISCHR(status.st_mode) || S_ISBLK(status.st_mode) ? "a device"
                                                                          : "a special file";
  throw Error(ErrorCode::kBadInput, fmt::format("{}: is {}, not a regular file", file.string(), kind));
}

// Looks before opening, because opening a device can have effects; looks again afterwards, because the name may have
// changed hands in between. O_NONBLOCK keeps a fifo that slipped in from hanging the open.
int open_regular(const fs::path& file, struct stat& status) {
  if (::stat(file.c_str(), &status) != 0) fail_errno(file, "read");
  require_regular(file, status);
  const int fd = ::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
  if (fd < 0) fail_errno(file, "open");
  return fd;
}

}  // namespace

std::string read_regular_file(const fs::path& file, std::uint64_t max_bytes) {
  struct stat status {};
  const Descriptor descriptor(open_regular(file, status));
  if (::fstat(descriptor.get(), &status) != 0) fail_errno(file, "read");
  require_regular(file, status);
  const auto fail_size = [&] {
    throw Error(ErrorCode::kLimit, fmt::format("{}: larger than the allowed {} bytes", file.string(), max_bytes));
  };
  if (static_cast<std::uint64_t>(status.st_size) > max_bytes) fail_size();

  std::string bytes;
  std::size_t used = 0;
  bytes.resize(static_cast<std::size_t>(status.st_size) + 1);  // one more, so that the end shows without growing
  for (;;) {
    const ssize_t got = ::read(descriptor.get(), bytes.data() + used, bytes.size() - used);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail_errno(file, "read");
    if (got == 0) break;
    used += static_cast<std::size_t>(got);
    if (used > max_bytes) fail_size();
    if (used == bytes.size()) bytes.resize(bytes.size() * 2);  // a file that grows, or states no size (procfs)
  }
  bytes.resize(used);
  return bytes;
}

RegularFile::RegularFile(const fs::path& file) : file_(file) {
  struct stat status {};
  descriptor_ = open_regular(file, status);
  if (::fstat(descriptor_, &status) == 0 && S_ISREG(status.st_mode)) return;
  ::close(descriptor_);
  require_regular(file, status);
  fail_errno(file, "read");
}

RegularFile::~RegularFile() { ::close(descriptor_); }

std::size_t RegularFile::read(char* bytes, std::size_t most) {
  for (;;) {
    const ssize_t got = ::read(descriptor_, bytes, most);
    if (got >= 0) return static_cast<std::size_t>(got);
    if (errno != EINTR) fail_errno(file_, "read");
  }
}

AssetRoot::AssetRoot(const fs::path& directory, bool allow_any) : allow_any_(allow_any) {
  std::error_code failure;
  root_ = fs::canonical(directory.empty() ? fs::path(".") : directory, failure);
  if (failure) {
    throw Error(ErrorCode::kBadInput, fmt::format("{}: cannot read: {}", directory.string(), failure.message()));
  }
}

fs::path AssetRoot::resolve(const fs::path& base, std::string_view reference) const {
  std::string name(reference);
  std::replace(name.begin(), name.end(), '\\', '/');
  std::error_code failure;
  const fs::path resolved = fs::weakly_canonical(fs::absolute(base / name), failure);
  if (failure) throw Error(ErrorCode::kBadInput, fmt::format("{}: {}", in_quotes(reference), failure.message()));
  const auto differs = std::mismatch(root_.begin(), root_.end(), resolved.begin(), resolved.end());
  if (!allow_any_ && differs.first != root_.end()) {
    throw Error(ErrorCode::kBadInput, fmt::format("{} leads outside the scene's directory {}, which is not allowed",
                                                  in_quotes(reference), root_.string()));
  }
  struct stat status {};
  if (::stat(resolved.c_str(), &status) == 0) require_regular(resolved, status);
  return resolved;
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  std::string shown = "'";
  for (const char c : text.substr(0, kLongest)) shown += c < ' ' || c > '~' ? '?' : c;
  return shown + (text.size() > kLongest ? "...'" : "'");
}

}  // namespace halfshade
