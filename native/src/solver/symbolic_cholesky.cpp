// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/symbolic_cholesky.h"

#include <algorithm>
#include <queue>

namespace dd {

namespace {

constexpr int kMostDomains = 8;
constexpr double kLeastDomain = 20000;  // entries of the factor

/// What a supernode costs in a solve, in entries of the factor: what starting one and fetching a
/// row costs decides which are joined.
double cost(double width, double height) {
  return 30 + 2 * height + width * (0.5 * width + height);
}

/// A supernode on its way to its final place.
struct Node {
  std::vector<int> columns, rows;  // in the postorder of the first tree, rows as they come
  std::vector<int> children;
  int parent = -1;
  bool joined = false;  // part of its parent
  double weight = 0;    // cost of its subtree
};

/// Parent of each column in the elimination tree (Liu 1986).
std::vector<int> elimination_tree(const SparseMatrix& pattern, const std::vector<int>& order,
                                  const std::vector<int>& place_of) {
  const int n = static_cast<int>(order.size());
  std::vector<int> parent(order.size(), -1), ancestor(order.size(), -1);
  for (int k = 0; k < n; ++k) {
    for (SparseMatrix::InnerIterator it(pattern, order[k]); it; ++it) {
      for (int i = place_of[it.row()]; i != -1 && i < k;) {
        const int next = ancestor[i];
        ancestor[i] = k;
        if (next == -1) parent[i] = k;
        i = next;
      }
    }
  }
  return parent;
}

/// Children before parents, subtree after subtree. parent: of each node or -1.
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

void invert(const std::vector<int>& order, std::vector<int>& place_of) {
  place_of.resize(order.size());
  for (size_t k = 0; k < order.size(); ++k) place_of[order[k]] = static_cast<int>(k);
}

/// Columns with the same rows below, each set with its rows, found column by column.
std::vector<Node> fundamental_supernodes(const SparseMatrix& pattern, const std::vector<int>& order,
                                         const std::vector<int>& place_of,
                                         const std::vector<int>& parent) {
  const int n = static_cast<int>(order.size());
  std::vector<int> child_count(order.size(), 0), node_of(order.size(), -1),
      seen_by(order.size(), -1);
  for (int j = 0; j < n; ++j)
    if (parent[j] >= 0) ++child_count[parent[j]];
  std::vector<std::vector<int>> pending(order.size());  // supernodes that hang on a column
  std::vector<Node> nodes;
  const auto joins = [&](int j) {
    if (j == 0 || parent[j - 1] != j || child_count[j] != 1) return false;
    const int last = node_of[j - 1];
    for (SparseMatrix::InnerIterator it(pattern, order[j]); it; ++it) {
      const int i = place_of[it.row()];
      if (i > j && seen_by[i] != last) return false;
    }
    return true;
  };
  const auto finish = [&](int s) {
    Node& node = nodes[s];
    const int last = node.columns.back();
    const auto own = [last](int row) { return row <= last; };
    node.rows.erase(std::remove_if(node.rows.begin(), node.rows.end(), own), node.rows.end());
    if (parent[last] >= 0) pending[parent[last]].push_back(s);
  };
  for (int j = 0; j < n; ++j) {
    if (joins(j)) {
      node_of[j] = node_of[j - 1];
      nodes[node_of[j]].columns.push_back(j);
      continue;
    }
    if (j > 0) finish(node_of[j - 1]);
    const int s = static_cast<int>(nodes.size());
    nodes.emplace_back();
    Node& node = nodes.back();
    node.columns.push_back(j);
    node_of[j] = s;
    const auto add = [&](int i) {
      if (i <= j || seen_by[i] == s) return;
      seen_by[i] = s;
      node.rows.push_back(i);
    };
    for (int child : pending[j]) {
      for (int i : nodes[child].rows) add(i);
      nodes[child].parent = s;
      node.children.push_back(child);
    }
    for (SparseMatrix::InnerIterator it(pattern, order[j]); it; ++it) add(place_of[it.row()]);
  }
  if (n > 0) finish(node_of[n - 1]);
  return nodes;
}

/// Joins children to their parents where the zeros that this stores cost less than it saves.
void relax(std::vector<Node>& nodes) {
  const auto node_cost = [](const Node& node) {
    return cost(static_cast<double>(node.columns.size()), static_cast<double>(node.rows.size()));
  };
  for (size_t s = 0; s < nodes.size(); ++s) {
    Node& node = nodes[s];
    // Those that reach furthest first: they have the most rows in common with the parent.
    std::vector<int> candidates = node.children;
    std::stable_sort(candidates.begin(), candidates.end(),
                     [&](int a, int b) { return nodes[a].rows.size() > nodes[b].rows.size(); });
    for (int c : candidates) {
      Node& child = nodes[c];
      const double joined = cost(static_cast<double>(child.columns.size() + node.columns.size()),
                                 static_cast<double>(node.rows.size()));
      if (joined > node_cost(child) + node_cost(node)) continue;
      child.joined = true;
      child.columns.insert(child.columns.end(), node.columns.begin(), node.columns.end());
      node.columns = std::move(child.columns);
      node.children.erase(std::find(node.children.begin(), node.children.end(), c));
      node.children.insert(node.children.end(), child.children.begin(), child.children.end());
      for (int grandchild : child.children) nodes[grandchild].parent = static_cast<int>(s);
    }
  }
}

/// Cuts the tree into subtrees of about equal weight. Returns their roots, domain by domain, and
/// marks what is above them.
std::vector<std::vector<int>> find_domains(std::vector<Node>& nodes, std::vector<char>& in_top) {
  double total = 0;
  for (Node& node : nodes) {
    if (node.joined) continue;
    const double own =
        cost(static_cast<double>(node.columns.size()), static_cast<double>(node.rows.size()));
    node.weight += own;
    total += own;
    if (node.parent >= 0) nodes[node.parent].weight += node.weight;
  }
  const auto lighter = [&](int a, int b) {
    return nodes[a].weight != nodes[b].weight ? nodes[a].weight < nodes[b].weight : a < b;
  };
  std::priority_queue<int, std::vector<int>, decltype(lighter)> subtrees(lighter);
  for (size_t s = 0; s < nodes.size(); ++s)
    if (!nodes[s].joined && nodes[s].parent < 0) subtrees.push(static_cast<int>(s));
  const int wanted = std::clamp(static_cast<int>(total / kLeastDomain), 1, kMostDomains);
  in_top.assign(nodes.size(), 0);
  while (wanted > 1 && !subtrees.empty() && nodes[subtrees.top()].weight > 1.2 * total / wanted) {
    const int root = subtrees.top();
    if (nodes[root].children.empty()) break;
    subtrees.pop();
    in_top[root] = 1;
    for (int child : nodes[root].children) subtrees.push(child);
  }
  // The heaviest first, each to the lightest domain.
  std::vector<std::vector<int>> domains(static_cast<size_t>(wanted));
  std::vector<double> load(domains.size(), 0);
  for (; !subtrees.empty(); subtrees.pop()) {
    const auto lightest = std::min_element(load.begin(), load.end());
    *lightest += nodes[subtrees.top()].weight;
    domains[static_cast<size_t>(lightest - load.begin())].push_back(subtrees.top());
  }
  return domains;
}

/// The supernodes as they are eliminated: domain after domain, whose beginnings are appended to
/// domain_begin, then the top.
std::vector<int> final_sequence(std::vector<Node>& nodes, std::vector<int>& domain_begin) {
  std::vector<char> in_top;
  std::vector<int> sequence, stack;
  for (const std::vector<int>& roots : find_domains(nodes, in_top)) {
    domain_begin.push_back(static_cast<int>(sequence.size()));
    // Parents before children, and then the other way round.
    const size_t first = sequence.size();
    for (int root : roots) {
      stack.push_back(root);
      while (!stack.empty()) {
        const int s = stack.back();
        stack.pop_back();
        sequence.push_back(s);
        for (int child : nodes[s].children) stack.push_back(child);
      }
    }
    std::reverse(sequence.begin() + static_cast<std::ptrdiff_t>(first), sequence.end());
  }
  domain_begin.push_back(static_cast<int>(sequence.size()));
  for (size_t s = 0; s < nodes.size(); ++s)
    if (in_top[s]) sequence.push_back(static_cast<int>(s));
  return sequence;
}

}  // namespace

SymbolicCholesky::SymbolicCholesky(const SparseMatrix& pattern, const std::vector<int>& first_order)
    : order(first_order) {
  invert(order, place_of);
  std::vector<int> tree = elimination_tree(pattern, order, place_of);
  {
    const std::vector<int> sequence = postorder(tree);
    std::vector<int> renumbered, place_in_sequence, renumbered_tree;
    invert(sequence, place_in_sequence);
    for (int k : sequence) {
      renumbered.push_back(order[k]);
      renumbered_tree.push_back(tree[k] < 0 ? -1 : place_in_sequence[tree[k]]);
    }
    order = std::move(renumbered);
    tree = std::move(renumbered_tree);
    invert(order, place_of);
  }
  std::vector<Node> nodes = fundamental_supernodes(pattern, order, place_of, tree);
  relax(nodes);
  const std::vector<int> sequence = final_sequence(nodes, domain_begin);

  std::vector<int> new_place(order.size()), new_number(nodes.size(), -1), new_order;
  begin.push_back(0);
  row_begin.push_back(0);
  for (size_t i = 0; i < sequence.size(); ++i) {
    new_number[sequence[i]] = static_cast<int>(i);
    for (int column : nodes[sequence[i]].columns) {
      new_place[column] = static_cast<int>(new_order.size());
      new_order.push_back(order[column]);
    }
    begin.push_back(static_cast<int>(new_order.size()));
  }
  for (int s : sequence) {
    const size_t first = rows.size();
    for (int row : nodes[s].rows) rows.push_back(new_place[row]);
    std::sort(rows.begin() + static_cast<std::ptrdiff_t>(first), rows.end());
    row_begin.push_back(static_cast<int64_t>(rows.size()));
    parent.push_back(nodes[s].parent < 0 ? -1 : new_number[nodes[s].parent]);
  }
  order = std::move(new_order);
  invert(order, place_of);
  make_slots();
}

void SymbolicCholesky::make_slots() {
  slots = rows;
  std::vector<int> slot_of(order.size(), -1);
  for (int d = 0; d < domain_count(); ++d) {
    slot_begin.push_back(static_cast<int>(slot_target.size()));
    const int end = section_begin(d + 1);
    for (int64_t k = row_begin[domain_begin[d]]; k < row_begin[domain_begin[d + 1]]; ++k) {
      const int row = rows[k];
      if (row < end) continue;
      if (slot_of[row] < size() + slot_begin.back()) {
        slot_of[row] = slotted_size();
        slot_target.push_back(row);
      }
      slots[k] = slot_of[row];
    }
  }
  slot_begin.push_back(static_cast<int>(slot_target.size()));
}

}  // namespace dd
