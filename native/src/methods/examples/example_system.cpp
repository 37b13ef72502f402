// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/example_system.h"

#include <algorithm>
#include <map>
#include <utility>

#include "mesh/topology.h"

namespace dd {

template <class Real>
ExampleSystem<Real>::ExampleSystem(const ExampleSurface& of, std::vector<HandleHold> hold)
    : surface_(of.surface), hold_(std::move(hold)), poisson_(of.surface.poisson.get()) {
  const auto is_whole = [](HandleHold h) { return h == HandleHold::whole; };
  const bool shared = std::all_of(hold_.begin(), hold_.end(), is_whole);
  if (!shared) {
    std::vector<int> number(hold_.size(), kFree);
    int count = 0;
    for (size_t h = 0; h < hold_.size(); ++h)
      if (is_whole(hold_[h])) number[h] = count++;
    std::vector<int> roles = surface_.region.role;
    for (int& role : roles)
      if (role >= 0) role = number[role];
    region_ = split_region(surface_.mesh, roles, count, MovedBy::base);
    SparseMatrix block = free_block(surface_.operators.laplacian, region_);
    const Dissection dissection =
        free_dissection(block, region_, surface_.mesh.positions, &surface_.poisson->pool());
    BlockOptions options;
    options.dissection = &dissection;
    options.pool = &surface_.poisson->pool();
    options.precision = surface_.poisson->precision();
    own_ = std::make_unique<PoissonSystem>(surface_.mesh, region_, surface_.operators,
                                           std::move(block), options);
    poisson_ = own_.get();
  }
  const RowOrder& order = poisson_->order();
  pass_ = std::make_unique<ExamplePass<Real>>(of, *poisson_);
  nothing_ = Rows::Zero(poisson_->right_hand_side_rows(), 4);
  offsets_ = Rows::Zero(order.count(), 4);
  for (int v : surface_.region.handle_vertices) told_rows_.push_back(order.row_of_vertex[v]);
  told_ = at_rest_ = Rows::Zero(static_cast<Index>(told_rows_.size()), 4);
  make_means();
  places_ = std::make_unique<ExamplePlaces>(of, shared ? surface_.region : region_, order);
}

template <class Real>
void ExampleSystem<Real>::make_means() {
  const RowOrder& order = poisson_->order();
  std::vector<int> number(hold_.size(), -1);
  int count = 0;
  for (size_t h = 0; h < hold_.size(); ++h)
    if (hold_[h] == HandleHold::mean) number[h] = count++;
  if (count == 0) return;
  placed_.resize(static_cast<size_t>(count));
  std::vector<int> placed_by(static_cast<size_t>(order.count()), -1);
  for (size_t i = 0; i < told_rows_.size(); ++i) {
    const int h = number[surface_.region.role[surface_.region.handle_vertices[i]]];
    if (h < 0 || told_rows_[i] >= order.free_count) continue;  // a vertex without a triangle
    placed_[h].rows.push_back(told_rows_[i]);
    placed_[h].told.push_back(static_cast<int>(i));
    placed_by[told_rows_[i]] = h;
  }

  // A component that only means hold is floating: L is singular there. Its translation is a further
  // unknown, with the equation that the forces on it sum to zero.
  const Components parts(surface_.mesh.triangles, surface_.mesh.vertex_count());
  std::map<int, int> floating;
  for (int v : region_.grounds)
    for (const Placed& placed : placed_)
      for (int row : placed.rows)
        if (parts.of_vertex[order.vertex_of_row[row]] == parts.of_vertex[v])
          floating.emplace(parts.of_vertex[v], count + static_cast<int>(floating.size()));
  const Index unknowns = count + Index(floating.size());
  responses_ = RowMatrix::Zero(order.free_count, unknowns);
  for (int row = 0; row < order.free_count; ++row) {
    const auto found = floating.find(parts.of_vertex[order.vertex_of_row[row]]);
    if (found != floating.end()) responses_(row, found->second) = 1;
  }

  // Each vertex' force is added once, by the first section with an active triangle at the vertex.
  struct Push {
    int target, handle;
  };
  std::vector<std::vector<Push>> pushes(static_cast<size_t>(poisson_->active().sections()));
  std::vector<char> done(placed_by.size(), 0);
  const Triangles& t = surface_.operators.triangles;
  const ActiveTriangles& active = poisson_->active();
  for (int section = 0; section < active.sections(); ++section)
    for (int i = active.begin[section]; i < active.begin[section + 1]; ++i)
      for (int k = 0; k < 3; ++k) {
        const int v = t(active.triangles[i], k), row = order.row_of_vertex[v];
        if (placed_by[row] < 0 || done[row]) continue;
        done[row] = 1;
        pushes[section].push_back({poisson_->target(section, v), placed_by[row]});
      }
  for (int first = 0; first < count; first += 3) {
    Rows response = Rows::Zero(order.count(), 4);
    poisson_->solve(
        nothing_,
        [&](int section, double* rows) {
          for (const Push& push : pushes[section])
            if (push.handle >= first && push.handle < first + 3)
              rows[4 * Index(push.target) + push.handle - first] +=
                  1.0 / static_cast<double>(placed_[push.handle].rows.size());
        },
        response);
    const int columns = std::min(3, count - first);
    responses_.middleCols(first, columns) = response.topLeftCorner(order.free_count, columns);
  }

  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(unknowns, unknowns);
  for (int h = 0; h < count; ++h) {
    for (int row : placed_[h].rows)
      system.row(h) += responses_.row(row) / static_cast<double>(placed_[h].rows.size());
    system.col(h).tail(unknowns - count) = system.row(h).tail(unknowns - count).transpose();
  }
  means_.compute(system);
}

template <class Real>
void ExampleSystem<Real>::place_means(const Rows& told) {
  Eigen::MatrixXd missing = Eigen::MatrixXd::Zero(responses_.cols(), 3);
  for (size_t h = 0; h < placed_.size(); ++h)
    for (size_t i = 0; i < placed_[h].rows.size(); ++i)
      missing.row(Index(h)) +=
          (told.row(placed_[h].told[i]) - offsets_.row(placed_[h].rows[i])).template head<3>() /
          static_cast<double>(placed_[h].rows.size());
  const RowMatrix forces = means_.solve(missing);
  offsets_.topLeftCorner(responses_.rows(), 3).noalias() += responses_ * forces;
}

template <class Real>
void ExampleSystem<Real>::take_handles(const Rows& offsets) {
  const RowOrder& order = surface_.order();
  told_ = offsets.middleRows(order.free_count, order.fixed_begin - order.free_count);
}

template <class Real>
Rows ExampleSystem<Real>::forces() const {
  const Rows all = pass_->misfit_divergence(poisson_->order().count());
  Rows result(told_.rows(), 4);
  for (size_t i = 0; i < told_rows_.size(); ++i) result.row(Index(i)) = all.row(told_rows_[i]);
  return result;
}

template <class Real>
void ExampleSystem<Real>::give(const Eigen::VectorXd& weights, Rows& offsets) {
  places_->place(weights, offsets_);
  // ExamplePlaces moved the floating components, so their means are prescribed once more.
  if (!placed_.empty()) place_means(told_);
  const RowOrder& order = surface_.order();
  for (int r = 0; r < order.fixed_begin; ++r)
    offsets.row(r) = offsets_.row(poisson_->order().row_of_vertex[order.vertex_of_row[r]]);
}

template <class Real>
double ExampleSystem<Real>::bytes() const {
  return pass_->bytes() + (own_ ? own_->bytes() : 0) +
         static_cast<double>(2 * told_.size() + offsets_.size() + nothing_.size() +
                             responses_.size()) *
             sizeof(double);
}

template class ExampleSystem<float>;
template class ExampleSystem<double>;

}  // namespace dd
