#include "rasterizer/io/text_lines.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

namespace halfshade {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }

bool is_comment(std::string_view line) {
  const auto first = std::find_if_not(line.begin(), line.end(), is_blank);
  return first != line.end() && *first == '#';
}

}  // namespace

TextLines::TextLines(std::string_view text, std::string name, std::uint64_t lines_before)
    : rest_(text), name_(std::move(name)), number_(lines_before), ended_(lines_before) {
  if (lines_before == 0 && rest_.starts_with("\xef\xbb\xbf")) rest_.remove_prefix(3);
  const std::size_t zero = text.find('\0');
  if (zero == std::string_view::npos) return;
  number_ +=
      1 + static_cast<std::uint64_t>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(zero), '\n'));
  throw error(fmt::format("zero byte at offset {}: not a text file", zero));
}

std::string_view TextLines::physical_line() {
  const char* const begin = rest_.data();
  const char* const end = begin + rest_.size();
  const char* stop = begin;
  while (stop != end && *stop != '\n' && *stop != '\r') ++stop;
  const char* following = stop;
  if (following != end) following += (*stop == '\r' && stop + 1 != end && stop[1] == '\n') ? 2 : 1;
  const std::string_view line(begin, static_cast<std::size_t>(stop - begin));
  rest_.remove_prefix(static_cast<std::size_t>(following - begin));
  ++ended_;
  if (line.size() > kLongestLine) {
    number_ = ended_;
    throw error(fmt::format("line of {} bytes, allowed at most {}", line.size(), kLongestLine));
  }
  return line;
}

bool TextLines::next(std::string_view& line) {
  if (rest_.empty()) return false;
  line = physical_line();
  number_ = ended_;
  if (!line.ends_with('\\') || is_comment(line)) return true;
  joined_.assign(line);
  while (joined_.ends_with('\\')) {
    joined_.back() = ' ';
    if (rest_.empty()) break;
    joined_.append(physical_line());
  }
  line = joined_;
  return true;
}

Error TextLines::error(const std::string& what) const {
  return Error(ErrorCode::kBadInput, fmt::format("{}:{}: {}", name_, number_, what));
}

std::string_view Tokens::next() {
  const char* begin = rest_.data();
  const char* const end = begin + rest_.size();
  while (begin != end && is_blank(*begin)) ++begin;
  const char* stop = begin;
  while (stop != end && !is_blank(*stop)) ++stop;
  if (begin != end && *begin == '#') begin = stop = end;
  rest_ = {stop, static_cast<std::size_t>(end - stop)};
  return {begin, static_cast<std::size_t>(stop - begin)};
}

std::string_view Tokens::rest() const {
  std::string_view text = rest_;
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

NumberFault parse_number(std::string_view token, double& value) {
  if (token.starts_with('+') && !token.starts_with("+-")) token.remove_prefix(1);
  const char* const end = token.data() + token.size();
  auto result = std::from_chars(token.data(), end, value);
  if (result.ec == std::errc::result_out_of_range) {
    // from_chars reports 1e-400 and 1e400 alike; the wider type tells them apart.
    long double wide = 0.0L;
    result = std::from_chars(token.data(), end, wide);
    if (result.ec != std::errc{} || std::fabs(wide) > 1.0L) return NumberFault::kTooLarge;
    value = 0.0;
  }
  if (result.ec != std::errc{} || result.ptr != end) return NumberFault::kSyntax;
  return std::isfinite(value) ? NumberFault::kOk : NumberFault::kNotFinite;
}

const char* describe(NumberFault fault) {
  switch (fault) {
    case NumberFault::kOk:
      return "is fine";
    case NumberFault::kSyntax:
      return "is not a number";
    case NumberFault::kNotFinite:
      return "is not finite";
    case NumberFault::kTooLarge:
      return "is too large for a number";
  }
  return "";
}

}  // namespace halfshade
