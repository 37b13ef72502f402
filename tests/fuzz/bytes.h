// SPDX-License-Identifier: GPL-3.0-or-later
// Decodes the fuzzer's bytes. A tame input gives only what a caller may give. In a wild one any
// choice and any number may be invalid.
#pragma once

#include <fuzzer/FuzzedDataProvider.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

namespace dd::fuzz {

class Bytes {
 public:
  Bytes(const uint8_t* data, size_t size) : data_(data, size), tame_(flag()) {}

  bool tame() const { return tame_; }
  bool flag() { return data_.ConsumeIntegral<uint8_t>() & 1; }
  /// 0 to count - 1; 0 where the bytes have come to an end.
  int below(int count) {
    return count <= 256 ? data_.ConsumeIntegral<uint8_t>() % count
                        : data_.ConsumeIntegral<uint16_t>() % count;
  }
  bool one_in(int count) { return below(count) == count - 1; }
  /// Whether to give something invalid: in a wild input now and then.
  bool odd(int one_in = 24) { return !tame_ && this->one_in(one_in); }
  unsigned seed() { return data_.ConsumeIntegral<uint16_t>(); }
  double between(double low, double high) {
    return low + (high - low) * data_.ConsumeIntegral<uint16_t>() / 65535.0;
  }

  /// A number that is none of 0 to count - 1.
  int32_t beyond(size_t count) {
    switch (below(5)) {
      case 0:
      case 1:
        return static_cast<int32_t>(count);
      case 2:
        return -1;
      case 3:
        return std::numeric_limits<int32_t>::min();
      default:
        return std::max(static_cast<int32_t>(count), data_.ConsumeIntegral<int32_t>());
    }
  }

  /// A value of an enum or a whole number, first to last; in a wild input now and then an invalid
  /// one.
  template <class Value>
  Value choice(Value first, Value last) {
    const int32_t least = first, most = last;
    const int32_t given = least + below(most - least + 1);
    if (!odd()) return static_cast<Value>(given);
    const bool less = least > 0 && flag();
    return static_cast<Value>(less ? least - 1 : beyond(static_cast<size_t>(most) + 1));
  }
  /// A value from 0 to last.
  template <class Value>
  Value choice(Value last) {
    return choice(Value{}, last);
  }

  /// A role that may be invalid, or of a handle that doesn't exist.
  int32_t role() {
    const int32_t one = one_in(2) ? beyond(3) : below(5);
    return one < 0 ? one - 2 * (one == -1) : one - 2;
  }

  /// A number of a range, now and then one of its ends; in a wild input now and then any number.
  double number(double low, double high) {
    if (odd()) return any();
    constexpr double kEnd = 1.0 / 16;
    const double share = between(-kEnd, 1 + kEnd);
    return share <= 0 ? low : share >= 1 ? high : low + (high - low) * share;
  }

  /// A number that arithmetic breaks on, or one of any bits.
  double any() {
    using limits = std::numeric_limits<double>;
    static const double kKnown[] = {0.0,
                                    -0.0,
                                    -1,
                                    1e-9,
                                    1e9,
                                    1e19,
                                    1e-30,
                                    1e30,
                                    -1e38,
                                    1e150,
                                    limits::infinity(),
                                    -limits::infinity(),
                                    limits::quiet_NaN(),
                                    limits::denorm_min(),
                                    limits::min(),
                                    limits::max(),
                                    limits::lowest()};
    constexpr int kCount = sizeof kKnown / sizeof *kKnown;
    const int which = below(kCount + 3);
    if (which < kCount) return kKnown[which];
    const auto bits = data_.ConsumeIntegral<uint64_t>();
    double value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }

  /// 0 to count - 1, read from the other end of the bytes, so that all other choices keep theirs:
  /// for the layout of points.
  int aside(int count) {
    uint8_t byte = 0;
    data_.ConsumeData(&byte, 1);
    return byte % count;
  }

  /// Bytes from one point to the next: three floats, now and then more, and in a wild input now and
  /// then a stride that points can't have.
  size_t stride() {
    const int kind = aside(48);
    if (kind < 32) return 3 * sizeof(float);
    if (kind < 46 || tame_) return size_t(kind - 28) * sizeof(float);
    if (kind == 46) return 4096;
    constexpr size_t kHalf = std::numeric_limits<size_t>::max() / 2 + 1;
    switch (aside(5)) {
      case 0:
        return size_t(aside(12));  // points would overlap
      case 1:
        return size_t(13 + aside(3));  // they would lie between floats
      case 2:
        return size_t(14 + 4 * aside(200));
      case 3:
        return std::numeric_limits<size_t>::max();
      default:
        return kHalf >> aside(16);  // no memory is as large
    }
  }

  /// The count of an array; in a wild input now and then a wrong one.
  size_t count(size_t given) {
    if (!odd(64)) return given;
    switch (below(4)) {
      case 0:
        return 0;
      case 1:
        return given - (given > 0);
      // A call that doesn't check a count that is one too large reads beyond the end.
      case 2:
        return given + 1;
      default:
        return std::numeric_limits<size_t>::max() >> below(40);
    }
  }

  /// A pointer; in a wild input now and then null.
  template <class Value>
  Value* pointer(Value* given) {
    return odd(96) ? nullptr : given;
  }

 private:
  FuzzedDataProvider data_;
  bool tame_;
};

}  // namespace dd::fuzz
