// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/part_sums.h"

#include <cmath>
#include <memory>
#include <vector>

#include "catch.h"

using namespace dd;

TEST_CASE("sums over parts have each item once, whatever the sizes and threads", "[threads]") {
  struct Sum {
    double value = 0;
    size_t count = 0;
    void operator+=(const Sum& other) {
      value += other.value;
      count += other.count;
    }
  };
  const auto value = [](size_t part, size_t i) { return std::sin(double(7 * part + i)); };
  const auto add = [&](Sum& sum, size_t part, size_t i) {
    sum.value += value(part, i);
    ++sum.count;
  };
  std::vector<size_t> many(3000, 2);
  many[17] = 40000;
  many[2000] = 0;
  for (const std::vector<size_t>& sizes :
       {std::vector<size_t>{}, {0}, {1}, {5000, 0, 512, 513, 2}, many}) {
    const PartSums sums(sizes);
    ThreadPool one(1), four(4);
    const std::vector<Sum> found = sums.of<Sum>(one, add), by_four = sums.of<Sum>(four, add);
    REQUIRE(found.size() == sizes.size());
    for (size_t part = 0; part < sizes.size(); ++part) {
      double expected = 0;
      for (size_t i = 0; i < sizes[part]; ++i) expected += value(part, i);
      CHECK(found[part].count == sizes[part]);
      CHECK(std::abs(found[part].value - expected) < 1e-9);
      CHECK(by_four[part].value == found[part].value);
    }
  }
  CHECK(PartSums().of<Sum>(*std::make_unique<ThreadPool>(2), add).empty());
}
