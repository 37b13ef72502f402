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
    std::vector<int> index(hold_.size(), kFree);
    int count = 0;
    for (size_t h = 0; h < hold_.size(); ++h)
      if (is_whole(hold_[h])) index[h] = count++;
    std::vector<int> roles = surface_.region.role;
    for (int& role : roles)
      if (role >= 0) role = index[role];
    region_ = make_region(surface_.mesh, roles, count, MovedBy::base);
    SparseMatrix block = free_block(surface_.operators.laplacian, region_);
    const Dissection dissection =
        free_dissection(block, region_, surface_.mesh.positions, &surface_.poisson->pool());
    BlockOptions options;
    options.dissection = &dissection;
    options.pool = &surface_.poisson->pool();
    options.precision = surface_.poisson->precision();
    own_poisson_ = std::make_unique<PoissonSystem>(surface_.mesh, region_, surface_.operators,
                                                   std::move(block), options);
    poisson_ = own_poisson_.get();
  }
  const RowOrder& order = poisson_->order();
  pass_ = std::make_unique<ExamplePass<Real>>(of, *poisson_);
  zero_divergence_ = Rows::Zero(poisson_->right_hand_side_rows(), 4);
  offsets_ = Rows::Zero(order.count(), 4);
  for (int v : surface_.region.handle_vertices) prescribed_rows_.push_back(order.row_of_vertex[v]);
  prescribed_ = at_rest_ = Rows::Zero(static_cast<Index>(prescribed_rows_.size()), 4);
  factor_mean_constraints();
  places_ = std::make_unique<ExamplePlaces>(of, shared ? surface_.region : region_, order);
}

template <class Real>
void ExampleSystem<Real>::find_mean_handles() {
  std::vector<int> index(hold_.size(), -1);
  int count = 0;
  for (size_t h = 0; h < hold_.size(); ++h)
    if (hold_[h] == HandleHold::mean) index[h] = count++;
  mean_handles_.resize(static_cast<size_t>(count));
  for (size_t i = 0; i < prescribed_rows_.size(); ++i) {
    const int h = index[surface_.region.role[surface_.region.handle_vertices[i]]];
    if (h < 0 || prescribed_rows_[i] >= poisson_->order().free_count)
      continue;  // a vertex without a triangle
    mean_handles_[h].rows.push_back(prescribed_rows_[i]);
    mean_handles_[h].prescribed.push_back(static_cast<int>(i));
  }
}

template <class Real>
void ExampleSystem<Real>::find_floating_components() {
  const RowOrder& order = poisson_->order();
  const int count = static_cast<int>(mean_handles_.size());
  const Components parts(surface_.mesh.triangles, surface_.mesh.vertex_count());
  std::map<int, int> floating;
  for (int v : region_.grounds)
    for (const MeanHandle& mean_handle : mean_handles_)
      for (int row : mean_handle.rows)
        if (parts.of_vertex[order.vertex_of_row[row]] == parts.of_vertex[v])
          floating.emplace(parts.of_vertex[v], count + static_cast<int>(floating.size()));
  constraint_responses_ = RowMatrix::Zero(order.free_count, count + Index(floating.size()));
  for (int row = 0; row < order.free_count; ++row) {
    const auto found = floating.find(parts.of_vertex[order.vertex_of_row[row]]);
    if (found != floating.end()) constraint_responses_(row, found->second) = 1;
  }
}

template <class Real>
std::vector<std::vector<typename ExampleSystem<Real>::HandleForce>>
ExampleSystem<Real>::handle_forces() const {
  const RowOrder& order = poisson_->order();
  std::vector<int> mean_handle_of_row(static_cast<size_t>(order.count()), -1);
  for (size_t h = 0; h < mean_handles_.size(); ++h)
    for (int row : mean_handles_[h].rows) mean_handle_of_row[row] = static_cast<int>(h);
  const Triangles& t = surface_.operators.triangles;
  const ActiveTriangles& active = poisson_->active();
  std::vector<std::vector<HandleForce>> forces(static_cast<size_t>(active.sections()));
  std::vector<char> done(mean_handle_of_row.size(), 0);
  for (int section = 0; section < active.sections(); ++section)
    for (int i = active.begin[section]; i < active.begin[section + 1]; ++i)
      for (int k = 0; k < 3; ++k) {
        const int v = t(active.triangles[i], k), row = order.row_of_vertex[v];
        if (mean_handle_of_row[row] < 0 || done[row]) continue;
        done[row] = 1;
        forces[section].push_back(
            {poisson_->right_hand_side_row(section, v), mean_handle_of_row[row]});
      }
  return forces;
}

template <class Real>
void ExampleSystem<Real>::solve_for_responses() {
  const RowOrder& order = poisson_->order();
  const int count = static_cast<int>(mean_handles_.size());
  const std::vector<std::vector<HandleForce>> forces = handle_forces();
  for (int first = 0; first < count; first += 3) {
    Rows response = Rows::Zero(order.count(), 4);
    poisson_->solve(
        zero_divergence_,
        [&](int section, double* rows) {
          for (const HandleForce& force : forces[section])
            if (force.handle >= first && force.handle < first + 3)
              rows[4 * Index(force.target) + force.handle - first] +=
                  1.0 / static_cast<double>(mean_handles_[force.handle].rows.size());
        },
        response);
    const int columns = std::min(3, count - first);
    constraint_responses_.middleCols(first, columns) =
        response.topLeftCorner(order.free_count, columns);
  }
}

template <class Real>
void ExampleSystem<Real>::factor_mean_constraints() {
  find_mean_handles();
  if (mean_handles_.empty()) return;
  find_floating_components();
  solve_for_responses();
  const Index count = Index(mean_handles_.size()), unknowns = constraint_responses_.cols();
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(unknowns, unknowns);
  for (Index h = 0; h < count; ++h) {
    const std::vector<int>& own_rows = mean_handles_[size_t(h)].rows;
    for (int row : own_rows)
      system.row(h) += constraint_responses_.row(row) / static_cast<double>(own_rows.size());
    system.col(h).tail(unknowns - count) = system.row(h).tail(unknowns - count).transpose();
  }
  mean_constraints_.compute(system);
}

template <class Real>
void ExampleSystem<Real>::enforce_means(const Rows& prescribed) {
  Eigen::MatrixXd missing = Eigen::MatrixXd::Zero(constraint_responses_.cols(), 3);
  for (size_t h = 0; h < mean_handles_.size(); ++h)
    for (size_t i = 0; i < mean_handles_[h].rows.size(); ++i)
      missing.row(Index(h)) +=
          (prescribed.row(mean_handles_[h].prescribed[i]) - offsets_.row(mean_handles_[h].rows[i]))
              .template head<3>() /
          static_cast<double>(mean_handles_[h].rows.size());
  const RowMatrix forces = mean_constraints_.solve(missing);
  offsets_.topLeftCorner(constraint_responses_.rows(), 3).noalias() +=
      constraint_responses_ * forces;
}

template <class Real>
void ExampleSystem<Real>::prescribe_handles(const Rows& offsets) {
  const RowOrder& order = surface_.order();
  prescribed_ = offsets.middleRows(order.free_count, order.fixed_begin - order.free_count);
}

template <class Real>
Rows ExampleSystem<Real>::forces() const {
  const Rows all = pass_->misfit_divergence(poisson_->order().count());
  Rows result(prescribed_.rows(), 4);
  for (size_t i = 0; i < prescribed_rows_.size(); ++i)
    result.row(Index(i)) = all.row(prescribed_rows_[i]);
  return result;
}

template <class Real>
void ExampleSystem<Real>::write_pose(const Eigen::VectorXd& weights, Rows& offsets) {
  places_->place(weights, offsets_);
  // ExamplePlaces moved the floating components, so their means are prescribed once more.
  if (!mean_handles_.empty()) enforce_means(prescribed_);
  const RowOrder& order = surface_.order();
  for (int r = 0; r < order.fixed_begin; ++r)
    offsets.row(r) = offsets_.row(poisson_->order().row_of_vertex[order.vertex_of_row[r]]);
}

template <class Real>
double ExampleSystem<Real>::bytes() const {
  return pass_->bytes() + (own_poisson_ ? own_poisson_->bytes() : 0) +
         static_cast<double>(2 * prescribed_.size() + offsets_.size() + zero_divergence_.size() +
                             constraint_responses_.size()) *
             sizeof(double);
}

template class ExampleSystem<float>;
template class ExampleSystem<double>;

}  // namespace dd
