// Arrays in large pages. A picture's first touch of its memory, 4 KiB at a time, may take as long as its shadows
// (docs/performance.md): arrays of 512 KiB and more ask for pages of 2 MiB. That is idle where all get them anyway.
#if defined(__linux__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <new>

namespace {

constexpr std::size_t kLargePage = std::size_t{2} << 20, kLarge = kLargePage / 4;

/// For operator delete, which frees.
void* allocate(std::size_t size, std::size_t alignment) {
  for (;;) {
    void* memory = nullptr;
    if (size >= kLarge) {
      const std::size_t pages = (size + kLargePage - 1) / kLargePage * kLargePage;
      if (pages < size || posix_memalign(&memory, kLargePage, pages) != 0) memory = nullptr;
      if (memory != nullptr) madvise(memory, pages, MADV_HUGEPAGE);
    } else if (alignment <= alignof(std::max_align_t)) {
      memory = std::malloc(size == 0 ? 1 : size);
    } else if (posix_memalign(&memory, alignment, size) != 0) {
      memory = nullptr;
    }
    if (memory != nullptr) return memory;
    if (const std::new_handler handler = std::get_new_handler()) {
      handler();
    } else {
      throw std::bad_alloc();
    }
  }
}

}  // namespace

void* operator new(std::size_t size) { return allocate(size, alignof(std::max_align_t)); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, static_cast<std::size_t>(alignment));
}

#endif
