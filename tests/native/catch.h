// SPDX-License-Identifier: GPL-3.0-or-later
// Catch2 2.13 (Debian 12) and 3.x differ in headers and in two names.
#pragma once

#include <string>

#ifdef __clang__
// TEMPLATE_TEST_CASE leaves out the argument of a variadic macro.
#pragma clang diagnostic ignored "-Wc++20-extensions"
#endif

#ifdef DD_CATCH2_3
#include <catch2/catch_all.hpp>
using Catch::Approx;
inline auto contains(const std::string& part) { return Catch::Matchers::ContainsSubstring(part); }
#else
#include <catch2/catch.hpp>
inline auto contains(const std::string& part) { return Catch::Matchers::Contains(part); }
#endif
