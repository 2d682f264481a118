// OBJ and MTL as text: logical lines, tokens and numbers, with errors that say where.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "halfshade/error.h"

namespace halfshade {

/// Walks the lines of a text. Ends are \n, \r\n or \r; a byte order mark of the file is dropped; a line that ends in a
/// backslash is joined with the next one, except comments (exporters write Windows paths there).
class TextLines {
 public:
  static constexpr std::size_t kLongestLine = std::size_t{1} << 20;  // bytes

  /// `text` must outlive this. `name` is the file in messages. Throws Error{kBadInput} when it holds a zero byte.
  /// `lines_before` counts the file's lines in front of the text.
  TextLines(std::string_view text, std::string name, std::uint64_t lines_before = 0);

  /// Next logical line; valid until the following call. False at the end.
  bool next(std::string_view& line);

  /// Where the current line began, counted from 1.
  std::uint64_t number() const { return number_; }
  /// Lines read so far, those before the text included.
  std::uint64_t lines_read() const { return ended_; }

  /// "file:line: what".
  Error error(const std::string& what) const;

 private:
  std::string_view physical_line();

  std::string_view rest_;
  std::string name_;
  std::string joined_;
  std::uint64_t number_ = 0;  // of the current logical line
  std::uint64_t ended_ = 0;   // physical lines read so far
};

/// Blank-separated tokens of a line; a token that starts with '#' ends it.
class Tokens {
 public:
  explicit Tokens(std::string_view line) : rest_(line) {}
  /// Empty at the end.
  std::string_view next();
  /// All that follows, without the blanks around it: names may contain blanks.
  std::string_view rest() const;

 private:
  std::string_view rest_;
};

/// A file named on a line of another file.
struct FileReference {
  std::string name;  // as written, empty = none
  std::uint64_t line = 0;
};

enum class NumberFault { kOk, kSyntax, kNotFinite, kTooLarge };

/// Correctly rounded decimal number with an optional sign. Values too small for a double become zero.
NumberFault parse_number(std::string_view token, double& value);
const char* describe(NumberFault fault);

}  // namespace halfshade
