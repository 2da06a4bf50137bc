// What the headers ask of a C++ library, for a module that has none: memory by sizes of powers of two, kept
// for their next use. Who is out of memory or breaks a rule of a container ends in a trap.
#include <cstddef>
#include <cstdint>
#include <new>

namespace {

constexpr std::uintptr_t kPage = 65536;
constexpr std::size_t kSmallest = 16;

struct Freed {
  Freed* next;
};
Freed* freed[28];
std::uintptr_t end_of_used = 0;

int size_class(std::size_t bytes) {
  int k = 0;
  while ((kSmallest << k) < bytes) ++k;
  return k;
}

}  // namespace

// The linker puts it behind everything else.
extern "C" unsigned char __heap_base;

void* operator new(std::size_t bytes) {
  if (bytes > (std::size_t{1} << 30)) __builtin_trap();
  const int k = size_class(bytes);
  if (Freed* found = freed[k]) {
    freed[k] = found->next;
    return found;
  }
  if (end_of_used == 0)
    end_of_used = (reinterpret_cast<std::uintptr_t>(&__heap_base) + kSmallest - 1) / kSmallest * kSmallest;
  const std::uintptr_t begin = end_of_used;
  end_of_used += kSmallest << k;
  const std::uintptr_t pages = (end_of_used + kPage - 1) / kPage;
  const std::uintptr_t here = __builtin_wasm_memory_size(0);
  if (pages > here && __builtin_wasm_memory_grow(0, pages - here) == static_cast<std::size_t>(-1))
    __builtin_trap();
  return reinterpret_cast<void*>(begin);
}

void operator delete(void* memory, std::size_t bytes) noexcept {
  if (memory == nullptr) return;
  const int k = size_class(bytes);
  freed[k] = new (memory) Freed{freed[k]};
}

void operator delete(void*) noexcept { __builtin_trap(); }  // of unknown size: nobody does

// A module never ends: what would be destroyed then stays.
extern "C" int __cxa_atexit(void (*)(void*), void*, void*) { return 0; }

namespace std {
inline namespace __1 {
[[noreturn]] void __libcpp_verbose_abort(const char*, ...) noexcept { __builtin_trap(); }
}  // namespace __1
}  // namespace std
