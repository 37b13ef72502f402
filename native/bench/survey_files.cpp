// SPDX-License-Identifier: GPL-3.0-or-later
#include "survey_files.h"

#include <fstream>
#include <sstream>
#include <stdexcept>

namespace dd::bench {

namespace {

/// What the file says, without comments and the word in front.
class Numbers {
 public:
  explicit Numbers(std::string path, const std::string& word = "") : path_(std::move(path)) {
    std::ifstream file(path_);
    if (!file) refuse();
    for (std::string line; std::getline(file, line);)
      if (line[0] != '#') text_ << line << '\n';
    std::string first;
    if (!word.empty() && (!(text_ >> first) || first != word)) refuse();
  }

  template <class Number>
  Number next() {
    Number number{};
    if (!(text_ >> number)) refuse();
    return number;
  }

 private:
  [[noreturn]] void refuse() const { throw std::runtime_error("Can't be read: " + path_); }

  std::string path_;
  std::stringstream text_;
};

Mesh surface_from(const std::string& path) {
  Numbers numbers(path, "OFF");
  const int n = numbers.next<int>(), m = numbers.next<int>();
  numbers.next<int>();  // edges, which nobody counts
  Mesh mesh;
  mesh.positions.resize(n, 3);
  for (Index k = 0; k < mesh.positions.size(); ++k)
    mesh.positions.data()[k] = numbers.next<double>();
  mesh.triangles.resize(m, 3);
  for (Index j = 0; j < m; ++j) {
    if (numbers.next<int>() != 3) throw std::runtime_error("Not of triangles: " + path);
    for (int k = 0; k < 3; ++k) mesh.triangles(j, k) = numbers.next<int>();
  }
  validate(mesh);
  return mesh;
}

test::Case case_from(const std::string& stem, const std::string& name) {
  test::Case made;
  made.name = name;
  made.mesh = surface_from(stem + ".off");
  Numbers selection(stem + ".sel");
  for (int v = 0; v < made.mesh.vertex_count(); ++v) {
    const int kind = selection.next<int>();
    made.roles.push_back(kind == 0 ? kFixed : kind == 1 ? kFree : 0);
  }
  Numbers motion(stem + ".def");
  for (Index k = 0; k < made.motion.size(); ++k) made.motion.data()[k] = motion.next<double>();
  return made;
}

}  // namespace

std::vector<test::Case> survey_from_files(const std::string& folder) {
  std::vector<test::Case> cases;
  for (const auto& [file, name] : {std::pair{"plane", "plane lifted"},
                                   {"cylinder", "cylinder bent 120"},
                                   {"bar", "bar twisted 135"},
                                   {"cactus", "cactus bent 70"}})
    cases.push_back(case_from(folder + "/" + file, name));
  return cases;
}

}  // namespace dd::bench
