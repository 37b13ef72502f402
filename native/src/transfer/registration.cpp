// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/registration.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>

#include "mesh/aabb_tree.h"
#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "support/rotations.h"
#include "support/similarity.h"
#include "support/thread_pool.h"
#include "surface/fourth_points.h"
#include "surface/gradients.h"
#include "systems/free_block.h"
#include "systems/operators.h"
#include "systems/tets.h"

namespace dd {

namespace {

constexpr double kAnchoring = 1e-9;  // keeps what nothing holds in its place
constexpr double kLongestWave = 1;   // of the box
constexpr double kShortestWave = 4;  // edges

/// Whether a point of a triangle lies on a border.
bool at_border(const Borders& borders, const PointOnTriangle& point) {
  for (int k = 0; k < 3; ++k)  // edge k is opposite to corner k + 2
    if (point.weights[(k + 2) % 3] < 1e-9 &&
        borders.half_edges[3 * static_cast<size_t>(point.triangle) + k])
      return true;
  return false;
}

Pairs checked_markers(Pairs markers, const Mesh& source, const Mesh& target) {
  std::sort(markers.begin(), markers.end());
  markers.erase(std::unique(markers.begin(), markers.end()), markers.end());
  const int count[2] = {source.vertex_count(), target.vertex_count()};
  for (size_t i = 0; i < markers.size(); ++i) {
    for (int side = 0; side < 2; ++side)
      if (markers[i][side] < 0 || markers[i][side] >= count[side])
        throw Error(Status::argument, "A marker names vertex " + std::to_string(markers[i][side]) +
                                          " of the " + (side == 0 ? "source" : "target") +
                                          ", which has " + std::to_string(count[side]) + ".");
    if (i > 0 && markers[i][0] == markers[i - 1][0])
      throw Error(Status::argument, "The markers contradict one another: vertex " +
                                        std::to_string(markers[i][0]) +
                                        " of the source is paired with the vertices " +
                                        std::to_string(markers[i - 1][1]) + " and " +
                                        std::to_string(markers[i][1]) + " of the target.");
  }
  if (markers.size() < 3)
    throw Error(Status::argument,
                "There are " + std::to_string(markers.size()) +
                    " markers: three pairs of vertices are needed at least, better ten.");
  return markers;
}

Similarity onto_markers(const Mesh& source, const Mesh& target, const Pairs& markers) {
  const Index count = static_cast<Index>(markers.size());
  Positions from(count, 3), to(count, 3);
  for (Index i = 0; i < count; ++i) {
    from.row(i) = source.positions.row(markers[size_t(i)][0]);
    to.row(i) = target.positions.row(markers[size_t(i)][1]);
  }
  for (const Positions* points : {&from, &to}) {
    const Positions arms = points->rowwise() - points->colwise().mean();
    // Squared and ascending. Eigen's SVD of a matrix of any size frees twice where memory ends.
    const Eigen::Matrix3d moments = arms.transpose() * arms;
    const Eigen::Vector3d spread =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments, Eigen::EigenvaluesOnly)
            .eigenvalues();
    if (!(spread[1] > 1e-6 * spread[2]))
      throw Error(Status::argument,
                  std::string("The markers of the ") + (points == &from ? "source" : "target") +
                      " lie on a line, which leaves a turn about it open: add one beside it.");
  }
  return fitted_similarity(from, to, Eigen::VectorXd::Ones(count));
}

/// The system over vertices and fourth points of the source, in a unit box.
class Registration {
 public:
  Registration(const Mesh& source, const Mesh& target, const Pairs& markers,
               const RegistrationOptions& options)
      : options_(options),
        pool_(options.threads),
        target_(target),
        tree_(target_),
        target_normals_(triangle_normals(target_.positions, target_.triangles)),
        target_borders_(target_.triangles, target_.vertex_count()),
        source_borders_(source.triangles, source.vertex_count()),
        now_(source) {
    const std::vector<int> usable = usable_triangles(source);
    tets_ = with_fourth_points(source, usable);
    unknowns_ = tets_.positions;
    find_region(source.vertex_count(), markers);
    build_energy(source, usable);
    edge_ = mean_edge_length(source.positions, source.triangles);
  }

  /// One stage: waves of this length and longer follow the target; 0: the markers alone pull.
  void run(double wave, const Progress& progress) {
    const double two_pi = 2 * kPi;
    const double pull =
        wave == 0 ? 0 : std::pow(edge_ * two_pi * two_pi / (wave * wave), 2) / (edge_ * edge_);
    factor(pull, progress);
    for (int round = 0; round < (wave == 0 ? 1 : options_.rounds); ++round) {
      report(progress, 0.5 + 0.5 * round / options_.rounds, "Fitting the source to the target");
      solve(pull, wave == 0 ? Positions() : goals());
    }
  }

  const Positions& positions() const { return now_.positions; }
  /// Mean length of the source's edges.
  double edge() const { return edge_; }

 private:
  static std::vector<int> usable_triangles(const Mesh& mesh) {
    std::vector<int> usable;
    const std::vector<int> thin =
        triangle_metric(mesh.positions, mesh.triangles).degenerate;  // ascending
    for (int j = 0; j < mesh.triangle_count(); ++j)
      if (!std::binary_search(thin.begin(), thin.end(), j)) usable.push_back(j);
    if (usable.empty()) throw Error(Status::mesh, "The source has no triangle with an area.");
    return usable;
  }

  /// Free: what has a usable triangle and no marker.
  void find_region(int vertex_count, const Pairs& markers) {
    std::vector<int> roles(static_cast<size_t>(tets_.vertex_count()), kFixed);
    for (Index k = 0; k < tets_.tets.size(); ++k) roles[tets_.tets.data()[k]] = kFree;
    for (const auto& [from, to] : markers) {
      roles[from] = kFixed;
      unknowns_.row(from) = target_.positions.row(to);
    }
    region_ = region_of(std::move(roles), 0);
    vertex_count_ = vertex_count;
  }

  void build_energy(const Mesh& source, const std::vector<int>& usable) {
    const Index m = static_cast<Index>(usable.size());
    std::vector<int> number(static_cast<size_t>(source.triangle_count()), -1);
    for (Index i = 0; i < m; ++i) number[usable[size_t(i)]] = static_cast<int>(i);
    std::vector<Eigen::Triplet<double>> entries;
    const auto add = [&](int a, int b, double value) {
      for (int c = 0; c < 3; ++c) entries.emplace_back(3 * a + c, 3 * b + c, value);
    };
    const Edges edges(source.triangles);
    for (int edge = 0; edge < edges.count(); ++edge) {
      const Edges::Range sides = edges.of(edge);
      for (const Edges::HalfEdge* side = sides.begin() + 1; side < sides.end(); ++side) {
        const int a = number[(side - 1)->triangle()], b = number[side->triangle()];
        if (a < 0 || b < 0) continue;
        for (int own : {a, b}) add(own, own, options_.smoothness);
        add(a, b, -options_.smoothness);
        add(b, a, -options_.smoothness);
      }
    }
    for (int i = 0; i < m; ++i) add(i, i, options_.identity);
    SparseMatrix weights(3 * m, 3 * m);
    weights.setFromTriplets(entries.begin(), entries.end());
    const SparseMatrix operator_ = deformation_operator(tets_);
    energy_ = operator_.transpose() * weights * operator_;
    // G̃ x = I for the rest: its energy is that of the identity alone, whose pull is this.
    to_identity_ = options_.identity * (operator_.transpose() * (operator_ * tets_.positions));
    block_ = free_block(energy_, region_);
  }

  void factor(double pull, const Progress& progress) {
    SparseMatrix block = block_;
    const double anchoring = kAnchoring / (edge_ * edge_);
    for (int r = 0; r < region_.free_count(); ++r)
      block.coeffRef(r, r) += anchoring + (region_.free[r] < vertex_count_ ? pull : 0);
    BlockOptions how;
    how.pool = &pool_;
    how.symbolic = symbolic_;
    how.progress = within(progress, 0, 0.5);
    how.stage = "Factoring the fit to the target";
    std::unique_ptr<Dissection> dissection;
    if (!symbolic_) {
      dissection =
          std::make_unique<Dissection>(free_dissection(block, region_, tets_.positions, &pool_));
      how.dissection = dissection.get();
    }
    factor_ = std::make_unique<SparseCholesky>(factor_free_block(block, region_, how));
    symbolic_ = factor_->shared_symbolic();
  }

  void solve(double pull, const Positions& wanted) {
    Positions held = unknowns_;
    for (int v : region_.free) held.row(v).setZero();
    const double anchoring = kAnchoring / (edge_ * edge_);
    RowMatrix right = to_identity_ - energy_ * held;
    for (int v : region_.free) right.row(v) += anchoring * unknowns_.row(v);
    if (pull > 0)
      for (Index v = 0; v < wanted.rows(); ++v) right.row(v) += pull * wanted.row(v);
    const RowMatrix solved = factor_->solve(free_rows(right, region_), &pool_);
    for (int r = 0; r < region_.free_count(); ++r) unknowns_.row(region_.free[r]) = solved.row(r);
    now_.positions = unknowns_.topRows(vertex_count_);
  }

  /// c_i of each vertex.
  Positions goals() {
    Positions result = now_.positions;
    const Positions normals = summed_normals(now_.positions, now_.triangles);
    pool_.parallel_for(vertex_count_, kLeastRange, [&](int64_t begin, int64_t end) {
      for (int64_t v = begin; v < end; ++v) {
        const PointOnTriangle found =
            tree_.nearest(now_.positions.row(v).transpose(), options_.reach,
                          [&](int j) { return target_normals_.row(j).dot(normals.row(v)) > 0; });
        if (found.triangle < 0) continue;
        if (at_border(target_borders_, found) && !source_borders_.vertices[size_t(v)]) continue;
        result.row(v) = found.place.transpose();
      }
    });
    return result;
  }

  const RegistrationOptions& options_;
  ThreadPool pool_;
  const Mesh& target_;
  AabbTree tree_;
  Positions target_normals_;
  Borders target_borders_, source_borders_;
  Mesh now_;
  TetMesh tets_;
  Positions unknowns_;
  int vertex_count_ = 0;
  double edge_ = 0;
  Region region_;
  SparseMatrix energy_, block_;
  RowMatrix to_identity_;
  std::shared_ptr<const SymbolicCholesky> symbolic_;
  std::unique_ptr<SparseCholesky> factor_;
};

}  // namespace

Positions register_onto(const Mesh& source, const Mesh& target, const Pairs& given,
                        const RegistrationOptions& options, const Progress& progress) {
  report(progress, 0.01, "Looking at the meshes");
  validate(source, "source");
  validate(target, "target");
  const Pairs markers = checked_markers(given, source, target);
  const Similarity onto = onto_markers(source, target, markers);
  const UnitBox box(target.positions);
  const Mesh unit = {box.into(target.positions), target.triangles};
  Mesh start = {source.positions, source.triangles};
  for (Index v = 0; v < start.positions.rows(); ++v)
    start.positions.row(v) =
        (onto(source.positions.row(v).transpose()).transpose() - box.centre) / box.scale;

  Registration registration(start, unit, markers, options);
  const double last = std::min(kLongestWave, kShortestWave * registration.edge());
  for (int stage = 0; stage <= options.stages; ++stage) {
    const double share = options.stages > 1 ? (stage - 1.0) / (options.stages - 1) : 1;
    const double wave = stage == 0 ? 0 : kLongestWave * std::pow(last / kLongestWave, share);
    const double step = 0.98 / (options.stages + 1);
    registration.run(wave, within(progress, 0.02 + step * stage, 0.02 + step * (stage + 1)));
  }
  report(progress, 1, "Done");
  return box.out_of(registration.positions());
}

Match match_triangles(const Mesh& registered, const Mesh& target, double reach, int threads,
                      const Progress& progress) {
  const double box = bounding_box_diagonal(target.positions);
  const Mesh* meshes[2] = {&registered, &target};
  Pairs pairs;
  Match match;
  match.confidence.assign(static_cast<size_t>(target.triangle_count()), 0.0f);
  ThreadPool pool(threads);
  for (const int from : {0, 1}) {
    report(progress, 0.5 * from, "Looking for corresponding triangles");
    const Mesh &mesh = *meshes[from], &other = *meshes[1 - from];
    const AabbTree tree(other);
    const Positions normals = triangle_normals(mesh.positions, mesh.triangles);
    const Positions others = triangle_normals(other.positions, other.triangles);
    std::vector<PointOnTriangle> found(static_cast<size_t>(mesh.triangle_count()));
    pool.parallel_for(mesh.triangle_count(), kLeastRange, [&](int64_t begin, int64_t end) {
      for (int64_t j = begin; j < end; ++j)
        found[size_t(j)] =
            tree.nearest(triangle_centre(mesh.positions, mesh.triangles, j), reach * box,
                         [&](int k) { return others.row(k).dot(normals.row(j)) > 0; });
    });
    for (int j = 0; j < mesh.triangle_count(); ++j) {
      const PointOnTriangle& point = found[size_t(j)];
      if (point.triangle < 0) continue;
      pairs.push_back(from == 0 ? std::array<int, 2>{j, point.triangle}
                                : std::array<int, 2>{point.triangle, j});
      if (from == 1) {
        // Half of it is left at two per cent of the box.
        const double distance = std::sqrt(point.squared_distance) / (0.02 * box);
        const double parallel = normals.row(j).dot(others.row(point.triangle));
        match.confidence[size_t(j)] =
            static_cast<float>(std::max(0.0, parallel) / (1 + distance * distance));
      }
    }
  }
  match.correspondence =
      triangle_correspondence(pairs, registered.triangle_count(), target.triangle_count());
  report(progress, 1, "Done");
  return match;
}

}  // namespace dd
