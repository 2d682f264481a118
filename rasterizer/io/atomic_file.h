// Files that appear under their name complete or not at all.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace halfshade {

/// A temporary file in the target's directory. commit() puts it under the target's name (a symbolic link is followed,
/// so the link stays); without commit it is removed again. A crash leaves the old file, or the new one, never a
/// mixture. All functions throw Error{kOutput} with path and reason; the old file is then untouched.
class AtomicFile {
 public:
  /// Refuses a target that exists and is not a regular file.
  explicit AtomicFile(const std::filesystem::path& target);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::filesystem::path& temporary() const { return temporary_; }
  void write(const void* data, std::size_t bytes);
  /// Flushes to the disk, renames, flushes the directory.
  void commit();

 private:
  [[noreturn]] void fail(const char* action) const;
  void sync_directory() const;

  std::filesystem::path target_, temporary_;
  int fd_ = -1;
};

void write_file_atomically(const std::filesystem::path& path, std::string_view bytes);

/// For a program that ends at once, whatever its threads do: removes the temporary of every AtomicFile that is open and
/// keeps new ones from being created (their threads wait for ever). Not for signal handlers: it waits for a lock.
void remove_temporaries_for_exit();

}  // namespace halfshade
