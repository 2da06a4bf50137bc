#include "core/isa/dispatch.hpp"

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
  if (__builtin_cpu_supports("avx2")) found.push_back(table(gantry_kernels_avx2()));
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl"))
    found.push_back(table(gantry_kernels_avx512()));
#endif
  return found;
}

const Kernels& kernels() {
  static const Kernels& chosen = choose();
  return chosen;
}

}  // namespace gantry
