// Stable sort of items by a small integer key, in parallel: least significant digit first.
#pragma once

#include <algorithm>
#include <utility>

#include "rasterizer/core/parallel.h"

namespace halfshade {

/// Counts of digits, kept so that sorting again allocates nothing.
struct RadixCounts {
  static constexpr int kDigitBits = 11;
  static constexpr std::size_t kDigits = std::size_t{1} << kDigitBits, kPart = 1 << 16;
  /// [part][digit], so that no two threads write to one cache line: how many items of a part, then where they go. A
  /// part's items come after those of the parts before it.
  std::vector<std::uint32_t> counts;

  void reserve(std::size_t items) { counts.reserve(kDigits * ((items + kPart - 1) / kPart)); }
};

/// Sorts `items` by key(item) < key_end; items of equal keys keep their order, so the result is the same for any number
/// of threads. `scratch` is resized to match and holds the previous order afterwards.
template <class Item, class Key>
void parallel_radix_sort(std::vector<Item>& items, std::vector<Item>& scratch, std::uint32_t key_end, const Key& key,
                         RadixCounts& kept) {
  constexpr int kDigitBits = RadixCounts::kDigitBits;
  constexpr std::size_t kDigits = RadixCounts::kDigits, kPart = RadixCounts::kPart;
  const std::size_t parts = (items.size() + kPart - 1) / kPart;
  std::vector<std::uint32_t>& counts = kept.counts;  // not a structured binding: Clang before 16 cannot capture one
  resize_checked(scratch, items.size());
  for (int shift = 0; shift < 32 && ((key_end - (key_end != 0)) >> shift) != 0; shift += kDigitBits) {
    const auto for_part = [&](std::size_t part, const auto& body) {
      std::uint32_t* const of_digit = counts.data() + kDigits * part;
      for (std::size_t i = part * kPart; i < std::min(items.size(), (part + 1) * kPart); ++i)
        body(items[i], of_digit[std::size_t{key(items[i]) >> shift} & (kDigits - 1)]);
    };
    counts.assign(kDigits * parts, 0);
    parallel_tasks(parts, [&](std::size_t p) { for_part(p, [](const Item&, std::uint32_t& count) { ++count; }); });
    std::uint32_t sum = 0;
    for (std::size_t digit = 0; digit < kDigits; ++digit) {
      for (std::size_t p = 0; p < parts; ++p) sum += std::exchange(counts[kDigits * p + digit], sum);
    }
    parallel_tasks(parts, [&](std::size_t p) {
      for_part(p, [&](const Item& item, std::uint32_t& place) { scratch[place++] = item; });
    });
    std::swap(items, scratch);
  }
}

template <class Item, class Key>
void parallel_radix_sort(std::vector<Item>& items, std::vector<Item>& scratch, std::uint32_t key_end, const Key& key) {
  RadixCounts counts;
  parallel_radix_sort(items, scratch, key_end, key, counts);
}

}  // namespace halfshade
