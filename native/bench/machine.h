// SPDX-License-Identifier: GPL-3.0-or-later
// The machine that a benchmark ran on, for its report.
#pragma once

#include <fstream>
#include <string>
#include <thread>

#include "kernels/kernels.h"

namespace dd::bench {

/// The processor by name where the system tells it, those of its instruction sets that matter here,
/// and the kernels that the library uses.
inline std::string machine() {
  std::string name = "unknown processor";
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    const size_t colon = line.find(": ");
    if (line.rfind("model name", 0) != 0 || colon == std::string::npos) continue;
    name = line.substr(colon + 2);
    break;
  }
  std::string sets;
#if defined(__x86_64__) && (defined(__GNUC__) || defined(__clang__))
  if (__builtin_cpu_supports("avx2")) sets += " AVX2";
  if (__builtin_cpu_supports("fma")) sets += " FMA";
  if (__builtin_cpu_supports("avx512f")) sets += " AVX-512";
#endif
  return name + ", " + std::to_string(std::thread::hardware_concurrency()) + " threads," +
         (sets.empty() ? " instruction sets unknown" : sets) + ", kernels " + kernels().name;
}

}  // namespace dd::bench
