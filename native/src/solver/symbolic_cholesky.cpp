// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/symbolic_cholesky.h"

#include <algorithm>
#include <queue>
#include <utility>

namespace dd {

namespace {

// Most domains, and so the most threads of a solve.
constexpr int kMostDomains = 8;
// Least mean cost() of a domain, in entries of the factor: smaller ones aren't worth a task.
constexpr double kLeastDomain = 20000;

/// Cost of a supernode in a solve, in entries of the factor: 30 to start it, 2 to fetch each row
/// below it, and its entries. Decides which supernodes are merged.
double cost(double width, double height) {
  return 30 + 2 * height + width * (0.5 * width + height);
}

/// The supernodes before they are put into their final order. Columns are numbered by the postorder
/// of the elimination tree. In flat arrays, as there are almost as many supernodes as columns.
struct Nodes {
  struct Node {
    int first, end;  // columns of its own
    int width;       // columns of all its members
    int64_t row_begin;
    int height;
    int parent = -1;
    int first_child = -1, last_child = -1, sibling = -1, previous_sibling = -1;
    // Linked list of its members: the supernodes merged into it, and at last itself.
    int first_member, next_member = -1;
    bool joined = false;  // merged into its parent
    double weight = 0;    // cost of its subtree
  };
  std::vector<Node> nodes;
  std::vector<int> rows;  // rows below each node, unsorted

  int count() const { return static_cast<int>(nodes.size()); }
  Node& operator[](int s) { return nodes[size_t(s)]; }
  double own_cost(int s) const { return cost(nodes[size_t(s)].width, nodes[size_t(s)].height); }

  template <class Body>
  void each_child(int s, const Body& body) const {
    for (int c = nodes[size_t(s)].first_child; c >= 0; c = nodes[size_t(c)].sibling) body(c);
  }
  void append_child(int s, int child) {
    Node& node = nodes[size_t(s)];
    nodes[size_t(child)].previous_sibling = node.last_child;
    nodes[size_t(child)].sibling = -1;
    nodes[size_t(child)].parent = s;
    (node.last_child < 0 ? node.first_child : nodes[size_t(node.last_child)].sibling) = child;
    node.last_child = child;
  }
  void remove_child(int s, int child) {
    const Node& gone = nodes[size_t(child)];
    (gone.previous_sibling < 0 ? nodes[size_t(s)].first_child
                               : nodes[size_t(gone.previous_sibling)].sibling) = gone.sibling;
    (gone.sibling < 0 ? nodes[size_t(s)].last_child
                      : nodes[size_t(gone.sibling)].previous_sibling) = gone.previous_sibling;
  }
  /// Merges a child into its parent s, which takes over its columns and its children.
  void join(int s, int child) {
    Node &node = nodes[size_t(s)], &joining = nodes[size_t(child)];
    joining.joined = true;
    joining.next_member = std::exchange(node.first_member, joining.first_member);
    node.width += joining.width;
    remove_child(s, child);
    for (int c = joining.first_child; c >= 0;) {
      const int next = nodes[size_t(c)].sibling;
      append_child(s, c);
      c = next;
    }
  }
};

/// Parent of each column in the elimination tree (Liu 1986).
std::vector<int> elimination_tree(const SparseMatrix& pattern, const std::vector<int>& order,
                                  const std::vector<int>& index_of) {
  const int n = static_cast<int>(order.size());
  std::vector<int> parent(order.size(), -1), ancestor(order.size(), -1);
  for (int k = 0; k < n; ++k) {
    for (SparseMatrix::InnerIterator it(pattern, order[k]); it; ++it) {
      for (int i = index_of[it.row()]; i != -1 && i < k;) {
        const int next = ancestor[i];
        ancestor[i] = k;
        if (next == -1) parent[i] = k;
        i = next;
      }
    }
  }
  return parent;
}

/// Postorder of a forest. parent: of each node, -1 for roots.
std::vector<int> postorder(const std::vector<int>& parent) {
  const int n = static_cast<int>(parent.size());
  std::vector<int> first_child(parent.size(), -1), sibling(parent.size(), -1);
  for (int v = n - 1; v >= 0; --v) {
    if (parent[v] < 0) continue;
    sibling[v] = first_child[parent[v]];
    first_child[parent[v]] = v;
  }
  std::vector<int> result, stack;
  result.reserve(parent.size());
  for (int root = 0; root < n; ++root) {
    if (parent[root] >= 0) continue;
    stack.push_back(root);
    while (!stack.empty()) {
      const int v = stack.back();
      const int child = first_child[v];
      if (child >= 0) {
        first_child[v] = sibling[child];
        stack.push_back(child);
      } else {
        result.push_back(v);
        stack.pop_back();
      }
    }
  }
  return result;
}

void invert(const std::vector<int>& order, std::vector<int>& index_of) {
  index_of.resize(order.size());
  for (size_t k = 0; k < order.size(); ++k) index_of[order[k]] = static_cast<int>(k);
}

/// The fundamental supernodes, runs of columns with the same rows below, and these rows, by
/// symbolic elimination column by column.
Nodes fundamental_supernodes(const SparseMatrix& pattern, const std::vector<int>& order,
                             const std::vector<int>& index_of, const std::vector<int>& parent) {
  const int n = static_cast<int>(order.size());
  std::vector<int> child_count(order.size(), 0), seen_by(order.size(), -1);
  // The children of the supernode that begins with column j: the supernodes whose last columns have
  // j as their parent in the elimination tree. Linked lists from the last child to the first.
  std::vector<int> last_child_at(order.size(), -1), previous_child;
  for (int j = 0; j < n; ++j)
    if (parent[j] >= 0) ++child_count[parent[j]];
  Nodes result;
  std::vector<int>& rows = result.rows;
  const auto continues_supernode = [&](int j) {
    if (j == 0 || parent[j - 1] != j || child_count[j] != 1) return false;
    const int last = result.count() - 1;
    for (SparseMatrix::InnerIterator it(pattern, order[j]); it; ++it) {
      const int i = index_of[it.row()];
      if (i > j && seen_by[i] != last) return false;
    }
    return true;
  };
  const auto finish = [&](int end) {
    Nodes::Node& node = result.nodes.back();
    node.end = end;
    node.width = end - node.first;
    rows.erase(std::remove_if(rows.begin() + node.row_begin, rows.end(),
                              [end](int row) { return row < end; }),
               rows.end());
    node.height = static_cast<int>(int64_t(rows.size()) - node.row_begin);
    previous_child.push_back(-1);
    if (parent[end - 1] >= 0)
      previous_child.back() = std::exchange(last_child_at[parent[end - 1]], result.count() - 1);
  };
  std::vector<int> children;
  for (int j = 0; j < n; ++j) {
    if (continues_supernode(j)) continue;
    if (j > 0) finish(j);
    const int s = result.count();
    result.nodes.emplace_back();
    Nodes::Node& node = result.nodes.back();
    node.first = j;
    node.first_member = s;
    node.row_begin = static_cast<int64_t>(rows.size());
    const auto add = [&](int i) {
      if (i <= j || seen_by[i] == s) return;
      seen_by[i] = s;
      rows.push_back(i);
    };
    children.clear();
    for (int c = last_child_at[j]; c >= 0; c = previous_child[c]) children.push_back(c);
    for (size_t i = children.size(); i-- > 0;) {
      const Nodes::Node& child = result[children[i]];
      for (int64_t k = child.row_begin; k < child.row_begin + child.height; ++k) add(rows[k]);
      result.append_child(s, children[i]);
    }
    for (SparseMatrix::InnerIterator it(pattern, order[j]); it; ++it) add(index_of[it.row()]);
  }
  if (n > 0) finish(n);
  return result;
}

/// Merges children into their parents if the explicit zeros cost no more than the merge saves.
void relax(Nodes& nodes) {
  std::vector<int> candidates;
  for (int s = 0; s < nodes.count(); ++s) {
    candidates.clear();
    nodes.each_child(s, [&](int c) { candidates.push_back(c); });
    // The children with the most rows below first: they share the most rows with the parent.
    std::stable_sort(candidates.begin(), candidates.end(),
                     [&](int a, int b) { return nodes[a].height > nodes[b].height; });
    for (int c : candidates) {
      const double joined = cost(nodes[c].width + nodes[s].width, nodes[s].height);
      if (joined <= nodes.own_cost(c) + nodes.own_cost(s)) nodes.join(s, c);
    }
  }
}

/// Distributes subtrees of the elimination tree to domains of about equal cost. Returns the roots
/// of each domain's subtrees, and marks the supernodes above them in in_top.
std::vector<std::vector<int>> find_domains(Nodes& nodes, std::vector<char>& in_top) {
  double total = 0;
  for (int s = 0; s < nodes.count(); ++s) {
    Nodes::Node& node = nodes[s];
    if (node.joined) continue;
    const double own = nodes.own_cost(s);
    node.weight += own;
    total += own;
    if (node.parent >= 0) nodes[node.parent].weight += node.weight;
  }
  const auto lighter = [&](int a, int b) {
    return nodes[a].weight != nodes[b].weight ? nodes[a].weight < nodes[b].weight : a < b;
  };
  std::priority_queue<int, std::vector<int>, decltype(lighter)> subtrees(lighter);
  for (int s = 0; s < nodes.count(); ++s)
    if (!nodes[s].joined && nodes[s].parent < 0) subtrees.push(s);
  const int wanted = std::clamp(static_cast<int>(total / kLeastDomain), 1, kMostDomains);
  in_top.assign(static_cast<size_t>(nodes.count()), 0);
  while (wanted > 1 && !subtrees.empty() && nodes[subtrees.top()].weight > 1.2 * total / wanted) {
    const int root = subtrees.top();
    if (nodes[root].first_child < 0) break;
    subtrees.pop();
    in_top[root] = 1;
    nodes.each_child(root, [&](int child) { subtrees.push(child); });
  }
  // Greedily: the heaviest subtree first, each to the domain with the least load.
  std::vector<std::vector<int>> domains(static_cast<size_t>(wanted));
  std::vector<double> load(domains.size(), 0);
  for (; !subtrees.empty(); subtrees.pop()) {
    const auto lightest = std::min_element(load.begin(), load.end());
    *lightest += nodes[subtrees.top()].weight;
    domains[static_cast<size_t>(lightest - load.begin())].push_back(subtrees.top());
  }
  return domains;
}

/// The order in which supernodes are eliminated: domain after domain, then the top. Appends the
/// start of each domain and of the top to domain_begin.
std::vector<int> final_sequence(Nodes& nodes, std::vector<int>& domain_begin) {
  std::vector<char> in_top;
  std::vector<int> sequence, stack;
  for (const std::vector<int>& roots : find_domains(nodes, in_top)) {
    domain_begin.push_back(static_cast<int>(sequence.size()));
    // Parents before children, then reversed.
    const size_t first = sequence.size();
    for (int root : roots) {
      stack.push_back(root);
      while (!stack.empty()) {
        const int s = stack.back();
        stack.pop_back();
        sequence.push_back(s);
        nodes.each_child(s, [&](int child) { stack.push_back(child); });
      }
    }
    std::reverse(sequence.begin() + static_cast<std::ptrdiff_t>(first), sequence.end());
  }
  domain_begin.push_back(static_cast<int>(sequence.size()));
  for (int s = 0; s < nodes.count(); ++s)
    if (in_top[s]) sequence.push_back(s);
  return sequence;
}

}  // namespace

SymbolicCholesky::SymbolicCholesky(const SparseMatrix& pattern, const std::vector<int>& first_order)
    : order(first_order) {
  invert(order, index_of);
  std::vector<int> tree = elimination_tree(pattern, order, index_of);
  {
    const std::vector<int> sequence = postorder(tree);
    std::vector<int> renumbered, index_in_sequence, renumbered_tree;
    invert(sequence, index_in_sequence);
    for (int k : sequence) {
      renumbered.push_back(order[k]);
      renumbered_tree.push_back(tree[k] < 0 ? -1 : index_in_sequence[tree[k]]);
    }
    order = std::move(renumbered);
    tree = std::move(renumbered_tree);
    invert(order, index_of);
  }
  Nodes nodes = fundamental_supernodes(pattern, order, index_of, tree);
  relax(nodes);
  const std::vector<int> sequence = final_sequence(nodes, domain_begin);

  std::vector<int> new_index(order.size()), new_number(size_t(nodes.count()), -1), new_order;
  new_order.reserve(order.size());
  begin.push_back(0);
  row_begin.push_back(0);
  for (size_t i = 0; i < sequence.size(); ++i) {
    new_number[sequence[i]] = static_cast<int>(i);
    const Nodes::Node& node = nodes[sequence[i]];
    for (int member = node.first_member;; member = nodes[member].next_member) {
      for (int column = nodes[member].first; column < nodes[member].end; ++column) {
        new_index[column] = static_cast<int>(new_order.size());
        new_order.push_back(order[column]);
      }
      if (member == sequence[i]) break;
    }
    begin.push_back(static_cast<int>(new_order.size()));
    row_begin.push_back(row_begin.back() + node.height);
  }
  rows.reserve(static_cast<size_t>(row_begin.back()));
  for (int s : sequence) {
    const Nodes::Node& node = nodes[s];
    const auto first = static_cast<std::ptrdiff_t>(rows.size());
    for (int64_t k = node.row_begin; k < node.row_begin + node.height; ++k)
      rows.push_back(new_index[nodes.rows[k]]);
    std::sort(rows.begin() + first, rows.end());
    parent.push_back(node.parent < 0 ? -1 : new_number[node.parent]);
  }
  order = std::move(new_order);
  invert(order, index_of);
  make_slots();
}

void SymbolicCholesky::make_slots() {
  slotted_rows = rows;
  std::vector<int> slot_of(order.size(), -1);
  for (int d = 0; d < domain_count(); ++d) {
    slot_begin.push_back(static_cast<int>(top_index_of_slot.size()));
    const int end = section_begin(d + 1);
    for (int64_t k = row_begin[domain_begin[d]]; k < row_begin[domain_begin[d + 1]]; ++k) {
      const int row = rows[k];
      if (row < end) continue;
      if (slot_of[row] < size() + slot_begin.back()) {
        slot_of[row] = slotted_size();
        top_index_of_slot.push_back(row);
      }
      slotted_rows[k] = slot_of[row];
    }
  }
  slot_begin.push_back(static_cast<int>(top_index_of_slot.size()));
}

}  // namespace dd
