// SPDX-License-Identifier: GPL-3.0-or-later
#include "mesh_files.h"

#include <fstream>
#include <vector>

namespace dd::bench {

namespace {

struct Polygons {
  std::vector<double> places;  // 3 a vertex
  std::vector<int> triangles;  // 3 each

  void add_face(const std::vector<int>& corners) {
    for (size_t k = 2; k < corners.size(); ++k)
      triangles.insert(triangles.end(), {corners[0], corners[k - 1], corners[k]});
  }
};

Polygons read_off(std::istream& text) {
  Polygons read;
  std::string word;
  int vertices = 0, faces = 0, edges = 0;
  text >> word >> vertices >> faces >> edges;
  if (word != "OFF") text.setstate(std::ios::failbit);
  double place = 0;
  for (int k = 0; k < 3 * vertices && text >> place; ++k) read.places.push_back(place);
  std::vector<int> corners;
  for (int j = 0, count = 0; j < faces && text >> count; ++j) {
    corners.clear();
    for (int k = 0, corner = 0; k < count && text >> corner; ++k) corners.push_back(corner);
    read.add_face(corners);
    std::getline(text, word);  // skips colours
  }
  return read;
}

Polygons read_obj(std::istream& text) {
  Polygons read;
  std::vector<int> corners;
  for (std::string line, word; std::getline(text, line);) {
    std::istringstream words(line);
    words >> word;
    if (word == "v") {
      for (int c = 0; c < 3; ++c) words >> read.places.emplace_back();
      if (!words) return read;
    } else if (word == "f") {
      corners.clear();
      while (words >> word) corners.push_back(std::stoi(word) - 1);
      read.add_face(corners);
    }
  }
  text.clear();
  return read;
}

}  // namespace

std::stringstream text_of(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw UnreadableFile(path);
  std::stringstream text;
  for (std::string line; std::getline(file, line);)
    if (line.empty() || line[0] != '#') text << line << '\n';
  return text;
}

Mesh mesh_from_file(const std::string& path) {
  std::stringstream text = text_of(path);
  const bool is_obj = path.size() > 4 && path.substr(path.size() - 4) == ".obj";
  const Polygons read = is_obj ? read_obj(text) : read_off(text);
  if (!text) throw UnreadableFile(path);
  Mesh mesh;
  mesh.positions =
      Eigen::Map<const Positions>(read.places.data(), Index(read.places.size()) / 3, 3);
  mesh.triangles =
      Eigen::Map<const Triangles>(read.triangles.data(), Index(read.triangles.size()) / 3, 3);
  validate(mesh);
  return mesh;
}

}  // namespace dd::bench
