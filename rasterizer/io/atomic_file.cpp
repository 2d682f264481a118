#include "rasterizer/io/atomic_file.h"

#include <atomic>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <set>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "halfshade/error.h"

namespace halfshade {
namespace {

namespace fs = std::filesystem;

fs::path follow_links(const fs::path& path) {
  std::error_code failure;
  const fs::path resolved = fs::weakly_canonical(path, failure);
  return failure ? path : resolved;
}

fs::path directory_of(const fs::path& path) { return path.has_parent_path() ? path.parent_path() : fs::path("."); }

// Short, so that it fits wherever the target's own name does; unique in this process, O_EXCL does the rest.
fs::path temporary_name(const fs::path& target) {
  static std::atomic<std::uint64_t> counter{0};
  return directory_of(target) / fmt::format(".halfshade-{}-{}.tmp", ::getpid(), counter++);
}

/// The temporaries that exist. Whoever creates or forgets one holds the lock.
struct Temporaries {
  std::mutex lock;
  std::set<fs::path> paths;
};

Temporaries& temporaries() {
  static auto* const all = new Temporaries;  // outlives every thread
  return *all;
}

/// The file's descriptor, or -1 with errno.
int create_temporary(const fs::path& path) {
  Temporaries& all = temporaries();
  const std::lock_guard guard(all.lock);
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (fd >= 0) all.paths.insert(path);
  return fd;
}

void forget_temporary(const fs::path& path) {
  Temporaries& all = temporaries();
  const std::lock_guard guard(all.lock);
  all.paths.erase(path);
}

}  // namespace

AtomicFile::AtomicFile(const fs::path& target) : target_(follow_links(target)) {
  struct stat status {};
  if (::stat(target_.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) {
    throw Error(ErrorCode::kOutput, fmt::format("{}: exists and is not a regular file", target_.string()));
  }
  do {
    temporary_ = temporary_name(target_);
    fd_ = create_temporary(temporary_);
  } while (fd_ < 0 && errno == EEXIST);
  if (fd_ < 0) fail("create a file in its directory");
}

AtomicFile::~AtomicFile() {
  if (fd_ >= 0) ::close(fd_);
  if (temporary_.empty()) return;
  ::unlink(temporary_.c_str());
  forget_temporary(temporary_);
}

void AtomicFile::write(const void* data, std::size_t bytes) {
  const char* at = static_cast<const char*>(data);
  while (bytes != 0) {
    const ssize_t written = ::write(fd_, at, bytes);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail("write");
    at += written;
    bytes -= static_cast<std::size_t>(written);
  }
}

void AtomicFile::commit() {
  // Network file systems report a full disk or quota only here.
  if (::fsync(fd_) != 0 && errno != EINVAL) fail("flush");
  const int fd = std::exchange(fd_, -1);
  if (::close(fd) != 0) fail("close");
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("replace");
  forget_temporary(std::exchange(temporary_, fs::path()));
  sync_directory();
}

void AtomicFile::sync_directory() const {
  const int fd = ::open(directory_of(target_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;  // a directory may be writable but not readable; the data itself is safe
  const int result = ::fsync(fd);
  const int reason = errno;
  ::close(fd);
  errno = reason;
  if (result != 0 && reason != EINVAL) fail("flush the directory of");
}

void AtomicFile::fail(const char* action) const {
  const int reason = errno;
  throw Error(ErrorCode::kOutput, fmt::format("{}: cannot {}: {}", target_.string(), action, std::strerror(reason)));
}

void write_file_atomically(const fs::path& path, std::string_view bytes) {
  AtomicFile file(path);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

void remove_temporaries_for_exit() {
  Temporaries& all = temporaries();
  all.lock.lock();  // for good
  for (const fs::path& path : all.paths) ::unlink(path.c_str());
}

}  // namespace halfshade
