// Closed surfaces of triangles: topology, checks, icospheres and mesh files.
#include <catch2/catch.hpp>

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include <pliant/base/errors.h>
#include <pliant/geometry/off_text.h>

namespace pliant::test::mesh_test {

namespace {

TriangleMesh tetrahedron(const Vec<3>& at = {0, 0, 0}) {
  return {{at, at + Vec<3>(1, 0, 0), at + Vec<3>(0, 1, 0), at + Vec<3>(0, 0, 1)},
          {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}};
}

/// Two meshes as one, with separate vertices.
TriangleMesh together(TriangleMesh a, const TriangleMesh& b) {
  const auto before = static_cast<Index>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const auto& [i, j, k] : b.faces) a.faces.push_back({before + i, before + j, before + k});
  return a;
}

void rename(TriangleMesh& mesh, Index from, Index to) {
  for (Face& face : mesh.faces)
    for (Index& v : face)
      if (v == from) v = to;
}

/// A ring of squares round a ring, each cut into two triangles.
TriangleMesh torus() {
  constexpr Index n = 5;
  TriangleMesh mesh;
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < n; ++j) {
      const Real u = 2 * pi * i / n, w = 2 * pi * j / n, r = 3 + std::cos(w);
      mesh.vertices.emplace_back(r * std::cos(u), r * std::sin(u), std::sin(w));
      const Index i1 = (i + 1) % n, j1 = (j + 1) % n;
      mesh.faces.push_back({i * n + j, i1 * n + j, i1 * n + j1});
      mesh.faces.push_back({i * n + j, i1 * n + j1, i * n + j1});
    }
  return mesh;
}

template <class F>
std::string thrown(F&& f) {
  try {
    f();
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}
std::string failure(const TriangleMesh& mesh) {
  return thrown([&] { check_mesh(mesh); });
}

class MeshFile {
 public:
  MeshFile(const std::string& text, const std::string& end)
      : path_(std::filesystem::temp_directory_path() / ("pliant_mesh_" + std::to_string(getpid()) + end)) {
    std::ofstream(path_) << text;
  }
  ~MeshFile() { std::filesystem::remove(path_); }
  MeshFile(const MeshFile&) = delete;
  MeshFile& operator=(const MeshFile&) = delete;
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

std::string reading_failure(const std::string& text, const std::string& end) {
  const MeshFile file(text, end);
  const std::string whole = thrown([&] { read_mesh(file.path()); });
  if (whole == "no error") return whole;
  REQUIRE(whole.rfind(file.path() + ": ", 0) == 0);
  return whole.substr(file.path().size() + 2);
}

}  // namespace

TEST_CASE("hinges of a tetrahedron") {
  const TriangleMesh mesh = tetrahedron();
  CHECK(volume(mesh) == Approx(1.0 / 6));
  CHECK(surface_area(mesh) == Approx(1.5 + std::sqrt(3.0) / 2));
  CHECK(volume(tetrahedron({1e8, -1e8, 1e8})) == Approx(1.0 / 6).epsilon(1e-12));
  const std::vector<Hinge> hinges = check_mesh(mesh);
  REQUIRE(hinges.size() == 6);
  CHECK(hinges[0] == Hinge{0, 1, 3, 2, 1, 0});
  for (const Hinge& h : hinges) {
    CHECK(std::set<Index>{h.a, h.b, h.c, h.d} == std::set<Index>{0, 1, 2, 3});
    CHECK(h.a < h.b);
    const auto runs = [&](const Face& face, Index from, Index to, Index end) {
      for (int k = 0; k < 3; ++k)
        if (face[k] == from && face[(k + 1) % 3] == to && face[(k + 2) % 3] == end) return true;
      return false;
    };
    CHECK(runs(mesh.faces[h.left], h.a, h.b, h.c));
    CHECK(runs(mesh.faces[h.right], h.b, h.a, h.d));
  }
}

TEST_CASE("icospheres") {
  struct Known {
    Index vertices, faces;
    Real shape;
  };
  for (const auto& [vertices, faces, shape] :
       {Known{12, 20, 1.09844}, Known{42, 80, 1.02406}, Known{162, 320, 1.00594}, Known{642, 1280, 1.00148}}) {
    INFO(vertices << " vertices");
    const TriangleMesh mesh = icosphere(vertices);
    CHECK(static_cast<Index>(mesh.vertices.size()) == vertices);
    CHECK(static_cast<Index>(mesh.faces.size()) == faces);
    CHECK(static_cast<Index>(check_mesh(mesh).size()) == faces * 3 / 2);
    CHECK(volume(mesh) == Approx(pi / 6).epsilon(1e-14));
    CHECK(std::abs(shape_parameter(surface_area(mesh), volume(mesh)) - shape) < 6e-6);
    for (const Vec<3>& r : mesh.vertices) CHECK(r.norm() == Approx(mesh.vertices[0].norm()).epsilon(1e-14));
    Vec<3> mean = Vec<3>::Zero();
    for (const Vec<3>& r : mesh.vertices) mean += r;
    CHECK(mean.norm() < 1e-12);
  }
  for (const Index n : {-1, 0, 11, 13, 41, 2562})
    CHECK(thrown([&] { icosphere(n); }) ==
          "there is no icosphere of " + std::to_string(n) + " vertices; choose 12, 42, 162 or 642");
}

TEST_CASE("surfaces that are not closed spheres are refused") {
  using Catch::Contains;
  REQUIRE(failure(tetrahedron()) == "no error");

  TriangleMesh open = tetrahedron();
  open.faces.pop_back();
  CHECK_THAT(failure(open), Contains("the surface has 3 faces, but a closed one has at least 4"));
  open = icosphere(12);
  open.faces.erase(open.faces.begin() + 3);
  CHECK_THAT(failure(open), Contains("the surface is open: only face 3 has the edge from vertex 0 to vertex 10"));

  TriangleMesh turned = tetrahedron();
  std::swap(turned.faces[2][0], turned.faces[2][1]);
  CHECK_THAT(failure(turned), Contains("both run from vertex"));

  TriangleMesh inverted = tetrahedron();
  for (Face& face : inverted.faces) std::swap(face[0], face[1]);
  CHECK_THAT(failure(inverted), Contains("the surface has the signed volume -0.1666") && Contains("counter-clockwise"));

  TriangleMesh three = tetrahedron();  // three faces at an edge
  three.vertices.emplace_back(1, 1, 1);
  three.faces.push_back({0, 1, 4});
  CHECK_THAT(failure(three), Contains("faces 1 and 4 both run from vertex 0 to vertex 1"));

  CHECK_THAT(failure(together(tetrahedron(), tetrahedron({5, 0, 0}))),
             Contains("the surface consists of 2 separate parts"));
  CHECK_THAT(failure(torus()), Contains("Euler number 0, so 1 hole(s)"));

  // At one vertex the Euler number would tell; at two it is 2 again.
  TriangleMesh pinched = together(tetrahedron(), tetrahedron({5, 0, 0}));
  rename(pinched, 4, 0);
  rename(pinched, 7, 4);
  pinched.vertices.pop_back();
  CHECK_THAT(failure(pinched), Contains("two parts of the surface meet at vertex 0 only"));

  TriangleMesh unused = tetrahedron();
  unused.vertices.emplace_back(3, 3, 3);
  CHECK_THAT(failure(unused), Contains("vertex 4 belongs to no face"));
  TriangleMesh missing = tetrahedron();
  missing.faces[1][2] = 4;
  CHECK_THAT(failure(missing), Contains("face 1 has the vertex 4, but there are 4 vertices"));
  TriangleMesh twice = tetrahedron();
  twice.faces[1] = {0, 0, 3};
  CHECK_THAT(failure(twice), Contains("face 1 has the vertex 0 twice"));

  TriangleMesh flat = tetrahedron();
  flat.vertices[2] = {2, 0, 0};
  CHECK_THAT(failure(flat), Contains("face 0 has no area"));
  TriangleMesh broken = tetrahedron();
  broken.vertices[1][1] = std::nan("");
  CHECK_THAT(failure(broken), Contains("vertex 1 has a coordinate that is not finite"));
}

TEST_CASE("surfaces from OFF and OBJ files") {
  const std::string off =
      "# a corner of a cube\nOFF # the format\n4 4 6\n\n0 0 0\n1 0 0\n0 1e0 0\n0 0 1\n3 0 2 1\n3 0 1 3 255 0 0\n"
      "3  1 2 3\n3 2 0 3\n";
  const std::string obj =
      "mtllib a.mtl\no corner\nv 0 0 0\nv 1 0 0 1.0\nvn 0 0 1\nv 0 1 0\nv 0 0 1\ns off\nf 1 3 2\nf 1/1 2/2 4/3\n"
      "f 2//1 3//1 4//1\nf -2 -4 -1\n";
  const TriangleMesh corner = tetrahedron();
  for (const auto& [text, end] : {std::pair{off, ".off"}, std::pair{obj, ".obj"}, std::pair{obj, ".OBJ"}}) {
    const MeshFile file(text, end);
    const TriangleMesh mesh = read_mesh(file.path());
    CHECK(mesh.vertices == corner.vertices);
    CHECK(mesh.faces == corner.faces);
  }
  CHECK(reading_failure("OFF 4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3", ".off") ==
        "no error");

  CHECK(thrown([] { read_mesh("ball.stl"); }) == "mesh file ball.stl: the name must end with .off or .obj");
  CHECK_THAT(thrown([] { read_mesh("/no/such/ball.off"); }), Catch::Contains("cannot be opened"));

  TriangleMesh odd = icosphere(12);
  odd.vertices[3] *= 1 + 1.0 / 3;
  const TriangleMesh again = mesh_of_off(off_text(odd), "text");
  CHECK(again.vertices == odd.vertices);
  CHECK(again.faces == odd.faces);
  CHECK_THAT(thrown([] { mesh_of_off("OFF 4 4\n0 0 0\n", "text"); }), Catch::StartsWith("text: line 2: the file ends"));

  struct Bad {
    std::string text, end, message;
  };
  const std::string head = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
  const std::vector<Bad> all{
      {"", ".off", "the file ends here; the word OFF and the numbers"},
      {"COFF\n4 4 0\n", ".off", "line 1: the first word is \"COFF\", but must be OFF"},
      {"OFF\n4\n", ".off", "line 2: the number of faces is missing"},
      {"OFF\n4 x\n", ".off", "line 2: \"x\" is not a whole number"},
      {"OFF\n3 4 0\n", ".off", "line 2: 3 is not between 4 and"},
      {"OFF\n4 4 0\n0 0 0\n", ".off", "line 3: the file ends here; 3 of 4 vertices are missing"},
      {"OFF\n4 4 0\n0 0\n", ".off", "line 3: a vertex needs 3 coordinates, but 2 are given"},
      {"OFF\n4 4 0\n0 0 nan\n", ".off", "line 3: \"nan\" is not a finite number"},
      {"OFF\n4 4 0\n0 0 1,5\n", ".off", "line 3: \"1,5\" is not a finite number"},
      {head + "4 0 1 2 3\n", ".off", "line 7: a face of 4 vertices, but faces must be triangles"},
      {head + "3 0 1\n", ".off", "line 7: a face needs 3 vertices, but 2 are given"},
      {head + "3 0 1 4\n", ".off", "line 7: 4 is not between 0 and 3"},
      {head + "3 0 1 2\n", ".off", "line 7: the file ends here; 3 of 4 faces are missing"},
      {head + "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n3 2 0 1\n", ".off", "line 11: there is text after the last of 4"},
      {head + "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 3 0\n", ".off", "both run from vertex"},
      {"v 0 0\n", ".obj", "line 1: a vertex needs 3 coordinates, but 2 are given"},
      {"v 0 0 0\n", ".obj", "the file has no faces"},
      {"f 1 2 3\n", ".obj", "line 1: a face before all vertices"},
      {"v 0 0 0\nf 1 1 2\n", ".obj", "line 2: 2 is not between 1 and 1"},
      {"v 0 0 0\nf 1 1 0\n", ".obj", "line 2: 0 is not between 1 and 1"},
      {"v 0 0 0\nf 1 1 -2\n", ".obj", "line 2: -2 is not between -1 and -1"},
      {"v 0 0 0\nf 1 1 1 1\n", ".obj", "line 2: a face of 4 vertices, but faces must be triangles"},
  };
  for (const Bad& bad : all) {
    CAPTURE(bad.text);
    CHECK_THAT(reading_failure(bad.text, bad.end), Catch::Contains(bad.message));
  }
}

}  // namespace pliant::test::mesh_test
