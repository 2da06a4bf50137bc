#include "core/isa/dispatch.hpp"

#if defined(GANTRY_ISA_DISPATCH)
#include <cpuid.h>
#endif

#include <cstdlib>
#include <stdexcept>

extern "C" {
const void* gantry_kernels_baseline();
#if defined(GANTRY_ISA_DISPATCH)
const void* gantry_kernels_avx2();
const void* gantry_kernels_avx512();
#endif
}

namespace gantry {
namespace {

// Every set has types of its own, made of the same source: same layout, other names. This is the only place
// where one is taken for the other.
const Kernels* table(const void* kernels) { return static_cast<const Kernels*>(kernels); }

#if defined(GANTRY_ISA_DISPATCH)

// The processor is asked itself (Intel SDM 2A, CPUID leaves 1 and 7; 1, 13.2 for XCR0): Zig's run-time
// library leaves
// __builtin_cpu_supports at 0, and its wheels would run on the baseline only.
struct Processor {
  bool avx2 = false;
  bool avx512 = false;
};

Processor processor() {
  unsigned a = 0;
  unsigned b = 0;
  unsigned c = 0;
  unsigned d = 0;
  if (__get_cpuid(1, &a, &b, &c, &d) == 0 || (c & bit_OSXSAVE) == 0 || (c & bit_AVX) == 0) return {};
  // Which registers the operating system keeps when it changes from one thread to another.
  unsigned kept = 0;
  __asm__ volatile("xgetbv" : "=a"(kept), "=d"(d) : "c"(0));
  constexpr unsigned ymm = 0x06;
  constexpr unsigned zmm = 0xE6;
  constexpr unsigned sets = bit_AVX512F | bit_AVX512DQ | bit_AVX512VL;
  if (__get_cpuid_count(7, 0, &a, &b, &c, &d) == 0) return {};
  return {(kept & ymm) == ymm && (b & bit_AVX2) != 0, (kept & zmm) == zmm && (b & sets) == sets};
}

#endif

const Kernels& choose() {
  const std::vector<const Kernels*> supported = supported_kernels();
  const char* forced = std::getenv("GANTRYCTL_ISA");
  if (forced == nullptr || *forced == '\0') return *supported.back();
  std::string names;
  for (const Kernels* k : supported) {
    if (k->name == std::string(forced)) return *k;
    names += (names.empty() ? "" : ", ") + std::string(k->name);
  }
  throw std::invalid_argument("GANTRYCTL_ISA is '" + std::string(forced) + "'; this processor has: " + names +
                              " (leave it unset for the best)");
}

}  // namespace

std::vector<const Kernels*> supported_kernels() {
  std::vector<const Kernels*> found = {table(gantry_kernels_baseline())};
#if defined(GANTRY_ISA_DISPATCH)
  const Processor has = processor();
  if (has.avx2) found.push_back(table(gantry_kernels_avx2()));
  if (has.avx512) found.push_back(table(gantry_kernels_avx512()));
#endif
  return found;
}

const Kernels& kernels() {
  static const Kernels& chosen = choose();
  return chosen;
}

}  // namespace gantry
