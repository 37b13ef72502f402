// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/rim_clamps.h"

#include "reconstruction/coarse/coarse_clamps.h"
#include "systems/clamped_poisson.h"

namespace dd {

namespace {

class OwnClamps : public RimClamps {
 public:
  OwnClamps(const FactoredSurface& surface, double length)
      : poisson_(*surface.poisson),
        clamped_(surface.mesh, surface.region, surface.operators, poisson_, *surface.dissection,
                 length) {}

  void solve(const FluxSource& source, double weight, Rows& offsets) override {
    const auto add = [&](int section, double* rows) { source.add(section, rows); };
    if (weight == 1) {
      clamped_.solve(source.at_rest(), add, offsets);
      return;
    }
    poisson_.solve(source.at_rest(), add, offsets);
    if (weight == 0) return;
    const Rows creased = offsets;
    step(source, offsets);
    offsets = creased + weight * (offsets - creased);
  }
  void step(const FluxSource& source, Rows& offsets) override {
    clamped_.step(
        source.at_rest(), [&](int section, double* rows) { source.add(section, rows); }, offsets);
  }
  double length() const override { return clamped_.length(); }
  double bytes() const override { return clamped_.bytes(); }

 private:
  PoissonSystem& poisson_;
  ClampedPoisson clamped_;
};

}  // namespace

std::unique_ptr<RimClamps> make_rim_clamps(FactoredSurface& surface, double length) {
  if (surface.large)
    if (std::unique_ptr<RimClamps> coarse = CoarseClamps::make(surface, length)) return coarse;
  return std::make_unique<OwnClamps>(surface, length);
}

}  // namespace dd
