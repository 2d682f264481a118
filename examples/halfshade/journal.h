// render --resume: finished bands of rows are kept beside the picture, as parts of split `crop`, until it is complete.
// A run that was killed loses the band that it was working on.
#pragma once

#include "render_part.h"

namespace halfshade {

/// A directory that one process at a time may use.
class Journal {
 public:
  /// Creates it where it does not exist, and removes what a killed process left unfinished. Throws Error{kOutput}, also
  /// while another process uses it.
  explicit Journal(const std::filesystem::path& directory);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  const std::filesystem::path& directory() const { return directory_; }
  /// Manifests of the finished bands. Throws Error{kBadInput} for bands of another render than `like`.
  std::vector<Part> bands(const Part& like) const;
  std::filesystem::path band(const PartRange& rows) const;
  void remove() const;

 private:
  std::filesystem::path directory_;
  int lock_ = -1;
};

/// All lights of an opened pipeline, band by band; bands that the journal has are read. Throws as the methods do,
/// Error{kOutput}, and Error{kBadInput} for a journal of another render.
void solve_in_bands(Render& render, const Journal& journal);

/// Puts the masks of a part of split `crop` into those of the whole picture. Throws Error{kBadInput} unless they are
/// masks of the picture's receivers.
void paste_rows(Render& render, const Part& part);

}  // namespace halfshade
