#include <unistd.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>

#include <pliant/base/errors.h>
#include <pliant/scenarios/evaluate/evaluate.h>

namespace pliant::test::evaluate_test {
using nlohmann::json;
using nlohmann::ordered_json;

namespace {

json run(const json& document) { return json::parse(evaluate(document, "case.json").dump()); }

std::set<std::string> keys(const json& object) {
  std::set<std::string> names;
  for (const auto& item : object.items()) names.insert(item.key());
  return names;
}

double largest(const json& a) {
  if (a.is_number()) return std::abs(a.get<double>());
  double most = 0;
  for (const json& b : a) most = std::max(most, largest(b));
  return most;
}

/// Same layout, and numbers that differ by at most `tolerance`.
void check_close(const json& got, const json& expected, double tolerance) {
  if (expected.is_array()) {
    REQUIRE(got.is_array());
    REQUIRE(got.size() == expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) check_close(got[i], expected[i], tolerance);
  } else {
    REQUIRE(got.is_number());
    CAPTURE(got, expected);
    CHECK(std::abs(got.get<double>() - expected.get<double>()) <= tolerance);
  }
}

void check_term(const json& got, const json& expected) { check_close(got, expected, 1e-10 * largest(expected)); }

json disks() {
  return json::parse(
      R"({"model": "SP", "inputs": {"dim": 2, "positions": [[0, 0], [0.6, 0.8]], "velocities": [[1, 2], [3, 5]],
    "sigma": [1, 3], "mass": [1, 2], "eps_sp": 8}})");
}

json ball() {
  return json::parse(
      R"({"model": "SP", "inputs": {"dim": 3, "positions": [[1.02, 1.36, -0.4]], "sigma": [2], "eps_sp": 1,
    "eps_w": 100, "hopper3d": {"W": 10, "w": 4}}})");
}

/// A vertex of the triangle 0.06 above the top edge of the square, at t = 0.6 from its vertex 2.
json square_and_triangle(const std::string& model = "DP-smooth") {
  return json::parse(R"({"model": ")" + model + R"(", "inputs": {
    "vertices": [[[0, 0], [1, 0], [1, 1], [0, 1]], [[0.4, 1.06], [0.9, 1.6], [0.1, 1.7]]],
    "velocities": [[[0, 0], [0, 0], [1, 0], [0, 2]], [[0.5, -0.5], [0, 0], [0, 0]]],
    "a0": [1, 0.3], "l0": [1, 1], "shape_terms": false}})");
}

/// Over the lip at (1, 0) of a flat hopper, all its vertices off the lip: one over the hole, one over the floor.
json square_on_lip(const std::string& model) {
  return json::parse(R"({"model": ")" + model + R"(", "inputs": {
    "vertices": [[[0.5, 0.02], [1.5, 0.02], [1.5, 1.02], [0.5, 1.02]]], "a0": [1], "l0": [1], "delta": [0.1], "shape_terms": false,
    "hopper": {"W": 10, "w": 2, "theta_deg": 90}}})");
}

json shapes() {
  return json::parse(R"({"model": "DP", "inputs": {
    "vertices": [[[0, 0], [1, 0], [1, 1], [0, 1]], [[10, 0], [13, 0], [10, 4]]],
    "a0": [0.5, 5], "l0": [0.8, 4], "ka": 10, "kl": 3, "kb": 2}})");
}

/// A tetrahedron.
json surface() {
  json document = read_case(PLIANT_TEST_DATA "/evaluate/d3_04_hinges.json");
  for (const char* key : {"expected", "alternatives"}) document.erase(key);
  return document;
}

std::string message(const json& document) {
  try {
    evaluate(document, "case.json");
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

/// A file that is deleted at the end of the test.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text)
      : path_(std::filesystem::temp_directory_path() / ("pliant_case_" + std::to_string(getpid()) + ".json")) {
    std::ofstream(path_) << text;
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

std::string reading_message(const std::filesystem::path& file) {
  try {
    read_case(file);
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("evaluate agrees with the reference configurations") {
  const std::string name =
      GENERATE("sp2d_01_pair", "sp2d_05_flat_orifice", "sp3d_09_cluster", "dp_13_irregular16", "dp_15_concave7",
               "dpr_17_pair", "dps_20_vertex_edge", "dps_24_concave_notch", "bub_32_pairs", "bub_34_walls");
  const json document = read_case(PLIANT_TEST_DATA "/evaluate/" + name + ".json");
  const json expected = document.at("expected"), got = run(document);
  CAPTURE(name);
  CHECK(keys(got.at("energy")) == keys(expected.at("energy")));
  CHECK(keys(got.at("force")) == keys(expected.at("force")));
  REQUIRE(largest(expected) > 0);
  for (const std::string part : {"energy", "force"})
    for (const auto& item : expected.at(part).items()) {
      CAPTURE(part, item.key());
      check_term(got.at(part).at(item.key()), item.value());
    }
  if (expected.contains("area")) check_term(got.at("area"), expected.at("area"));
  if (expected.contains("neighbours")) {
    CHECK(got.at("neighbours") == expected.at("neighbours"));
    check_term(got.at("velocity"), expected.at("velocity_exact"));
  }
}

TEST_CASE("evaluate agrees with the reference configurations of surfaces") {
  const std::string name = GENERATE("d3_01_icosahedron_rest", "d3_04_hinges", "d3_05_rough_pair", "d3_06_vertex_face");
  const json document = read_case(PLIANT_TEST_DATA "/evaluate/" + name + ".json");
  const json expected = document.at("expected"), got = run(document);
  CAPTURE(name);
  CHECK(keys(got.at("energy")) == keys(expected.at("energy")));
  REQUIRE(largest(expected) > 0);
  for (const std::string part : {"energy", "force"})
    for (const auto& item : expected.at(part).items()) {
      CAPTURE(part, item.key());
      // Terms at rest have rounding errors only.
      check_close(got.at(part).at(item.key()), item.value(), 1e-10 * std::max(0.1, largest(item.value())));
    }
  if (name != "d3_04_hinges") return;
  json angles = document;
  angles["inputs"]["rest_angles"] = true;
  const json alternative = document.at("alternatives").at("bending_rest_angles");
  check_term(run(angles).at("energy").at("bending"), alternative.at("energy").at("bending"));
  check_term(run(angles).at("force").at("bending"), json::array({alternative.at("force").at("bending")}));
}

TEST_CASE("evaluate has surfaces under the names of runs, with one entry per particle") {
  const json one = surface();
  json same = one;
  same["model"] = "shape";
  same["inputs"]["dim"] = 3;
  for (const std::string name : {"v", "a", "l", "b"}) {
    same["inputs"]["k_" + name] = same["inputs"]["k" + name];
    same["inputs"].erase("k" + name);
  }
  std::string remark;
  CHECK(json::parse(evaluate(same, "case.json", &remark).dump()) == run(one));
  CHECK(remark.empty());
  evaluate(one, "case.json", &remark);
  CHECK_THAT(remark, Catch::Contains("DP3 (shape with dim 3)") && Catch::Contains("kv (k_v)"));
  CHECK(run(one)["volume"].get<double>() == Approx(0.278333333333));

  json two = one;
  for (const std::string key : {"positions", "faces", "a0", "edges", "l0", "theta0"})
    two["inputs"][key].push_back(two["inputs"][key][0]);
  for (json& row : two["inputs"]["positions"][1]) row[2] = row[2].get<double>() + 4;
  const json of_one = run(one), of_two = run(two);
  for (const auto& item : of_one["energy"].items())
    for (int m = 0; m < 2; ++m)
      CHECK(of_two["energy"][item.key()][m].get<double>() == Approx(item.value().get<double>()));
  for (const auto& item : of_one["force"].items())
    for (int m = 0; m < 2; ++m)
      check_close(of_two["force"][item.key()][m], item.value()[0], 1e-12 * largest(item.value()));
}

TEST_CASE("evaluate has surfaces with contacts, friction, gravity and drag") {
  json document = read_case(PLIANT_TEST_DATA "/evaluate/d3_05_rough_pair.json");
  document["inputs"].update(json{{"mu", 2}, {"zeta", 3}, {"gravity", {0, 0, -2}}, {"mass", {1, 4}}});
  json velocities = document["inputs"]["positions"];
  for (json& row : velocities[0]) row = {1, 0, 0};
  for (json& row : velocities[1]) row = {0, 0, 0};
  document["inputs"]["velocities"] = velocities;
  const json got = run(document);
  CHECK(keys(got["energy"]) == std::set<std::string>{"rough", "gravity"});
  CHECK(keys(got["force"]) == std::set<std::string>{"rough", "gravity", "drag", "friction", "total"});
  CHECK(got["force"]["drag"][0][7][0].get<double>() == Approx(-3.0 / 42));
  CHECK(got["force"]["gravity"][1][7][2].get<double>() == Approx(-8.0 / 42));
  CHECK(largest(got["force"]["friction"]) >= 2);

  // With a rest shape also the energies of the shape.
  json rest = surface();
  rest["model"] = "rough";
  rest["inputs"]["dim"] = 3;
  CHECK(keys(run(rest)["energy"]) == std::set<std::string>{"volume", "area", "edge", "bending", "tension", "rough"});
  CHECK(run(rest)["energy"]["area"] == run(surface())["energy"]["area"]);
  rest["inputs"]["shape_terms"] = false;
  CHECK(keys(run(rest)["energy"]) == std::set<std::string>{"rough"});
}

TEST_CASE("evaluate has smooth surfaces under the names of runs, and refuses surfaces that meet") {
  const json document = read_case(PLIANT_TEST_DATA "/evaluate/d3_06_vertex_face.json");
  json same = document;
  same["model"] = "smooth";
  same["inputs"]["dim"] = 3;
  same["inputs"]["e_c"] = same["inputs"]["eps_c"];
  same["inputs"].erase("eps_c");
  std::string remark;
  CHECK(json::parse(evaluate(same, "case.json", &remark).dump()) == run(document));
  CHECK(remark.empty());
  const json got = run(document);
  CHECK(keys(got["force"]) == std::set<std::string>{"contact", "contact_vertex", "contact_edge", "friction",
                                                    "friction_vertex", "friction_edge", "total"});
  // The vertex in the middle of a face, at no distance, and beyond it.
  json& height = same["inputs"]["positions"][0][0][2];
  height = 0;
  CHECK_THAT(message(same), Catch::Contains("inputs.positions[0][0] is at no distance from face 0 of particle 1"));
  height = -0.01;
  CHECK_THAT(message(same), Catch::Contains("pierces face 0 of particle 1"));
  // The tip touches the bottom of a hopper.
  height = 0.06;
  for (json& row : same["inputs"]["positions"][1]) row[2] = row[2].get<double>() - 1;
  same["inputs"]["hopper3d"] = json{{"W", 20}, {"w", 0.1}};
  same["inputs"]["e_w"] = 50;
  for (json& row : same["inputs"]["positions"][0]) row[2] = row[2].get<double>() - 0.02;
  CHECK(run(same)["energy"]["wall"].get<double>() > 0);
}

TEST_CASE("evaluate names what is wrong with a surface") {
  struct Case {
    std::string where;  // JSON pointer
    json value;         // discarded: the key is removed
    std::string message;
  };
  const json missing(json::value_t::discarded);
  const std::vector<Case> cases{
      {"/inputs/V0", missing, "inputs.V0 is missing"},
      {"/inputs/a0", missing, "inputs.a0 is missing"},
      {"/inputs/edges", missing, "inputs.edges is missing"},
      {"/inputs/faces", missing, "inputs.faces is missing"},
      {"/inputs/dim", 2, "inputs.dim must be 3"},
      {"/inputs/sigma", {1}, "inputs.sigma is not used by model DP3"},
      {"/inputs/rest_angles", 1, "inputs.rest_angles is 1, but must be true or false"},
      {"/inputs/gamma", -1, "inputs.gamma is -1, but must not be negative"},
      {"/inputs/V0", -1, "inputs.V0 is -1, but must be positive"},
      {"/inputs/V0", {1, 2}, "inputs.V0 has 2 entries, but must have 1, one per particle"},
      {"/inputs/a0/0/1", 0, "inputs.a0[0][1] is 0, but must be positive"},
      {"/inputs/a0/0", {1, 2, 3}, "inputs.a0[0] has 3 entries, but must have 4, one per face"},
      {"/inputs/l0/0", {1, 2, 3}, "inputs.l0[0] has 3 entries, but must have 6, one per edge"},
      {"/inputs/edges/0/2", {0, 0}, "inputs.edges[0][2] is not an edge of a face"},
      {"/inputs/edges/0/2", {1, 0}, "inputs.edges[0][2] is an edge that is listed twice"},
      {"/inputs/edges/0/2", {1}, "inputs.edges[0][2] has 1 entries, but must have 2, one per vertex"},
      {"/inputs/positions/0/1", {1, 2}, "inputs.positions[0][1] has 2 entries, but must have 3, one per coordinate"},
      {"/inputs/faces/0/1", {1, 2}, "inputs.faces[0][1] has 2 entries, but must have 3, one per vertex"},
      {"/inputs/faces/0/1/2", 4, "inputs.faces[0][1][2] is 4, but must be the number of one of 4 vertices, from 0"},
      {"/inputs/faces/0/1/2", 0.5, "inputs.faces[0][1][2] is 0.5, but must be the number of one of 4 vertices"},
      {"/inputs/faces/0/1", {1, 3, 0}, "inputs.faces[0] and inputs.positions[0] do not form a closed surface: faces"},
      {"/inputs/faces/0", {{0, 1, 2}, {0, 1, 3}, {1, 2, 3}}, "do not form a closed surface: the surface has 3 faces"},
      {"/inputs/positions/0/0", {-3, -3, -3}, "not form a closed surface: the surface has the signed volume -"},
      {"/inputs/positions/0/1", {0.5, 0.5, 0.5}, "not form a closed surface: face 0 has no area"},
      {"/inputs/a0/0/2", 1e9, "inputs.faces[0][2] has "},
  };
  REQUIRE(message(surface()) == "no error");
  for (const Case& c : cases) {
    json document = surface();
    const json::json_pointer pointer(c.where);
    if (c.value.is_discarded())
      document[pointer.parent_pointer()].erase(pointer.back());
    else
      document[pointer] = c.value;
    CAPTURE(c.where, c.value.dump());
    CHECK_THAT(message(document), Catch::StartsWith("case.json") && Catch::Contains(c.message));
  }
  json angles = surface();
  angles["inputs"].erase("theta0");
  CHECK(message(angles) == "no error");
  angles["inputs"]["rest_angles"] = true;
  CHECK_THAT(message(angles), Catch::Contains("inputs.theta0 is missing"));
  json far = read_case(PLIANT_TEST_DATA "/evaluate/d3_05_rough_pair.json");
  far["inputs"]["positions"][1][0] = far["inputs"]["positions"][0][0];
  CHECK_THAT(message(far), Catch::Contains("inputs.positions[1][0] is at no distance from inputs.positions[0][0]"));
}

TEST_CASE("evaluate gives droplets at walls and tips their velocities") {
  json document = json::parse(R"({"model": "bubble", "inputs": {"positions": [[0, 1.05]], "R": [1], "g": 0.02,
    "walls": [{"point": [7, 0], "normal": [0, 2], "velocity": [0.3, 0]}]}})");
  const double pull = 3.14159265358979 * 1e-4 / (8 * 1.25e-4) * 0.05 * 2.05;
  SECTION("a wall") {
    const json got = run(document);
    CHECK(keys(got) == std::set<std::string>{"energy", "force", "neighbours", "velocity"});
    CHECK(keys(got["force"]) ==
          std::set<std::string>{"contact", "depletion", "wall_repulsion", "wall_depletion", "gravity", "total"});
    check_close(got.at("force").at("total"), {{0, -pull - 0.02}}, 1e-14);
    check_close(got.at("velocity"), {{0, -pull - 0.02}}, 1e-14);
    CHECK(got.at("neighbours") == json::array({json::array()}));
  }
  SECTION("a wall that rubs") {
    document["inputs"]["wall_friction"] = true;
    document["inputs"]["b"] = 4;
    check_close(run(document).at("velocity"), {{0.15, (-pull - 0.02) / 8}}, 1e-14);
  }
  SECTION("a wedge, its tip out of reach and at the foot") {
    document["inputs"]["walls"] = nullptr;
    document["inputs"]["wedge"] = json{{"tip", {-2, 0}}, {"dir1", {3, 0}}, {"dir2", {1, -1}}};
    check_close(run(document).at("force").at("wall_depletion"), {{0, -pull}}, 1e-13);
    document["inputs"]["wedge"]["tip"] = {0, 0};
    const double less = run(document).at("force").at("wall_depletion")[0][1];
    CHECK(less < -0.3 * pull);
    CHECK(less > -0.9 * pull);
  }
  SECTION("in space") {
    document["inputs"].update(
        json{{"dim", 3}, {"positions", {{0, 5, 1.05}}}, {"walls", {{{"point", {7, 0, 0}}, {"normal", {0, 0, 1}}}}}});
    check_close(run(document).at("velocity"), {{0, 0, -pull - 0.02}}, 1e-14);
  }
  SECTION("errors name the key or the droplet") {
    json& inputs = document["inputs"];
    inputs["sigma"] = {1};
    CHECK(message(document).find("inputs.sigma is not used by model bubble") != std::string::npos);
    inputs.erase("sigma");
    inputs["wedge"] = json{{"tip", {-2, 0}}, {"dir1", {3, 0}}, {"dir2", {-1, 0}}};
    CHECK(message(document).find("inputs.wedge") != std::string::npos);
    inputs["wedge"] = nullptr;
    inputs["walls"][0]["normal"] = {0, 0};
    CHECK(message(document).find("inputs.walls[0].normal") != std::string::npos);
    inputs["walls"][0]["normal"] = {0, -1};
    CHECK_THROWS_WITH(run(document), Catch::Contains("droplet 0 has run into wall 0"));
  }
}

TEST_CASE("evaluate lists the terms that are active, soft particles") {
  json document = disks();  // r = 1, σ_mn = 2
  SECTION("only the contact") {
    document["inputs"].update(
        json{{"mu", 0}, {"zeta", nullptr}, {"gravity", {0, 0}}, {"hopper", nullptr}, {"hopper3d", nullptr}});
    const json got = run(document);
    CHECK(keys(got) == std::set<std::string>{"energy", "force"});
    CHECK(keys(got["energy"]) == std::set<std::string>{"pair"});
    CHECK(keys(got["force"]) == std::set<std::string>{"pair", "total"});
    check_term(got.at("energy").at("pair"), 1.0);
    check_term(got.at("force").at("pair"), {{-1.2, -1.6}, {1.2, 1.6}});
    check_term(got.at("force").at("total"), got.at("force").at("pair"));
  }
  SECTION("all") {
    document["inputs"].update(json{{"mu", 0.5}, {"zeta", 2}, {"gravity", {0.5, -1}}});
    const json got = run(document);
    CHECK(keys(got["energy"]) == std::set<std::string>{"pair", "gravity"});
    CHECK(keys(got["force"]) == std::set<std::string>{"pair", "gravity", "drag", "friction", "total"});
    check_term(got.at("energy").at("gravity"), -2 * (0.5 * 0.6 - 0.8));
    check_term(got.at("force").at("gravity"), {{0.5, -1}, {1, -2}});
    check_term(got.at("force").at("drag"), {{-2, -4}, {-6, -10}});
    check_term(got.at("force").at("friction"), {{1, 1.5}, {-1, -1.5}});
    check_term(got.at("force").at("total"), {{-1.7, -5.1}, {-4.8, -11.9}});
  }
  SECTION("velocities that are null are zero") {
    document["inputs"].update(json{{"mu", 0.5}, {"zeta", 2}, {"velocities", nullptr}});
    const json got = run(document);
    CHECK(largest(got.at("force").at("drag")) == 0);
    CHECK(largest(got.at("force").at("friction")) == 0);
  }
  SECTION("no contact: the term is there, with zeros") {
    document["inputs"]["positions"][1] = {3, 0};
    const json got = run(document);
    CHECK(got.at("energy").at("pair") == 0.0);
    CHECK(largest(got.at("force").at("pair")) == 0);
  }
  SECTION("masses that are left out come from rho") {
    document["inputs"].erase("mass");
    document["inputs"].update(json{{"rho", 2}, {"gravity", {0, -1}}});
    check_term(run(document).at("force").at("gravity"), {{0, -M_PI / 2}, {0, -M_PI * 9 / 2}});
  }
}

TEST_CASE("evaluate counts both walls in an interior corner") {
  const json document =
      json::parse(R"({"model": "SP", "inputs": {"dim": 2, "positions": [[4.7, 4.1]], "sigma": [1], "eps_sp": 1,
    "hopper": {"W": 10, "w": 2, "theta_deg": 45}}})");  // corner at (5, 4); 0.3 from the upright wall, 0.4/√2 from the
                                                        // sloped one
  const json got = run(document);
  const double s = 1 - 0.4 * std::sqrt(2), slope = 2e4 * s / std::sqrt(2);
  CHECK(keys(got["energy"]) == std::set<std::string>{"pair", "wall"});
  check_term(got.at("energy").at("wall"), 800 + 5000 * s * s);
  check_term(got.at("force").at("wall"), {{-8000 - slope, slope}});
}

TEST_CASE("evaluate turns a ball round the circular lip of a cylinder") {
  json document = ball();  // ρ = 1.7, 0.5 from the lip at ρ = 2, z = 0
  json got = run(document);
  CHECK(keys(got["energy"]) == std::set<std::string>{"pair", "wall"});
  check_term(got.at("energy").at("wall"), 12.5);
  check_term(got.at("force").at("wall"), {{-18, -24, -40}});

  document["inputs"]["gravity"] = {0, 0, -1};
  check_term(run(document).at("force").at("gravity"), {{0, 0, -M_PI * 8 / 6}});

  document["inputs"]["positions"] = {{3, 0, 0.25}};  // over the flat base
  got = run(document);
  check_term(got.at("energy").at("wall"), 50 * 0.75 * 0.75);
  check_term(got.at("force").at("wall"), {{0, 0, 75}});
}

TEST_CASE("evaluate has what differs from the printed model") {
  json soft = disks();
  soft["inputs"].update(
      json{{"mu", 0.5}, {"friction", "tangential"}, {"zeta", 2}, {"drag", "per_mass"}, {"contact_law", "linear"}});
  json got = run(soft);
  check_term(got.at("energy").at("pair"), 2.0);
  check_term(got.at("force").at("pair"), {{-2.4, -3.2}, {2.4, 3.2}});
  check_term(got.at("force").at("friction"), {{-0.08, 0.06}, {0.08, -0.06}});
  check_term(got.at("force").at("drag"), {{-8 / M_PI, -16 / M_PI}, {-48 / M_PI, -80 / M_PI}});

  json at_lip = ball();  // 0.5 from the lip
  at_lip["inputs"]["wall_diameter"] = 0.5;
  got = run(at_lip);
  check_term(got.at("energy").at("wall"), 50 * 0.6 * 0.6);
  check_term(got.at("force").at("wall"), {{-17.28, -23.04, -38.4}});

  json smooth = square_and_triangle();
  smooth["inputs"].update(json{{"mu", 3}, {"friction", "tangential"}, {"edge_force", "twofold"}});
  got = run(smooth);
  check_term(got.at("energy").at("contact"), 2 * 5000 * 0.16);
  check_term(got.at("force").at("friction"), {{{0, 0}, {0, 0}, {-1.5, 0}, {0, 0}}, {{1.5, 0}, {0, 0}, {0, 0}}});

  json shape = shapes();
  shape["inputs"].update(json{{"area_energy", "relative"}, {"bending_edges", "full"}});
  got = run(shape);
  check_term(got.at("energy").at("area"), {2.5, 1});
  check_term(got.at("energy").at("bending"), {4 * 2 / (4 * 0.4096), 150 / (3 * 256.0)});

  soft["inputs"]["edge_force"] = "single";
  CHECK_THAT(message(soft), Catch::Contains("inputs.edge_force is not used by model SP"));
}

TEST_CASE("evaluate rubs a vertex on an edge at either point") {
  json document = square_and_triangle();
  document["inputs"]["mu"] = 3;
  const json vertex{{{0, 0}, {0, 0}, {-1.5, -1.5}, {0, 0}}, {{1.5, 1.5}, {0, 0}, {0, 0}}};
  const json contact{{{0, 0}, {0, 0}, {0.12, -2.04}, {0.18, -3.06}}, {{-0.3, 5.1}, {0, 0}, {0, 0}}};
  check_term(run(document).at("force").at("friction"), vertex);
  document["inputs"]["friction_point"] = "vertex";
  check_term(run(document).at("force").at("friction"), vertex);
  document["inputs"]["friction_point"] = "contact";
  const json got = run(document);
  check_term(got.at("force").at("friction"), contact);
  CHECK(keys(got["energy"]) == std::set<std::string>{"contact"});
}

TEST_CASE("evaluate has the contact of smooth particles, with defaults for the width and the energy") {
  const json got = run(square_and_triangle());  // δ = 0.1 l0 = 0.1, ε_c = 1e4, d = 0.06
  check_term(got.at("energy").at("contact"), 5000 * 0.16);
  check_term(got.at("force").at("contact"), {{{0, 0}, {0, 0}, {0, -16000}, {0, -24000}}, {{0, 40000}, {0, 0}, {0, 0}}});
  check_term(got.at("area"), {1, (0.5 * 0.64 + 0.3 * 0.54) / 2});
}

TEST_CASE("evaluate puts rough particles on a wall") {
  json document =
      json::parse(R"({"model": "DP-rough", "inputs": {"vertices": [[[3, 0.05], [4, 0.05], [4, 1.05], [3, 1.05]]],
    "a0": [1], "l0": [1], "delta": [0.2], "rho": 2, "gravity": [0, -1], "ka": 10, "kl": 0, "kb": 2, "eps_c": 100,
    "hopper": {"W": 10, "w": 2, "theta_deg": 90}}})");
  const json got = run(document);
  CHECK(keys(got["energy"]) == std::set<std::string>{"area", "bending", "contact", "wall", "gravity"});
  check_term(got.at("energy").at("wall"), 2500);
  check_term(got.at("force").at("wall"), {{{0, 5e4}, {0, 5e4}, {0, 0}, {0, 0}}});
  check_term(got.at("energy").at("gravity"), 1.1);
  check_term(got.at("force").at("gravity"), {{{0, -0.5}, {0, -0.5}, {0, -0.5}, {0, -0.5}}});
  check_term(got.at("energy").at("bending"), 2);
  CHECK(got.at("energy").at("contact") == 0.0);

  document["inputs"]["mass"] = {4};
  check_term(run(document).at("energy").at("gravity"), 2.2);
}

TEST_CASE("evaluate lets lips feel edges on request") {
  const std::string model = GENERATE("DP-rough", "DP-smooth");
  json document = square_on_lip(model);
  const json literal = run(document);
  CHECK(keys(literal["force"]) == std::set<std::string>{"contact", "wall", "total"});
  check_term(literal.at("energy").at("wall"), 1800);
  document["inputs"]["lip_contact"] = "literal";
  CHECK(run(document) == literal);
  document["inputs"]["lip_contact"] = "edge";
  const json edge = run(document);
  CHECK(keys(edge["energy"]) == std::set<std::string>{"contact", "wall", "lip"});
  check_term(edge.at("energy").at("lip"), 1800);
  check_term(edge.at("force").at("lip"), {{{0, 6e4}, {0, 6e4}, {0, 0}, {0, 0}}});
  check_term(edge.at("force").at("total"), {{{0, 6e4}, {0, 18e4}, {0, 0}, {0, 0}}});
}

TEST_CASE("evaluate lets vertices of rough particles feel edges on request") {
  json document = square_and_triangle();
  document["model"] = "DP-rough";
  document["inputs"]["delta"] = {0.2, 0.2};  // a disk of radius 0.1 above the edge, at 0.06
  document["inputs"]["eps_c"] = 4e4;
  const json literal = run(document);
  CHECK(keys(literal["force"]) == std::set<std::string>{"contact", "total"});
  CHECK(literal.at("energy").at("contact") == 0.0);
  document["inputs"]["rough_contact"] = "literal";
  CHECK(run(document) == literal);
  document["inputs"]["rough_contact"] = "edge";
  const json edge = run(document);
  CHECK(keys(edge["energy"]) == std::set<std::string>{"contact", "edge"});
  check_term(edge.at("energy").at("edge"), 5000 * 0.16);
  const json force{{{0, 0}, {0, 0}, {0, -16000}, {0, -24000}}, {{0, 40000}, {0, 0}, {0, 0}}};
  check_term(edge.at("force").at("edge"), force);
  check_term(edge.at("force").at("total"), force);
  // Inside, the force would pull further inwards, which vertices alone do not detect.
  document["inputs"]["vertices"][1][0] = {0.4, 0.98};
  CHECK_THAT(message(document), Catch::Contains("inputs.vertices[1][0] lies inside particle 0"));
  document["inputs"]["rough_contact"] = "literal";
  CHECK(message(document) == "no error");
  document["model"] = "DP-smooth";
  CHECK_THAT(message(document), Catch::Contains("inputs.rough_contact is not used by model DP-smooth"));
}

TEST_CASE("evaluate has the contact law of smooth particles") {
  json document = square_and_triangle();  // 0.06 of 0.1: an overlap of 0.4
  check_term(run(document).at("energy").at("contact"), 1e4 / 2 * 0.16);
  document["inputs"]["contact_law"] = "harmonic";
  check_term(run(document).at("energy").at("contact"), 1e4 / 2 * 0.16);
  document["inputs"]["contact_law"] = "barrier";
  const double c = 0.01, x = 0.4;
  const json got = run(document);
  check_term(got.at("energy").at("contact"), 1e4 * ((c * c * std::log(1 + x / c) - std::log(1 - x)) / (1 + c) - x));
  const double f = 1e5 * x * x / ((x + c) * (1 - x));
  check_term(got.at("force").at("contact"), {{{0, 0}, {0, 0}, {0, -0.4 * f}, {0, -0.6 * f}}, {{0, f}, {0, 0}, {0, 0}}});
  document["inputs"]["contact_law"] = "hertz";
  check_term(run(document).at("energy").at("contact"), 1e4 * 0.4 * std::pow(x, 2.5));
  document["inputs"]["contact_law"] = "cubic";
  CHECK(message(document) ==
        "case.json: inputs.contact_law is \"cubic\", but this version has harmonic, hertz, barrier");
  document = square_and_triangle("DP-rough");
  document["inputs"]["contact_law"] = "barrier";
  CHECK(message(document) == "case.json: inputs.contact_law is \"barrier\", but this version has harmonic");
}

TEST_CASE("evaluate shares the drag of a polygon among its vertices") {
  json document = square_and_triangle();
  document["inputs"]["zeta"] = 12;
  check_term(run(document).at("force").at("drag"), {{{0, 0}, {0, 0}, {-3, 0}, {0, -6}}, {{-2, 2}, {0, 0}, {0, 0}}});
}

TEST_CASE("evaluate gives shape energies per particle") {
  json document = shapes();
  const json area{1.25, 5}, perimeter{0.96, 9}, bending{2 * 8 / (8 * 0.64), 2 * 8.8 / 96};
  const json got = run(document);
  CHECK(keys(got) == std::set<std::string>{"area", "energy", "force"});
  CHECK(keys(got["energy"]) == std::set<std::string>{"area", "perimeter", "bending"});
  CHECK(keys(got["force"]) == std::set<std::string>{"area", "perimeter", "bending", "total"});
  check_term(got["area"], {1, 6});
  check_term(got.at("energy").at("area"), area);
  check_term(got.at("energy").at("perimeter"), perimeter);
  check_term(got.at("energy").at("bending"), bending);
  check_term(got.at("force").at("area"),
             {{{2.5, 2.5}, {-2.5, 2.5}, {-2.5, -2.5}, {2.5, -2.5}}, {{20, 15}, {-20, 0}, {0, -15}}});

  document["model"] = GENERATE("DP-rough", "DP-smooth");
  CHECK(run(document).at("energy").at("area") == got.at("energy").at("area"));
  document["inputs"]["kl"] = 0;
  CHECK(keys(run(document)["energy"]) == std::set<std::string>{"area", "bending", "contact"});
  document["inputs"]["shape_terms"] = false;
  CHECK(keys(run(document)["energy"]) == std::set<std::string>{"contact"});
  for (const char* key : {"ka", "kl", "kb"}) document["inputs"].erase(key);
  CHECK(keys(run(document)["energy"]) == std::set<std::string>{"contact"});
}

TEST_CASE("parameters of a case have the names and defaults of runs, and older names") {
  json document = square_and_triangle("smooth");
  document["inputs"].erase("shape_terms");
  std::string remark;
  const json plain = json::parse(evaluate(document, "case.json", &remark).dump());
  CHECK(remark.empty());
  const json defaults{{"k_a", 2e4}, {"k_l", 10}, {"k_b", 0.1}, {"e_c", 1e4}, {"mu", 0}};
  for (const auto& [name, value] : defaults.items()) {
    json same = document, other = document;
    same["inputs"][name] = value;
    CHECK(run(same) == plain);
    other["inputs"][name] = 2 * value.get<double>() + 1;
    CHECK(run(other) != plain);
  }
  json older = document;
  older["inputs"].update(json{{"ka", 2e4}, {"eps_c", 1e4}});
  CHECK(json::parse(evaluate(older, "case.json", &remark).dump()) == plain);
  CHECK_THAT(remark,
             Catch::Contains("case.json: model: ") && Catch::Contains("ka (k_a)") && Catch::Contains("eps_c (e_c)"));
  older["inputs"]["k_a"] = 1;
  CHECK_THAT(message(older), Catch::Contains("inputs.ka is an older name of k_a, which the file also contains"));
  document["inputs"]["wall_diameter"] = 2;
  CHECK_THAT(message(document), Catch::Contains("inputs.wall_diameter is 2, but must be at most 1"));

  // Models under their older names have the rules that [H] prints.
  json rubbing = square_and_triangle("smooth"), printed = square_and_triangle("DP-smooth");
  for (json* one : {&rubbing, &printed}) (*one)["inputs"]["mu"] = 1;
  CHECK(run(rubbing)["force"]["friction"] != run(printed)["force"]["friction"]);
  rubbing["inputs"]["friction_point"] = "vertex";
  CHECK(run(rubbing)["force"]["friction"] == run(printed)["force"]["friction"]);
  evaluate(printed, "case.json", &remark);
  CHECK_THAT(remark, Catch::Contains("DP-smooth (smooth"));
}

TEST_CASE("evaluate takes the fields that it does not use, and null for keys of other models") {
  json document = disks();
  const json plain = run(document);
  document.update(json{{"name", "a"}, {"note", "b"}, {"expected", {{"energy", nullptr}}}});
  document["inputs"].update(json{{"kb", nullptr}, {"vertices", nullptr}});
  CHECK(run(document) == plain);
}

TEST_CASE("evaluate names what is wrong with a document") {
  struct Case {
    json document;
    std::string where;  // JSON pointer; "" keeps the document
    json value;         // discarded: the key is removed
    std::string message;
  };
  const json missing(json::value_t::discarded);
  const double inf = std::numeric_limits<double>::infinity();
  const std::vector<Case> cases{
      // document
      {json::array(), "", {}, "case.json is [], but must be an object"},
      {disks(), "/models", "SP", "case.json: models is not a known key; did you mean model?"},
      {disks(), "/model", missing, "case.json: model is missing"},
      {disks(), "/model", 3, "case.json: model is 3, but must be a text"},
      {disks(), "/model", "disk",
       "case.json: model is \"disk\", but this version has sp, shape, rough, smooth, bubble, "
       "SP, DP, DP-rough, DP-smooth, DP3, DP3-rough"},
      {disks(), "/inputs", missing, "case.json: inputs is missing"},
      {disks(), "/inputs", 1, "case.json: inputs is 1, but must be an object"},
      // keys
      {disks(), "/inputs/sigmas", 1, "inputs.sigmas is not a known key; did you mean sigma?"},
      {disks(), "/inputs/frobnicate", nullptr, "inputs.frobnicate is not a known key; known are velocities, "},
      {disks(), "/inputs/eps_c", 1, "inputs.eps_c is not used by model SP"},
      {shapes(), "/inputs/gravity", {0, -1}, "inputs.gravity is not used by model DP;"},
      {disks(), "/inputs/dim", missing, "inputs.dim is missing"},
      {disks(), "/inputs/positions", nullptr, "inputs.positions is missing"},
      {disks(), "/inputs/sigma", missing, "inputs.sigma is missing"},
      {shapes(), "/inputs/vertices", missing, "inputs.vertices is missing"},
      {shapes(), "/inputs/a0", missing, "inputs.a0 is missing"},
      {shapes(), "/inputs/l0", missing, "inputs.l0 is missing"},
      // types and values
      {disks(), "/inputs/dim", 4, "inputs.dim is 4, but must be 2 or 3"},
      {disks(), "/inputs/dim", 2.5, "inputs.dim is 2.5, but must be 2 or 3"},
      {square_and_triangle(), "/inputs/dim", 3, "inputs.dim must be 2 for polygons"},
      {disks(), "/inputs/mu", "x", "inputs.mu is \"x\", but must be a number"},
      {disks(), "/inputs/mu", true, "inputs.mu is true, but must be a number"},
      {disks(), "/inputs/mu", inf, "inputs.mu is inf, but must be a finite number"},
      {disks(), "/inputs/zeta", std::nan(""), "inputs.zeta is nan, but must be a finite number"},
      {disks(), "/inputs/positions/1/0", 1e200, "inputs.positions[1][0] is 1e+200, but numbers must be within"},
      {disks(), "/inputs/mu", -1, "inputs.mu is -1, but must not be negative"},
      {disks(), "/inputs/zeta", -1, "inputs.zeta is -1, but must not be negative"},
      {disks(), "/inputs/eps_sp", -1, "inputs.eps_sp is -1, but must be positive"},
      {disks(), "/inputs/eps_w", -1, "inputs.eps_w is -1, but must be positive"},
      {disks(), "/inputs/rho", 0, "inputs.rho is 0, but must be positive"},
      {disks(), "/inputs/sigma/1", 0, "inputs.sigma[1] is 0, but must be positive"},
      {disks(), "/inputs/mass/0", -2, "inputs.mass[0] is -2, but must be positive"},
      {disks(), "/inputs/sigma", 1, "inputs.sigma is 1, but must be an array"},
      {shapes(), "/inputs/a0/0", 0, "inputs.a0[0] is 0, but must be positive"},
      {shapes(), "/inputs/l0/1", -1, "inputs.l0[1] is -1, but must be positive"},
      {shapes(), "/inputs/ka", -1, "inputs.ka is -1, but must not be negative"},
      {shapes(), "/inputs/kl", -1, "inputs.kl is -1, but must not be negative"},
      {shapes(), "/inputs/kb", -1, "inputs.kb is -1, but must not be negative"},
      {square_and_triangle(), "/inputs/delta", {1, 0}, "inputs.delta[1] is 0, but must be positive"},
      {square_and_triangle(), "/inputs/eps_c", -1, "inputs.eps_c is -1, but must be positive"},
      {square_and_triangle(), "/inputs/mass", {0, 1}, "inputs.mass[0] is 0, but must be positive"},
      {square_and_triangle(), "/inputs/shape_terms", 0, "inputs.shape_terms is 0, but must be true or false"},
      {square_and_triangle(), "/inputs/friction_point", "edge",
       "inputs.friction_point is \"edge\", but this version has contact, vertex"},
      {square_and_triangle(), "/inputs/lip_contact", 1, "inputs.lip_contact is 1, but must be a text"},
      {square_and_triangle(), "/inputs/lip_contact", "no",
       "inputs.lip_contact is \"no\", but this version has edge, literal"},
      // lengths
      {disks(), "/inputs/positions", json::array(), "inputs.positions is empty"},
      {disks(),
       "/inputs/positions/0",
       {1, 2, 3},
       "inputs.positions[0] has 3 entries, but must have 2, one per coordinate"},
      {disks(), "/inputs/positions/0", 1, "inputs.positions[0] is 1, but must be an array"},
      {disks(), "/inputs/sigma", {1, 1, 1}, "inputs.sigma has 3 entries, but must have 2, one per particle"},
      {disks(), "/inputs/mass", {1}, "inputs.mass has 1 entries, but must have 2, one per particle"},
      {disks(), "/inputs/velocities", {{1, 2}}, "inputs.velocities has 1 entries, but must have 2, one per particle"},
      {disks(), "/inputs/velocities/1", {1}, "inputs.velocities[1] has 1 entries, but must have 2, one per coordinate"},
      {disks(), "/inputs/gravity", {0, 0, -1}, "inputs.gravity has 3 entries, but must have 2, one per coordinate"},
      {ball(), "/inputs/positions/0", {1, 2}, "inputs.positions[0] has 2 entries, but must have 3, one per coordinate"},
      {shapes(), "/inputs/a0", {1}, "inputs.a0 has 1 entries, but must have 2, one per particle"},
      {shapes(), "/inputs/l0", {1, 2, 3}, "inputs.l0 has 3 entries, but must have 2, one per particle"},
      {square_and_triangle(), "/inputs/delta", {1}, "inputs.delta has 1 entries, but must have 2, one per particle"},
      {square_and_triangle(), "/inputs/mass", {1}, "inputs.mass has 1 entries, but must have 2, one per particle"},
      {square_and_triangle(),
       "/inputs/velocities/1",
       {{0, 0}},
       "inputs.velocities[1] has 1 entries, but must have 3, one per vertex"},
      // hoppers
      {disks(), "/inputs/hopper", 5, "inputs.hopper is 5, but must be an object"},
      {disks(), "/inputs/hopper", {{"W", 9}, {"w", 3}}, "inputs.hopper.theta_deg is missing"},
      {disks(),
       "/inputs/hopper",
       {{"W", 9}, {"w", 3}, {"theta", 90}},
       "inputs.hopper.theta is not a known key; did you mean theta_deg?"},
      {disks(),
       "/inputs/hopper",
       {{"W", 9}, {"w", 9}, {"theta_deg", 90}},
       "inputs.hopper.w is 9, but must be less than W = 9"},
      {disks(),
       "/inputs/hopper",
       {{"W", 9}, {"w", 0}, {"theta_deg", 90}},
       "inputs.hopper.w is 0, but must be positive"},
      {disks(),
       "/inputs/hopper",
       {{"W", -9}, {"w", 3}, {"theta_deg", 90}},
       "inputs.hopper.W is -9, but must be positive"},
      {disks(),
       "/inputs/hopper",
       {{"W", 9}, {"w", 3}, {"theta_deg", 91}},
       "inputs.hopper.theta_deg is 91, but must be at most 90"},
      {disks(),
       "/inputs/hopper",
       {{"W", 9}, {"w", 3}, {"theta_deg", 0}},
       "inputs.hopper.theta_deg is 0, but must be positive"},
      {disks(), "/inputs/hopper3d", {{"W", 9}, {"w", 3}}, "inputs.hopper3d is for another dimension than 2"},
      {ball(),
       "/inputs/hopper",
       {{"W", 9}, {"w", 3}, {"theta_deg", 90}},
       "inputs.hopper is for another dimension than 3"},
      {ball(), "/inputs/hopper3d/theta_deg", 90, "inputs.hopper3d.theta_deg is not a known key"},
      // outlines
      {shapes(),
       "/inputs/vertices/1",
       {{0, 0}, {1, 0}},
       "inputs.vertices[1] has 2 vertices, but a polygon needs at least 3"},
      {shapes(),
       "/inputs/vertices/1",
       {{0, 0}, {0, 4}, {3, 0}},
       "inputs.vertices[1] has the signed area -6; give the vertices counter-clockwise"},
      {shapes(), "/inputs/vertices/1", {{0, 0}, {1, 0}, {2, 0}}, "inputs.vertices[1] has the signed area 0"},
      {shapes(),
       "/inputs/vertices/0",
       {{0, 0}, {2, 2}, {2, 0}, {0, 1}},
       "inputs.vertices[0] is an outline that crosses or touches itself"},
      {shapes(), "/inputs/vertices/1/2", {13, 0}, "inputs.vertices[1][1] and the next vertex are the same point"},
      {shapes(), "/inputs/vertices/1/2", {10, 0}, "inputs.vertices[1][2] and the next vertex are the same point"},
      // no direction
      {disks(), "/inputs/positions/1", {0, 0}, "inputs.positions[1] is at no distance from inputs.positions[0]"},
      {disks(),
       "/inputs/hopper",
       {{"W", 1.2}, {"w", 1}, {"theta_deg", 90}},
       "inputs.positions[1] is at no distance from a wall"},
      {square_and_triangle("DP-rough"),
       "/inputs/vertices/1/0",
       {0, 1},
       "inputs.vertices[1][0] is at no distance from inputs.vertices[0][3]"},
      {square_and_triangle(),
       "/inputs/vertices/1/0",
       {0.5, 1},
       "inputs.vertices[1][0] is at no distance from the edge from inputs.vertices[0][2]"},
      {square_and_triangle(), "/inputs/vertices/1/0", {0.4, 0.98}, "inputs.vertices[1][0] lies inside particle 0"},
      {square_and_triangle(), "/inputs/vertices/1/0", {0.4, 0.5}, "inputs.vertices[1][0] lies inside particle 0"},
  };
  for (const Case& c : cases) {
    json document = c.document;
    if (c.value.is_discarded()) {
      const json::json_pointer pointer(c.where);
      document[pointer.parent_pointer()].erase(pointer.back());
    } else if (!c.where.empty()) {
      document[json::json_pointer(c.where)] = c.value;
    }
    if (!c.document.is_array()) REQUIRE(message(c.document) == "no error");
    CAPTURE(c.where, c.value.dump());
    CHECK_THAT(message(document), Catch::StartsWith("case.json") && Catch::Contains(c.message));
  }
}

TEST_CASE("evaluate refuses an edge that lies on a lip only where lips feel edges") {
  json document = square_on_lip("DP-rough");
  document["inputs"]["vertices"] = {{{0.5, -0.5}, {1.5, 0.5}, {0.5, 1.5}}};
  CHECK(message(document) == "no error");
  document["inputs"]["lip_contact"] = "edge";
  CHECK_THAT(message(document), Catch::Contains("a lip of inputs.hopper lies on the edge from inputs.vertices[0][0]"));
}

TEST_CASE("evaluate refuses results beyond the range of numbers") {
  json document = shapes();
  document["inputs"]["ka"] = 1e100;
  document["inputs"]["vertices"][1] = {{0, 0}, {1e90, 0}, {0, 1e90}};
  CHECK_THROWS_AS(evaluate(document, "case.json"), NumericalError);
  CHECK_THROWS_WITH(evaluate(document, "case.json"), Catch::StartsWith("case.json: the energy \"area\" is beyond"));
}

TEST_CASE("to_text writes 17 significant digits") {
  const ordered_json value{
      {"energy", {{"pair", 0.1}}}, {"force", {{"pair", {{1.0 / 3, -2.5}, {1e-300, 6e22}}}}}, {"none", json::object()}};
  CHECK(to_text(value) ==
        "{\n  \"energy\": {\n    \"pair\": 0.10000000000000001\n  },\n  \"force\": {\n    \"pair\": [\n"
        "      [0.33333333333333331, -2.5],\n      [1e-300, 6e+22]\n    ]\n  },\n  \"none\": {}\n}\n");
  const ordered_json result = evaluate(square_and_triangle(), "case.json");
  CHECK(ordered_json::parse(to_text(result)) == result);
}

TEST_CASE("read_case names the file and the place of an error") {
  const std::filesystem::path folder = std::filesystem::temp_directory_path();
  CHECK(reading_message(folder / "pliant_no_such_case.json") == "case file " +
                                                                    (folder / "pliant_no_such_case.json").string() +
                                                                    ": cannot be opened: No such file or directory");
  CHECK(reading_message(folder) ==
        "case file " + folder.string() + " is a folder, not a file; put a file in its place, or name another");

  const auto parse_message = [](const std::string& text) {
    const TemporaryFile file(text);
    const std::string full = reading_message(file.path());
    REQUIRE_THAT(full, Catch::StartsWith(file.path().string() + ": "));
    return full.substr(file.path().string().size() + 2);
  };
  CHECK_THAT(parse_message("{\n  \"mu\": }"),
             Catch::Contains("line 2, column 9") && Catch::Contains("(after key \"mu\")"));
  CHECK_THAT(parse_message("{\"a\": 1, \"zeta\": NaN}"),
             Catch::Contains("line 1, column 18") && Catch::Contains("\"zeta\""));
  CHECK_THAT(parse_message("{\"a\": 1, \"eps_w\": 1e999}"), Catch::Contains("1e999") && Catch::Contains("\"eps_w\""));
  CHECK_THAT(parse_message(""), Catch::Contains("line 1, column 1"));
  CHECK_THAT(parse_message("{} x"), Catch::Contains("line 1, column 4"));

  CHECK_THAT(parse_message(std::string(100, '[')), Catch::Contains("nested deeper than 64"));
  CHECK_THAT(parse_message("{\"a\": {\"mu\": 1}, \"mu\": 1, \"mu\": 1}"), Catch::Contains("\"mu\" occurs twice"));

  const TemporaryFile good("{\"mu\": 1}");
  CHECK(read_case(good.path()) == json{{"mu", 1}});
  if (geteuid() != 0) {  // root can read all files
    std::filesystem::permissions(good.path(), std::filesystem::perms::none);
    CHECK_THAT(reading_message(good.path()), Catch::Contains("cannot be opened"));
  }
}

}  // namespace pliant::test::evaluate_test
