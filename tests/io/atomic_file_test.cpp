#include "rasterizer/io/atomic_file.h"

#include <csignal>
#include <functional>
#include <memory>

#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "rasterizer/io/image.h"
#include "rasterizer/io/npy.h"
#include "scratch.h"

namespace halfshade {
namespace {

using test::Scratch;
namespace fs = std::filesystem;

TEST_CASE("a file appears complete under its name and leaves nothing else") {
  const Scratch scratch;
  write_file_atomically(scratch.path("a"), "old");
  write_file_atomically(scratch.path("a"), "new and longer");
  CHECK(test::read_bytes(scratch.path("a")) == "new and longer");
  CHECK(scratch.file_count() == 1);
}

TEST_CASE("without commit the old file stays and the temporary is removed") {
  const Scratch scratch;
  write_file_atomically(scratch.path("a"), "old");
  {
    AtomicFile file(scratch.path("a"));
    file.write("half", 4);
    CHECK(file.temporary().parent_path() == scratch.path());
    CHECK(scratch.file_count() == 2);
  }
  CHECK(test::read_bytes(scratch.path("a")) == "old");
  CHECK(scratch.file_count() == 1);
}

TEST_CASE("a program that ends at once leaves no temporary and the old file") {
  const Scratch scratch;
  write_file_atomically(scratch.path("a"), "old");
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    AtomicFile file(scratch.path("a"));
    file.write("half", 4);
    const bool both = scratch.file_count() == 2;
    remove_temporaries_for_exit();
    ::_exit(both ? 7 : 1);
  }
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
  CHECK(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 7);
  CHECK(test::read_bytes(scratch.path("a")) == "old");
  CHECK(scratch.file_count() == 1);
}

TEST_CASE("writing through a symbolic link keeps the link and replaces its target") {
  const Scratch scratch;
  write_file_atomically(scratch.path("a"), "old");
  fs::create_symlink("a", scratch.path("link"));
  write_file_atomically(scratch.path("link"), "new");
  CHECK(fs::is_symlink(scratch.path("link")));
  CHECK(test::read_bytes(scratch.path("a")) == "new");
}

TEST_CASE("the usual file permissions apply") {
  const Scratch scratch;
  const mode_t old = ::umask(027);
  write_file_atomically(scratch.path("a"), "x");
  ::umask(old);
  CHECK((fs::status(scratch.path("a")).permissions() & fs::perms::all) == fs::perms(0640));
}

TEST_CASE("a missing directory, a directory, a fifo or a device as target is refused") {
  const Scratch scratch;
  REQUIRE(::mkfifo(scratch.path("fifo").c_str(), 0600) == 0);
  write_file_atomically(scratch.path("file"), "x");
  for (const fs::path& target :
       {scratch.path("none/a"), scratch.path(), scratch.path("fifo"), scratch.path("file/a"), fs::path("/dev/null")}) {
    const auto outcome = test::outcome_of([&] { write_file_atomically(target, "x"); });
    CAPTURE(outcome.message);
    CHECK(outcome.threw);
    CHECK(outcome.code == ErrorCode::kOutput);
    CHECK(outcome.has(target.string()));
  }
  CHECK(scratch.file_count() == 2);
}

TEST_CASE("a directory that cannot be written is refused") {
  if (::geteuid() == 0) {
    MESSAGE("skipped: permissions do not bind the superuser");
    return;
  }
  const Scratch scratch;
  fs::permissions(scratch.path(), fs::perms::owner_read | fs::perms::owner_exec);
  const auto outcome = test::outcome_of([&] { write_file_atomically(scratch.path("a"), "x"); });
  fs::permissions(scratch.path(), fs::perms::owner_all);
  CHECK(outcome.code == ErrorCode::kOutput);
  CHECK(outcome.has("Permission denied"));
}

// Every writer with more than `bytes` of data that does not compress, to NAME in a directory that holds an old NAME.
struct Writer {
  const char* name;
  std::function<void(const fs::path&)> write;
};

std::vector<Writer> writers(std::size_t count) {
  auto noise = std::make_shared<std::vector<float>>(count);
  std::uint32_t state = 1;
  for (float& x : *noise) x = static_cast<float>((state = state * 1664525u + 1013904223u) >> 8) * 0x1p-24f;
  const auto side = static_cast<std::uint32_t>(count / 512);
  return {
      {"bytes", [=](const fs::path& path) { write_file_atomically(path, std::string(count * 4, 'x')); }},
      {"a.npy", [=](const fs::path& path) { write_npy(path, "f4", std::vector<std::size_t>{count}, noise->data()); }},
      {"a.png", [=](const fs::path& path) { write_png(path, 512, side, 1, *noise, true, 16, {}); }},
      {"a.exr", [=](const fs::path& path) {
         const ImageChannel channel{"R", ImageChannel::Type::kFloat, noise->data()};
         write_exr(path, 512, side, {&channel, 1}, {});
       }}};
}

void check_full_disk(const fs::path& directory, const Writer& writer, const char* reason) {
  const fs::path target = directory / writer.name;
  write_file_atomically(target, "old content");
  const auto outcome = test::outcome_of([&] { writer.write(target); });
  CAPTURE(writer.name);
  CAPTURE(outcome.message);
  CHECK(outcome.threw);
  CHECK(outcome.code == ErrorCode::kOutput);
  CHECK(outcome.has(target.string()));
  CHECK(outcome.has(reason));
  CHECK(test::read_bytes(target) == "old content");
  fs::remove(target);
  CHECK(fs::is_empty(directory));
}

TEST_CASE("S40 disk_full: when a file may not grow, the old one stays and no temporary is left") {
  const Scratch scratch;
  const auto list = writers(512 * 1024);
  rlimit old{};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &old) == 0);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{256 * 1024, old.rlim_max};
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &small) == 0);
  for (const Writer& writer : list) check_full_disk(scratch.path(), writer, "File too large");
  CHECK(::setrlimit(RLIMIT_FSIZE, &old) == 0);
  std::signal(SIGXFSZ, old_handler);
}

TEST_CASE("S40 disk_full: on a full file system the old file stays and no temporary is left") {
  const Scratch scratch;
  if (::mount("tmpfs", scratch.path().c_str(), "tmpfs", 0, "size=1m") != 0) {
    MESSAGE("skipped: a small file system cannot be mounted here");
    return;
  }
  for (const Writer& writer : writers(1024 * 1024)) check_full_disk(scratch.path(), writer, "No space left");
  CHECK(::umount2(scratch.path().c_str(), MNT_DETACH) == 0);
}

}  // namespace
}  // namespace halfshade
