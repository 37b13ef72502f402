// SPDX-License-Identifier: GPL-3.0-or-later
// How inputs are mutated. Their bytes are choices, most of them read from the end: where libFuzzer
// moves bytes, all later choices change their meaning, and its changes seldom give an input that is
// invalid in two or three places at once. Random inputs do.
#include <cstddef>
#include <cstdint>
#include <random>

extern "C" size_t LLVMFuzzerMutate(uint8_t* data, size_t size, size_t most);

extern "C" size_t LLVMFuzzerCustomMutator(uint8_t* data, size_t size, size_t most, unsigned seed) {
  std::minstd_rand random(seed);
  random.discard(1);
  const auto below = [&](size_t count) { return random() / 7 % count; };
  const auto any = [&] { return static_cast<uint8_t>(random() >> 8); };
  const size_t way = below(8);
  if (way < 3 || size == 0) {
    const size_t length = 1 + below(most < 160 ? most : 160);
    for (size_t k = 0; k < length; ++k) data[k] = any();
    return length;
  }
  if (way < 6) {
    for (size_t more = 1 + below(4); more > 0; --more) data[below(size)] = any();
    return size;
  }
  return LLVMFuzzerMutate(data, size, most);
}
