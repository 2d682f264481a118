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
  std::vector<std::uint32_t> counts, offsets;  // [digit][part]: a part's items come after those of the parts before it

  void reserve(std::size_t items) {
    const std::size_t most = kDigits * ((items + kPart - 1) / kPart);
    counts.reserve(most), offsets.reserve(most + 1);
  }
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
  std::vector<std::uint32_t>& offsets = kept.offsets;
  resize_checked(scratch, items.size());
  for (int shift = 0; shift < 32 && ((key_end - (key_end != 0)) >> shift) != 0; shift += kDigitBits) {
    const auto digit = [&](const Item& item) { return std::size_t{key(item) >> shift} & (kDigits - 1); };
    const auto for_part = [&](std::size_t part, const auto& body) {
      for (std::size_t i = part * kPart; i < std::min(items.size(), (part + 1) * kPart); ++i) body(items[i]);
    };
    counts.assign(kDigits * parts, 0);
    parallel_tasks(parts,
                   [&](std::size_t p) { for_part(p, [&](const Item& item) { ++counts[digit(item) * parts + p]; }); });
    exclusive_scan(counts, offsets);
    parallel_tasks(parts, [&](std::size_t p) {
      for_part(p, [&](const Item& item) { scratch[offsets[digit(item) * parts + p]++] = item; });
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
