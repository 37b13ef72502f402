// SPDX-License-Identifier: GPL-3.0-or-later
#include "survey_files.h"

#include <sstream>
#include <utility>

#include "mesh_files.h"

namespace dd::bench {

namespace {

class Numbers {
 public:
  explicit Numbers(std::string path) : path_(std::move(path)), text_(text_of(path_)) {}

  template <class Number>
  Number next() {
    Number number{};
    if (!(text_ >> number)) throw UnreadableFile(path_);
    return number;
  }

 private:
  std::string path_;
  std::stringstream text_;
};

test::Case case_from(const std::string& stem, const std::string& name) {
  test::Case made;
  made.name = name;
  made.mesh = mesh_from_file(stem + ".off");
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
