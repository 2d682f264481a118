// Files that come from outside: only regular files of a stated size are ever opened, and files that another file names
// must lie inside the asset root.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace halfshade {

/// The whole file. Refuses directories, devices, sockets and fifos without opening them.
/// Throws Error{kBadInput} (missing, not regular, unreadable) or Error{kLimit} (more than `max_bytes`).
std::string read_regular_file(const std::filesystem::path& file, std::uint64_t max_bytes);

/// A regular file that is read from front to end; refuses what read_regular_file refuses.
class RegularFile {
 public:
  explicit RegularFile(const std::filesystem::path& file);
  ~RegularFile();
  RegularFile(const RegularFile&) = delete;
  RegularFile& operator=(const RegularFile&) = delete;
  /// Up to `most` bytes; 0 at the end.
  std::size_t read(char* bytes, std::size_t most);

 private:
  std::filesystem::path file_;
  int descriptor_ = -1;
};

/// Where the files that an OBJ or MTL names may lie.
class AssetRoot {
 public:
  /// `directory` is made canonical; with `allow_any` every path is accepted (but still only regular files).
  AssetRoot(const std::filesystem::path& directory, bool allow_any);

  /// `reference` as written in a file that lies in `base`, with symbolic links resolved; nothing is opened.
  /// Both separators count. Throws Error{kBadInput} when the result is outside the root, or exists but is no regular
  /// file.
  std::filesystem::path resolve(const std::filesystem::path& base, std::string_view reference) const;

 private:
  std::filesystem::path root_;
  bool allow_any_;
};

/// `text` in single quotes for a message: at most 40 characters, control characters and foreign bytes as '?'.
std::string in_quotes(std::string_view text);

}  // namespace halfshade
