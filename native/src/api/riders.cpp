// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: loose parts that ride on a surface.
#include <memory>
#include <vector>

#include "api/arguments.h"
#include "api/defaults.h"
#include "deform/riding_parts.h"

using namespace dd::api;

struct dd_riders {
  template <class... Arguments>
  explicit dd_riders(const Arguments&... arguments) : parts(arguments...) {}
  dd::RidingParts parts;
  std::atomic<bool> busy{false};
};

extern "C" {

dd_status dd_riders_make(const dd_mesh* mesh, const dd_riders_options* options, dd_riders** made) {
  return guarded([&] {
    require(made, "made is null");
    const dd_riders_options how = read_struct(options, riders_defaults());
    require(how.sizes || how.group_count == 0, "options.sizes is null");
    require(how.group_count < kMostElements, "there are more groups than can be numbered");
    const std::vector<double> sizes(how.sizes, how.sizes + how.group_count);
    *made = std::make_unique<dd_riders>(
                read_mesh("mesh", mesh), read_pairs("options.riders", how.riders, how.rider_count),
                read_pairs("options.contacts", how.contacts, how.contact_count), sizes,
                threads(how.threads))
                .release();
  });
}

dd_status dd_riders_place(dd_riders* riders, const dd_points* offsets, const dd_points_out* out) {
  return guarded([&] {
    require(riders, "riders is null");
    const InUse in_use(riders->busy, "dd_riders");
    const size_t n = count_of(riders->parts.vertex_count());
    const Strided<const FloatRows> given =
        strided<const FloatRows>("offsets", offsets, n, "vertices");
    Strided<FloatRows> placed = result_points("out", out, n);
    riders->parts.place(given, placed);
  });
}

void dd_riders_free(dd_riders* riders) { delete riders; }

}  // extern "C"
