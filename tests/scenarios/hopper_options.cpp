// Consistency of hopper options.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <pliant/model/area.h>
#include <pliant/model/bending.h>
#include <pliant/model/disk_contact.h>
#include <pliant/model/disk_wall_contact.h>
#include <pliant/model/drag.h>
#include <pliant/model/edge_contact.h>
#include <pliant/model/edge_friction.h>
#include <pliant/model/gravity.h>
#include <pliant/model/pair_friction.h>
#include <pliant/model/surface_terms.h>
#include <pliant/scenarios/hopper/options.h>

namespace pliant::test::hopper_options_test {
using Catch::Contains;

namespace {

/// As the program reads them. own: models that it has added.
HopperOptions resolved(const std::vector<std::string>& arguments, const std::vector<ModelDefinition>& own = {}) {
  HopperOptions p(own);
  Options options;
  p.bind(options);
  options.parse(arguments);
  p.resolve();
  p.refuse_unread(options);
  return p;
}

struct Unread {
  const char *option, *value;
  std::vector<std::string> readers;  ///< models
};

}  // namespace

TEST_CASE("rest is slower than the flow that drag and friction allow", "[options]") {
  const auto speed = [](const std::vector<std::string>& arguments) { return *resolved(arguments).clog_speed; };
  CHECK(speed({}) == 1e-3);
  CHECK(speed({"-mu", "31.6"}) == 1e-3);
  const Real small = 1 / 1.2;  // diameter
  CHECK(speed({"-zeta", "2000"}) == Approx(0.1 * pi / 4 * square(small) / 2000));
  CHECK(speed({"-zeta", "2000", "-drag", "per_mass"}) == Approx(0.1 * pi / 4 / 2000));
  CHECK(speed({"-mu", "1500", "-zeta", "500"}) == Approx(0.1 * pi / 4 * square(small) / 2000));
  CHECK(speed({"-dim", "3", "-zeta", "2000", "-size_distribution", "mono"}) == Approx(0.1 * pi / 6 / 2000));
  CHECK(speed({"-zeta", "2000", "-clog_speed", "1e-5"}) == 1e-5);
  CHECK_THROWS_WITH(speed({"-zeta", "2000", "-clog_speed", "1e-3"}), Contains("no particle falls faster than"));
}

TEST_CASE("a continuous flow dissipates", "[options]") {
  const auto zeta = [](const std::vector<std::string>& arguments) { return resolved(arguments).drag(); };
  CHECK(zeta({}) == Approx(std::sqrt(0.1)));
  CHECK(zeta({"-model", "rough"}) == Approx(std::sqrt(0.1)));
  CHECK(zeta({"-mu", "1"}) == 0);
  CHECK(zeta({"-model", "disk"}) == 0);
  CHECK(zeta({"-zeta", "0", "-mu", "1"}) == 0);
  CHECK(zeta({"-zeta", "0", "-flow", "discharge"}) == 0);
  CHECK(zeta({"-zeta", "0", "-hopper_width", "1e-3"}) == 0);
  CHECK_THROWS_WITH(zeta({"-zeta", "0"}), Contains("-mu 0, -zeta 0"));
  CHECK(zeta({"-model", "disk", "-restitution", "1"}) == 0);
  CHECK_THROWS_WITH(zeta({"-model", "disk", "-restitution", "1", "-mu_disk", "0", "-mu_wall", "0"}),
                    Contains("nothing dissipates the energy"));
}

TEST_CASE("automatic values of a hopper", "[options]") {
  const HopperOptions flat = resolved({}), space = resolved({"-dim", "3"});
  CHECK(flat.particles == 1600);
  CHECK(space.particles == 6400);
  CHECK(flat.hopper.wall_distance == 50);
  CHECK(space.hopper.wall_distance == 25);
  CHECK(flat.pack_fraction == 0.84);
  CHECK(space.pack_fraction == 0.64);
  CHECK(flat.t_end == 100);
  CHECK(resolved({"-hopper_q_rtol", "0.1"}).t_end == 10000);
  CHECK(resolved({"-hopper_q_rtol", "0.1", "-t_end", "7"}).t_end == 7);
  CHECK(resolved({"-n", "12", "-hopper_wall_distance", "9", "-pack_fraction", "0.5"}).particles == 12);
  CHECK(resolved({"-hopper_wall_distance", "9"}).hopper.wall_distance == 9);
  CHECK(resolved({"-pack_fraction", "0.5"}).pack_fraction == 0.5);
}

TEST_CASE("standard steps and skins", "[options]") {
  CHECK(resolved({"-mu", "1", "-zeta", "1"}).elastic_fraction(1, 1) == 0.35);
  CHECK(resolved({"-zeta", "1"}).elastic_fraction(1, 1) == 0.4);
  CHECK(resolved({"-flow", "discharge", "-zeta", "0"}).elastic_fraction(1, 1) == 0.2);
  // A discharge: 2 sqrt(ζ/m · limit), from 0.05 to the value of a flow.
  CHECK(resolved({"-zeta", "1", "-flow", "discharge"}).elastic_fraction(0.01, 1) == Approx(0.2));
  CHECK(resolved({"-zeta", "1", "-flow", "discharge"}).elastic_fraction(0.01, 4) == Approx(0.1));
  CHECK(resolved({"-zeta", "1", "-flow", "discharge"}).elastic_fraction(1, 1) == 0.4);
  CHECK(resolved({"-zeta", "1", "-flow", "discharge"}).elastic_fraction(1e-6, 1) == 0.05);
  CHECK(resolved({"-zeta", "1", "-flow", "discharge", "-model", "rough"}).elastic_fraction(1, 1) == 0.2);
  CHECK(resolved({"-model", "disk"}).elastic_fraction(1, 1) == 0.2);
  CHECK(resolved({"-model", "disk", "-zeta", "1"}).elastic_fraction(1, 1) == 0.2);
  CHECK(resolved({}).first_skin() == 0.3);
  CHECK(resolved({"-dim", "3"}).first_skin() == 0.2);
  CHECK(resolved({"-model", "smooth"}).first_skin() == 0.06);
  CHECK(resolved({"-skin", "0.11"}).first_skin() == 0.11);
}

TEST_CASE("what disks of a hopper are made of", "[options]") {
  const HopperOptions usual = resolved({"-model", "disk"});
  const PairContact<2> contact = usual.model.term(PairContact<2>{}, contact_energy::disk);
  CHECK(contact.epsilon == 1e4);
  CHECK(usual.model.term(WallContact<2>{}).epsilon == 1e4);
  const auto coefficients = [](const SurfaceFriction& f) {
    return std::array{f.mu_static, f.mu_dynamic, f.stiffness, f.damping, f.tangential_damping};
  };
  using Pair = DiskContact;
  using Wall = DiskWallContact;
  const std::array standard{0.4, 0.4, SurfaceFriction().stiffness, damping_for(ContactLaw::harmonic, 0.5),
                            SurfaceFriction().tangential_damping};
  CHECK(coefficients(usual.model.term(Pair{}).surface) == standard);
  CHECK(coefficients(usual.model.term(Wall{}).surface) == standard);

  const HopperOptions p = resolved({"-model",
                                    "disk",
                                    "-e_disk",
                                    "11",
                                    "-e_w",
                                    "12",
                                    "-mu_disk",
                                    "0.9",
                                    "-mu_disk_dynamic",
                                    "0.8",
                                    "-mu_wall",
                                    "0.7",
                                    "-mu_wall_dynamic",
                                    "0.6",
                                    "-restitution",
                                    "0.3",
                                    "-tangential_stiffness",
                                    "0.2",
                                    "-tangential_damping",
                                    "0.1",
                                    "-zeta",
                                    "0.05",
                                    "-contact_law",
                                    "hertz"});
  CHECK(p.model.term(PairContact<2>{}, contact_energy::disk).epsilon == 11);
  const Wall wall = p.model.term(Wall{});
  CHECK(wall.epsilon == 12);
  CHECK(p.drag() == 0.05);
  CHECK(p.model.choice(Role::contact_law) == "hertz");
  CHECK(coefficients(p.model.term(Pair{}).surface) ==
        std::array{0.9, 0.8, 0.2, damping_for(ContactLaw::harmonic, 0.3), 0.1});
  CHECK(coefficients(wall.surface) == std::array{0.7, 0.6, 0.2, damping_for(ContactLaw::harmonic, 0.3), 0.1});
  CHECK(p.model.option(Role::contact_energy) == "-e_disk");

  // The dynamic coefficient is the static one of the same surfaces.
  const HopperOptions rough = resolved({"-model", "disk", "-mu_disk", "0.2", "-mu_wall", "0.6"});
  CHECK(rough.model.term(Pair{}).surface.mu_dynamic == 0.2);
  CHECK(rough.model.term(Wall{}).surface.mu_dynamic == 0.6);
}

TEST_CASE("parameters of the same name in 2D and 3D have separate defaults, units and readers", "[options]") {
  const auto json_of = [](const std::vector<std::string>& arguments) {
    HopperOptions p;
    Options options;
    p.bind(options);
    options.parse(arguments);
    p.resolve();
    return options.json();
  };
  const nlohmann::json plane = json_of({"-model", "rough"}), space = json_of({"-model", "rough", "-dim", "3"});
  CHECK(plane["k_a"]["value"] == 2e4);
  CHECK(space["k_a"]["value"] == 50);
  CHECK(plane["k_a"]["is_default"] == true);
  CHECK(space["k_a"]["is_default"] == true);
  CHECK(plane["k_a"]["unit"] == "rho g/sigma_avg");
  CHECK(space["k_a"]["unit"] == "rho g sigma_avg^2");
  CHECK(space["k_v"]["unit"] == "rho g/sigma_avg^2");
  CHECK(plane["k_b"]["value"] == space["k_b"]["value"]);
  CHECK(plane["e_c"]["unit"] == space["e_c"]["unit"]);
  CHECK(plane["k_v"]["term"].is_null());
  CHECK(space["k_v"]["term"] == "volume");
  CHECK(plane["area_energy"]["term"] == "area");
  CHECK(space["area_energy"]["term"].is_null());
  CHECK(plane["n_vertices"]["value"] == 16);
  CHECK(space["n_vertices"]["value"] == 42);
  CHECK(json_of({"-model", "rough", "-k_a", "20000"})["k_a"]["is_default"] == true);
  CHECK(json_of({"-model", "rough", "-dim", "3", "-k_a", "20000"})["k_a"]["is_default"] == false);
  // The terms get these values.
  const HopperOptions rough = resolved({"-model", "rough", "-dim", "3", "-k_l", "7"});
  CHECK(rough.model.term(FaceArea{}).k_a == 50);
  CHECK(rough.model.term(EdgeLength{}).k_l == 7);
  CHECK(rough.model.value(Role::area) == 50);
  CHECK(rough.model.parameters(Role::lip_rule).size() == 1);
}

TEST_CASE("options of a hopper that contradict each other", "[options]") {
  const auto refused = [](const std::vector<std::string>& arguments, const std::string& says) {
    CAPTURE(arguments);
    CHECK_THROWS_AS(resolved(arguments), InputError);
    CHECK_THROWS_WITH(resolved(arguments), Contains(says));
  };
  refused({"-model", "rough", "-k_v", "5"}, "-k_v (command line) with -model rough in 2D");
  refused({"-model", "rough", "-dim", "3", "-bending_edges", "full"},
          "-bending_edges (command line) with -model rough in 3D");
  refused({"-model", "rough", "-n_vertices", "2"}, "-n_vertices 2: a particle needs at least 3");
  refused({"-contact_law", "barrier", "-model", "disk"}, "-contact_law barrier with -model disk");
  refused({"-dynamics", "overdamped", "-integrator", "ts", "-zeta", "1", "-model", "disk"},
          "-model disk, which needs inertia");
  refused({"-model", "disk", "-mu_disk", "0.2", "-mu_disk_dynamic", "0.3"},
          "-mu_disk_dynamic 0.3 is more than -mu_disk");
  refused({"-model", "disk", "-mu_wall", "0.2", "-mu_wall_dynamic", "0"}, "-mu_wall_dynamic 0 with -mu_wall 0.2");
  refused({"-contact_law", "barrier"}, "-contact_law barrier with -model sp");
  refused({"-wall_diameter", "0.6", "-hopper_width", "0.5"}, "leave no gap");
  refused({"-contact_law", "linear", "-model", "smooth"}, "only -model sp has it");
  refused({"-contact_law", "barrier", "-model", "smooth", "-dim", "3"}, "only -model smooth in 2D has it");
  refused({"-model", "rough", "-dim", "3", "-gamma", "2", "-k_a", "0", "-k_l", "0"}, "gamma 2 with k_a 0 and k_l 0");
  refused({"-contact_law", "hertz", "-model", "rough"}, "-contact_law hertz with -model rough");
  refused({"-model", "rough", "-shape_parameter", "1", "-n_vertices", "6"}, "-shape_parameter 1: no polygon of 6");
  refused({"-implicit", "shape"}, "-integrator verlet");
  refused({"-dynamics", "overdamped", "-zeta", "1"}, "-integrator ts");
  refused({"-dynamics", "overdamped", "-integrator", "ts", "-zeta", "0", "-flow", "discharge"}, "-zeta 0");
  refused({"-dynamics", "overdamped", "-integrator", "ts", "-zeta", "1", "-mu", "1"}, "-mu 1");
  refused({"-hopper_q_rtol", "0.1", "-flow", "discharge"}, "-flow discharge");
}

TEST_CASE("an option that the model does not read is refused where it is given", "[options]") {
  const std::vector<Unread> table{{"e_sp", "50", {"sp"}},
                                  {"e_c", "50", {"rough", "smooth"}},
                                  {"k_a", "5", {"rough", "smooth"}},
                                  {"k_l", "5", {"rough", "smooth"}},
                                  {"k_b", "5", {"rough", "smooth"}},
                                  {"area_energy", "relative", {"rough", "smooth"}},
                                  {"bending_edges", "full", {"rough", "smooth"}},
                                  {"edge_force", "twofold", {"smooth"}},
                                  {"n_vertices", "8", {"rough", "smooth"}},
                                  {"shape_parameter", "1.2", {"rough", "smooth"}},
                                  {"lip_contact", "literal", {"rough", "smooth"}},
                                  {"rough_contact", "edge", {"rough"}},
                                  {"edge_width", "0.2", {"smooth"}},
                                  {"friction_point", "vertex", {"smooth"}},
                                  {"e_w", "50", {"sp", "rough", "smooth", "disk"}},
                                  {"mu", "1", {"sp", "rough", "smooth"}},
                                  {"friction", "tangential", {"sp", "rough", "smooth"}},
                                  {"wall_diameter", "0.2", {"sp", "rough", "smooth"}},
                                  {"drag", "per_mass", {"sp", "rough", "smooth", "disk"}},
                                  {"e_disk", "50", {"disk"}},
                                  {"mu_disk", "0.5", {"disk"}},
                                  {"mu_disk_dynamic", "0.3", {"disk"}},
                                  {"mu_wall", "0.5", {"disk"}},
                                  {"mu_wall_dynamic", "0.3", {"disk"}},
                                  {"restitution", "0.9", {"disk"}},
                                  {"tangential_stiffness", "0.4", {"disk"}},
                                  {"tangential_damping", "0", {"disk"}}};
  for (const Unread& row : table)
    for (const std::string model : {"sp", "rough", "smooth", "disk"}) {
      const std::vector<std::string> arguments{"-model", model, std::string("-") + row.option, row.value};
      CAPTURE(arguments);
      if (std::find(row.readers.begin(), row.readers.end(), model) != row.readers.end()) {
        CHECK_NOTHROW(resolved(arguments));
        continue;
      }
      CHECK_THROWS_AS(resolved(arguments), InputError);
      CHECK_THROWS_WITH(resolved(arguments),
                        Contains(std::string("-") + row.option + " (command line) with -model " + model) &&
                            Contains(row.readers.front()));
    }
  CHECK_NOTHROW(resolved({"-size_distribution", "normal", "-size_deviation", "0.2"}));
  CHECK_THROWS_AS(resolved({"-size_distribution", "mono", "-size_ratio", "2"}), InputError);
  CHECK_THROWS_AS(resolved({"-size_deviation", "0.2"}), InputError);
  CHECK_THROWS_AS(resolved({"-jacobian", "assembled"}), InputError);
  for (const std::vector<std::string>& option : std::vector<std::vector<std::string>>{
           {"-count", "removal"}, {"-reinsertion_gap", "1"}, {"-reinsertion_lateral_speed", "0.1"}}) {
    CAPTURE(option);
    CHECK_NOTHROW(resolved(option));
    CHECK_THROWS_WITH(resolved({"-flow", "discharge", option[0], option[1]}), Contains("-flow continuous"));
  }
  CHECK(resolved({"-flow", "discharge", "-removal_depth", "2.5"}).removal_depth == 2.5);
}

TEST_CASE("what differs from the printed model reaches the model, and nothing does unless it is asked for",
          "[options]") {
  const HopperOptions printed = resolved({});
  const ModelChoice& p = printed.model;
  CHECK(p.choice(Role::contact_law) == "harmonic");
  CHECK(p.term(PairFriction<2>{}).friction == Friction::whole);
  CHECK(p.term(Drag<2>{}).law == DragLaw::per_particle);
  CHECK(p.term(WallContact<2>{}).thickness == 0);
  CHECK(p.term(Area{}).form == AreaEnergy::absolute);
  CHECK(p.term(Bending{}).edges == EdgeVectors::unit);
  CHECK(p.term(EdgeContact{}).force == EdgeForce::single);
  CHECK(printed.counting == Counting::crossing);
  CHECK(!printed.removal_depth);
  CHECK(printed.reinsertion.gap == 0);
  CHECK(!printed.reinsertion.lateral_speed);
  CHECK(printed.reinsertion.clearance == 0);

  CHECK(resolved({"-contact_law", "linear"}).model.choice(Role::contact_law) == "linear");
  const HopperOptions run = resolved({"-model",
                                      "smooth",
                                      "-friction",
                                      "tangential",
                                      "-drag",
                                      "per_mass",
                                      "-wall_diameter",
                                      "0.2",
                                      "-area_energy",
                                      "relative",
                                      "-bending_edges",
                                      "full",
                                      "-edge_force",
                                      "twofold",
                                      "-count",
                                      "removal",
                                      "-removal_depth",
                                      "2.5",
                                      "-reinsertion_gap",
                                      "0.8",
                                      "-reinsertion_lateral_speed",
                                      "0.01"});
  const ModelChoice& q = run.model;
  CHECK(q.term(EdgeFriction{}).friction == Friction::tangential);
  CHECK(q.term(Drag<2>{}).law == DragLaw::per_mass);
  CHECK(q.term(WallContact<2>{}).thickness == 0.2);
  CHECK(q.term(Area{}).form == AreaEnergy::relative);
  CHECK(q.term(Bending{}).edges == EdgeVectors::full);
  CHECK(q.term(EdgeContact{}).force == EdgeForce::twofold);
  CHECK(run.counting == Counting::removal);
  CHECK(run.removal_depth == 2.5);
  CHECK(run.reinsertion.gap == 0.8);
  CHECK(run.reinsertion.lateral_speed == 0.01);
  CHECK(run.reinsertion.clearance == 0.1);
}

namespace {

/// A model with weight only, times a factor that is a user-defined parameter; in 2D and in 3D.
struct Heavy {
  template <int D>
  std::unique_ptr<ForceField<D>> force_field(ParameterReader& p, const Surroundings<D>& s) const {
    p.begin("gravity");
    const Real factor = p.number({.name = "factor", .help = "of gravity", .value = 2});
    return std::make_unique<Model<D, Gravity<D>>>(Gravity<D>{factor * s.gravity});
  }
};

/// Polygons with a contact, in 2D.
struct Touching {
  static std::unique_ptr<ForceField<2>> force_field(ParameterReader& p, const Surroundings<2>&) {
    return std::make_unique<Model<2, PairContact<2>>>(
        configured(p, PairContact<2>{0, "contact"}, contact_energy::deformable));
  }
};

/// Declares a parameter of the catalogue once more, with another default.
struct Rival {
  static std::unique_ptr<ForceField<2>> force_field(ParameterReader& p, const Surroundings<2>& s) {
    p.number({.name = "k_a", .help = "area stiffness K_a", .value = 1});
    return Heavy().force_field(p, s);
  }
};

}  // namespace

TEST_CASE("a model that a program adds", "[options]") {
  const std::vector<ModelDefinition> own{own_model<Heavy>("heavy", "weight alone", ModelKind::sp),
                                         own_model<Touching>("touching", "contact alone", ModelKind::rough)};
  const auto weight = [&](const std::vector<std::string>& arguments) {
    const HopperOptions p = resolved(arguments, own);
    CHECK(p.model.particles() == ModelKind::sp);
    Topology t;
    t.add_soft(1, 3);
    const std::vector<Real> x(3, 0.0);
    Neighbours<2> lists(p.force_field<2>({0, -1})->needs(), 0.1);
    lists.rebuild(t, {}, x.data());
    return p.force_field<2>({0, -1})->energy({x.data(), nullptr, t, lists, {}}) -
           p.force_field<2>({0, -1})->energy({std::vector<Real>{0, 1}.data(), nullptr, t, lists, {}});
  };
  CHECK(weight({"-model", "heavy"}) == -6);
  CHECK(weight({"-model", "heavy", "-factor", "5"}) == -15);
  CHECK(resolved({"-model", "heavy", "-dim", "3"}, own).force_field<3>({0, 0, -1}) != nullptr);
  const HopperOptions touching = resolved({"-model", "touching", "-e_c", "7", "-n_vertices", "9"}, own);
  CHECK(touching.model.particles() == ModelKind::rough);
  CHECK(touching.model.value(Role::contact_energy) == 7);
  CHECK(touching.first_skin() == 0.1);
  CHECK_THROWS_WITH(touching.force_field<3>({0, 0, -1}), Contains("-model touching does not exist in 3D"));

  const auto refused = [&](const std::vector<std::string>& arguments, const std::string& says) {
    CAPTURE(arguments);
    CHECK_THROWS_AS(resolved(arguments, own), InputError);
    CHECK_THROWS_WITH(resolved(arguments, own), Contains(says));
  };
  refused({"-model", "touching", "-factor", "2"}, "-factor (command line) with -model touching");
  refused({"-factor", "2"}, "-model sp, which does not read it; leave it out, or use -model heavy");
  refused({"-model", "heavy", "-mu", "1"}, "-mu (command line) with -model heavy");
  refused({"-model", "touching", "-k_a", "1"}, "use -model rough or smooth");
  refused({"-e_c", "1"}, "use -model rough, smooth or touching");
  refused({"-model", "touching", "-dim", "3"}, "-model touching does not exist in 3D");
  refused({"-model", "heave"}, "heavy");
  CHECK_THROWS_AS(HopperOptions({own_model<Rival>("rival", "", ModelKind::sp)}), std::logic_error);
  CHECK_THROWS_AS(resolved({"-factor", "2"}), InputError);  // unknown without the model
}

}  // namespace pliant::test::hopper_options_test
