// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/free_turns.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <queue>
#include <utility>

#include "mesh/topology.h"
#include "support/rotations.h"

namespace dd {

namespace {

// Clusters of the free surface, each with one rotation R_k: more approximate the full energy
// better, and make each step longer.
constexpr int kClusters = 64;
constexpr int kMostSteps = 60;  // limit on local-global steps
// kBeyond: over-relaxation factor of a global step. kSettled: convergence tolerance, the largest
// change of an entry of a linear part, which has no unit.
constexpr double kBeyond = 1.5, kSettled = 1e-5;
// Regularization, as a fraction of the stiffness matrix' largest diagonal entry: without it the
// matrix may be singular for a handle whose vertices lie in a plane, on a line or in one point.
constexpr double kStiffness = 1e-9;
// 135° between other handles, as for the linear base of MotionBlend: up to there the rotation found
// is taken, from 180° on the harmonically interpolated one, in between a mean.
constexpr double kFoundUntil = 0.75 * kPi;

/// The taken vertex closest to the mean of all taken ones, or -1 if none is taken.
int most_central(const Positions& positions, const std::vector<char>& taken) {
  Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
  for (size_t v = 0; v < taken.size(); ++v)
    if (taken[v]) middle += positions.row(Index(v));
  middle /= static_cast<double>(std::max<Index>(1, std::count(taken.begin(), taken.end(), 1)));
  int found = -1;
  double nearest = std::numeric_limits<double>::infinity();
  for (size_t v = 0; v < taken.size(); ++v) {
    const double distance = (positions.row(Index(v)) - middle).squaredNorm();
    if (!taken[v] || !(distance < nearest)) continue;
    nearest = distance;
    found = static_cast<int>(v);
  }
  return found;
}

/// Farthest-point clustering of the taken vertices by shortest paths along edges (Dijkstra). The
/// first centre is the most central vertex, so that the result doesn't depend on the vertex order.
/// Returns each vertex' cluster, -1 for vertices that aren't taken or that no centre reaches.
std::vector<int> parts_of(const SparseMatrix& laplacian, const Positions& positions,
                          const std::vector<char>& taken, int wanted) {
  const size_t n = taken.size();
  std::vector<double> distance(n, std::numeric_limits<double>::infinity());
  std::vector<int> part(n, -1);
  using Front = std::pair<double, int>;
  std::priority_queue<Front, std::vector<Front>, std::greater<Front>> front;
  for (int number = 0; number < wanted; ++number) {
    int centre = number == 0 ? most_central(positions, taken) : -1;
    for (size_t v = 0; v < n && number > 0; ++v)
      if (taken[v] && (centre < 0 || distance[v] > distance[centre])) centre = static_cast<int>(v);
    if (centre < 0 || distance[centre] == 0) break;
    front.emplace(0, centre);
    distance[centre] = 0;
    part[centre] = number;
    while (!front.empty()) {
      const auto [so_far, v] = front.top();
      front.pop();
      if (so_far > distance[v]) continue;
      for (SparseMatrix::InnerIterator it(laplacian, v); it; ++it) {
        const Index next = it.row();
        const double there = so_far + (positions.row(next) - positions.row(v)).norm();
        if (!taken[next] || !(there < distance[next])) continue;
        distance[next] = there;
        part[next] = number;
        front.emplace(there, static_cast<int>(next));
      }
    }
  }
  return part;
}

/// The rotation that best aligns two point sets about their means (least squares). The identity
/// added with a weight of 1e-6 selects the smallest rotation where collinear points leave one open.
Eigen::Matrix3d rotation_between(const Positions& from, const Positions& to) {
  const Positions a = from.rowwise() - from.colwise().mean();
  const Positions b = to.rowwise() - to.colwise().mean();
  Eigen::Matrix3d covariance = b.transpose() * a;
  covariance.diagonal().array() += 1e-6 * covariance.norm();
  return polar_rotation(covariance);
}

}  // namespace

/// For each free handle, interpolated from the other handles: its rotation, the same as a rotation
/// vector with whole turns, and its share in the result, in [0, 1].
struct FreeTurns::Spread {
  std::vector<Eigen::Matrix3d> rotations;
  std::vector<Eigen::Vector3d> turns;
  std::vector<double> shares;
};

FreeTurns::FreeTurns(const BoundSurface& bound, std::vector<char> free)
    : bound_(bound), free_(std::move(free)) {
  for (size_t h = 0; h < free_.size(); ++h)
    if (free_[h]) handles_.push_back(static_cast<int>(h));
  find_parts();
  int count = 0;
  const std::vector<int> cluster = cluster_triangles(count);
  gather(cluster, count);
  if (bound.outside_base()) return;

  // forces = D, the Dirichlet energy of the harmonic weights, h×h (the Schur complement of L). The
  // values of free handles with the least energy, given those of the others, have zero force: D_ff
  // x_f = −D_fo x_o.
  const RowOrder& order = bound.order();
  const int all = bound.region.handle_count, own = static_cast<int>(handles_.size());
  RowMatrix forces = RowMatrix::Zero(all, all);
  const auto each_neighbour = [&](const auto& use) {
    for (int v : bound.region.handle_vertices)
      for (SparseMatrix::InnerIterator it(bound.operators.laplacian, v); it; ++it)
        use(bound.region.role[v], static_cast<int>(it.row()), it.value());
  };
  each_neighbour([&](int handle, int neighbour, double value) {
    const int role = bound.region.role[neighbour];
    if (role >= 0) forces(handle, role) += value;
  });
  each_harmonic_weights(bound, [&](int first, int some, const Rows& values) {
    each_neighbour([&](int handle, int neighbour, double value) {
      const int row = order.row_of_vertex[neighbour];
      if (row < order.free_count)
        forces.row(handle).segment(first, some) += value * values.row(row).head(some);
    });
  });
  RowMatrix among(own, own), others(own, all);
  for (int i = 0; i < own; ++i) {
    others.row(i) = forces.row(handles_[i]);
    for (int k = 0; k < own; ++k) {
      among(i, k) = forces(handles_[i], handles_[k]);
      others(i, handles_[k]) = 0;
    }
  }
  // A handle that nothing connects to others has a zero row; the shift makes its weights zero.
  among.diagonal().array() += 1e-12 * (1e-12 + among.diagonal().cwiseAbs().maxCoeff());
  weights_ = -Eigen::LDLT<Eigen::MatrixXd>(among).solve(others);
}

void FreeTurns::find_parts() {
  const Region& region = bound_.region;
  const Components components(bound_.mesh.triangles, bound_.mesh.vertex_count());
  // A handle merges all components that contain vertices of it (union-find).
  std::vector<int> first(free_.size(), -1), joined(size_t(components.count));
  std::iota(joined.begin(), joined.end(), 0);
  const auto root = [&](int component) {
    while (joined[component] != component) component = joined[component];
    return component;
  };
  for (int v : region.handle_vertices) {
    int& component = first[region.role[v]];
    if (component < 0)
      component = components.of_vertex[v];
    else
      joined[root(components.of_vertex[v])] = root(component);
  }
  std::map<int, Part> parts;
  for (size_t h = 0, own = 0; h < free_.size(); ++h) {
    Part& part = parts[root(first[h])];
    if (free_[h])
      part.free.push_back(static_cast<int>(own++));
    else
      part.turning.push_back(static_cast<int>(h));
  }
  for (size_t v = 0; v < region.role.size(); ++v) {
    if (region.role[v] != kFixed) continue;
    const auto found = parts.find(root(components.of_vertex[v]));
    if (found != parts.end()) found->second.fixed = true;
  }
  for (auto& [number, part] : parts)
    if (!part.free.empty()) parts_.push_back(std::move(part));
}

std::vector<int> FreeTurns::cluster_triangles(int& count) const {
  const Mesh& mesh = bound_.mesh;
  const Triangles& t = bound_.operators.triangles;
  const Region& region = bound_.region;
  std::vector<int> own(free_.size(), -1);
  for (size_t i = 0; i < handles_.size(); ++i) own[handles_[i]] = static_cast<int>(i);
  std::vector<char> taken(size_t(mesh.vertex_count()), 0);
  for (int v = 0; v < mesh.vertex_count(); ++v) taken[v] = region.role[v] == kFree;
  std::vector<int> part;
  if (!bound_.outside_base())
    part = parts_of(bound_.operators.laplacian, mesh.positions, taken, kClusters);
  count = static_cast<int>(handles_.size());
  std::vector<int> cluster(size_t(mesh.triangle_count()), -1);
  for (int j = 0; j < mesh.triangle_count(); ++j) {
    int found = -1;
    for (int k = 0; k < 3; ++k) {
      const int v = t(j, k), role = region.role[v];
      if (role >= 0 && own[role] >= 0) {
        found = own[role];
        break;
      }
      if (found < 0 && !part.empty() && part[v] >= 0)
        found = static_cast<int>(handles_.size()) + part[v];
    }
    cluster[j] = found;
    count = std::max(count, found + 1);
  }
  return cluster;
}

void FreeTurns::gather(const std::vector<int>& cluster, int count) {
  const Mesh& mesh = bound_.mesh;
  const Triangles& t = bound_.operators.triangles;
  const Region& region = bound_.region;
  const RowOrder& order = bound_.order();
  const Positions flux = corner_divergence(bound_.operators.metric, bound_.base, t);
  std::vector<std::vector<int>> triangles(static_cast<size_t>(count));
  for (size_t j = 0; j < cluster.size(); ++j)
    if (cluster[j] >= 0) triangles[cluster[j]].push_back(static_cast<int>(j));

  const HandleCoordinates& coordinates = bound_.coordinates;
  const Index columns = coordinates.count();
  RowMatrix space;
  const RowMatrix& functions = bound_.extension.functions(space);
  at_rest_ = RowMatrix::Zero(3 * Index(count), 3);
  if (!bound_.outside_base()) pull_ = RowMatrix::Zero(3 * Index(count), columns);
  Positions sums = Positions::Zero(mesh.vertex_count(), 3);
  for (int k = 0; k < count; ++k) {
    std::vector<int> touched;
    for (int j : triangles[k])
      for (int c = 0; c < 3; ++c) {
        sums.row(t(j, c)) += flux.row(3 * Index(j) + c);
        touched.push_back(t(j, c));
      }
    std::sort(touched.begin(), touched.end());
    touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
    std::vector<Corner> corners;
    for (int v : touched) {
      const Eigen::Vector3d along = sums.row(v);
      const int row = order.row_of_vertex[v], role = region.role[v];
      at_rest_.middleRows<3>(3 * Index(k)) += along * bound_.base.row(v);
      if (k < static_cast<int>(handles_.size())) corners.push_back({row, along});
      sums.row(v).setZero();
      if (bound_.outside_base()) continue;
      if (row < order.free_count)
        pull_.middleRows<3>(3 * Index(k)) += along * functions.row(row);
      else if (role >= 0)
        pull_.block(3 * Index(k), coordinates.begin(role), 3, coordinates.count(role)) +=
            along * coordinates.at(mesh.positions.row(v), role);
    }
    if (k < static_cast<int>(handles_.size())) around_.push_back(std::move(corners));
  }
  if (bound_.outside_base()) return;

  // The rows of Wᵀ L W for free handles, accumulated over blocks of kBlock vertices: a dense
  // product a block, with little memory.
  constexpr int kBlock = 64;
  std::vector<Index> own, own_begin(free_.size(), -1);
  for (int h : handles_) {
    own_begin[size_t(h)] = Index(own.size());
    for (int k = 0; k < coordinates.count(h); ++k) own.push_back(coordinates.begin(h) + k);
  }
  RowMatrix own_space;
  if (Index(own.size()) < columns) own_space = functions(kAllIndices, own);
  const RowMatrix& own_functions = own_space.size() ? own_space : functions;
  energy_ = RowMatrix::Zero(Index(own.size()), columns);
  RowMatrix left(kBlock, energy_.rows()), right(kBlock, columns);
  int filled = 0;
  const auto flush = [&] {
    energy_.noalias() += left.topRows(filled).transpose() * right.topRows(filled);
    filled = 0;
  };
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const int own_row = order.row_of_vertex[v], own_role = region.role[v];
    if (own_role == kFixed) continue;
    left.row(filled).setZero();
    for (SparseMatrix::InnerIterator it(bound_.operators.laplacian, v); it; ++it) {
      const int row = order.row_of_vertex[it.row()], role = region.role[it.row()];
      if (row < order.free_count)
        left.row(filled) += it.value() * own_functions.row(row);
      else if (role >= 0 && own_begin[size_t(role)] >= 0)
        left.row(filled).segment(own_begin[size_t(role)], coordinates.count(role)) +=
            it.value() * coordinates.at(mesh.positions.row(it.row()), role);
    }
    if (own_row < order.free_count) {
      right.row(filled) = functions.row(own_row);
    } else {
      right.row(filled).setZero();
      right.row(filled).segment(coordinates.begin(own_role), coordinates.count(own_role)) =
          coordinates.at(mesh.positions.row(v), own_role);
    }
    if (++filled == kBlock) flush();
  }
  flush();
}

FreeTurns::Spread FreeTurns::spread(const std::vector<Affine>& motions, const Positions& pivots,
                                    const std::vector<double>& turns) const {
  const size_t own = handles_.size();
  Spread result{std::vector<Eigen::Matrix3d>(own, Eigen::Matrix3d::Identity()),
                std::vector<Eigen::Vector3d>(own, Eigen::Vector3d::Zero()),
                std::vector<double>(own, 0.0)};
  for (const Part& part : parts_) spread(part, motions, pivots, turns, result);
  return result;
}

void FreeTurns::spread(const Part& part, const std::vector<Affine>& motions,
                       const Positions& pivots, const std::vector<double>& turns,
                       Spread& result) const {
  if (part.turning.empty()) {
    if (part.fixed) return;
    Positions from(Index(part.free.size()), 3), to(from.rows(), 3);
    for (size_t i = 0; i < part.free.size(); ++i) {
      const int h = handles_[size_t(part.free[i])];
      const Eigen::Vector3d pivot = pivots.row(h);
      const Affine& motion = motions[size_t(h)];
      from.row(Index(i)) = pivot.transpose();
      to.row(Index(i)) = (motion.leftCols<3>() * pivot + motion.col(3)).transpose();
    }
    const Eigen::Matrix3d together = rotation_between(from, to);
    for (int i : part.free) result.rotations[size_t(i)] = together;
    return;
  }

  const auto said = [&](int h) -> Eigen::Vector3d {
    if (turns.empty()) return Eigen::Vector3d::Zero();
    return Eigen::Map<const Eigen::Vector3d>(turns.data() + 3 * size_t(h));
  };
  // Rotations are relative to the fixed vertices, or without these to the first handle that isn't
  // free.
  const int reference = part.turning[0];
  const Eigen::Vector3d first_turn = part.fixed ? Eigen::Vector3d::Zero() : said(reference);
  const Eigen::Matrix3d first =
      part.fixed ? Eigen::Matrix3d::Identity()
                 : rotation_or(motions[size_t(reference)].leftCols<3>(), first_turn);
  RowMatrix angles = RowMatrix::Zero(Index(free_.size()), 3);
  double farthest = 0;
  for (int h : part.turning) {
    const Eigen::Vector3d turn = first.transpose() * (said(h) - first_turn);
    const Eigen::Matrix3d R =
        rotation_or(first.transpose() * motions[size_t(h)].leftCols<3>(), turn);
    angles.row(h) = (turn + rotation_vector(rotation_by(-turn) * R)).transpose();
    if (part.fixed) farthest = std::max(farthest, angles.row(h).norm());
    for (int other : part.turning)
      if (other < h) farthest = std::max(farthest, (angles.row(h) - angles.row(other)).norm());
  }
  const double share = std::clamp((farthest - kFoundUntil) / (kPi - kFoundUntil), 0.0, 1.0);
  for (int i : part.free) {
    const Eigen::Vector3d turn = (weights_.row(i) * angles).transpose();
    result.rotations[size_t(i)] = first * rotation_by(turn);
    result.turns[size_t(i)] = first_turn + first * turn;
    result.shares[size_t(i)] = share;
  }
}

void FreeTurns::find(std::vector<Affine>& motions, const Positions& pivots,
                     std::vector<double>& turns) const {
  const Index own = Index(handles_.size()), all = Index(free_.size());
  const Index clusters = at_rest_.rows() / 3;
  const HandleCoordinates& coordinates = bound_.coordinates;
  const Spread start = spread(motions, pivots, turns);

  // C = [(A − I)ᵀ; A o − o]. For a free handle C = Tᵀ X + [0; pivot' − pivot], with the unknown X =
  // (A − I)ᵀ and T = [I, o − pivot]. T is zero for a handle of one point that is its pivot.
  struct Unknown {
    size_t place;                                                       // index into handles_
    Index begin;                                                        // first row in energy_
    Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, 4> T;  // in reduced coordinates
  };
  std::vector<Unknown> unknowns;
  RowMatrix given = RowMatrix::Zero(4 * all, 3);
  std::vector<Eigen::Vector3d> placed;
  Index energy_row = 0;
  for (Index h = 0; h < all; ++h) {
    const Eigen::Vector3d o = coordinates.centres().row(h), pivot = pivots.row(h);
    const auto A = motions[size_t(h)].leftCols<3>();
    auto block = given.middleRows<4>(4 * h);
    if (!free_[size_t(h)]) {
      block.topRows<3>() = A.transpose() - Eigen::Matrix3d::Identity();
      block.row(3) = (A * o + motions[size_t(h)].col(3) - o).transpose();
      continue;
    }
    placed.push_back(A * pivot + motions[size_t(h)].col(3));
    block.row(3) = (placed.back() - pivot).transpose();
    Eigen::Matrix<double, 3, 4> T;
    T << Eigen::Matrix3d::Identity(), o - pivot;
    const int handle = static_cast<int>(h);
    Unknown unknown{placed.size() - 1, energy_row, T * coordinates.reduction(handle).transpose()};
    if (!unknown.T.isZero()) unknowns.push_back(std::move(unknown));
    energy_row += coordinates.count(handle);
  }
  const RowMatrix told = coordinates.reduced(given);
  const RowMatrix from_given = energy_ * told;

  const Index count = Index(unknowns.size());
  RowMatrix X(3 * count, 3), pulled(3 * clusters, 3 * count), stiffness(3 * count, 3 * count);
  RowMatrix forces(3 * count, 3);
  for (Index i = 0; i < count; ++i) {
    const auto& [place, begin, T] = unknowns[size_t(i)];
    const Index width = T.cols();
    pulled.middleCols<3>(3 * i) =
        pull_.middleCols(coordinates.begin(handles_[place]), width) * T.transpose();
    for (Index k = 0; k < count; ++k) {
      const Unknown& other = unknowns[size_t(k)];
      stiffness.block<3, 3>(3 * i, 3 * k) =
          T *
          energy_.block(begin, coordinates.begin(handles_[other.place]), width, other.T.cols()) *
          other.T.transpose();
    }
    forces.middleRows<3>(3 * i) = T * from_given.middleRows(begin, width);
    X.middleRows<3>(3 * i) = start.rotations[place].transpose() - Eigen::Matrix3d::Identity();
  }
  if (count > 0) stiffness.diagonal().array() += kStiffness * stiffness.diagonal().maxCoeff();
  const Eigen::LDLT<Eigen::MatrixXd> factor{Eigen::MatrixXd(stiffness)};
  const RowMatrix covariances = at_rest_ + pull_ * told;

  RowMatrix rotations(3 * clusters, 3);  // R_kᵀ − I
  const auto turn_clusters = [&](Index wanted) {
    const RowMatrix now = covariances.topRows(3 * wanted) + pulled.topRows(3 * wanted) * X;
    for (Index k = 0; k < wanted; ++k)
      rotations.middleRows<3>(3 * k) =
          polar_rotation(now.middleRows<3>(3 * k).transpose()).transpose() -
          Eigen::Matrix3d::Identity();
  };
  for (int step = 0; step < kMostSteps && count > 0; ++step) {
    turn_clusters(clusters);
    const RowMatrix better = factor.solve(pulled.transpose() * rotations - forces);
    const RowMatrix change = better - X;
    X += kBeyond * change;
    if (change.cwiseAbs().maxCoeff() < kSettled) break;
  }
  turn_clusters(own);

  if (turns.empty()) turns.assign(3 * size_t(all), 0.0);
  for (Index i = 0; i < own; ++i) {
    const size_t h = size_t(handles_[size_t(i)]);
    const Eigen::Matrix3d found =
        (rotations.middleRows<3>(3 * i) + Eigen::Matrix3d::Identity()).transpose();
    const Eigen::Matrix3d& spread = start.rotations[size_t(i)];
    const Eigen::Matrix3d R = spread * rotation_by((1 - start.shares[size_t(i)]) *
                                                   rotation_vector(spread.transpose() * found));
    motions[h].leftCols<3>() = R;
    motions[h].col(3) = placed[size_t(i)] - R * pivots.row(Index(h)).transpose();
    Eigen::Map<Eigen::Vector3d>(turns.data() + 3 * h) =
        rotation_vector_near(Eigen::AngleAxisd(R), start.turns[size_t(i)]);
  }
}

void FreeTurns::follow(const Rows& base, std::vector<Affine>& motions,
                       const Positions& pivots) const {
  for (size_t i = 0; i < handles_.size(); ++i) {
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (const Corner& corner : around_[i])
      covariance += base.row(corner.row).head<3>().transpose() * corner.flux.transpose();
    Affine& motion = motions[size_t(handles_[i])];
    const Eigen::Vector3d pivot = pivots.row(handles_[i]);
    const Eigen::Vector3d place = motion.leftCols<3>() * pivot + motion.col(3);
    motion.leftCols<3>() = polar_rotation(covariance);
    motion.col(3) = place - motion.leftCols<3>() * pivot;
  }
}

double FreeTurns::bytes() const {
  size_t corners = 0;
  for (const auto& around : around_) corners += around.size();
  return static_cast<double>(weights_.size() + energy_.size() + pull_.size() + at_rest_.size()) *
             sizeof(double) +
         static_cast<double>(corners * sizeof(Corner));
}

}  // namespace dd
