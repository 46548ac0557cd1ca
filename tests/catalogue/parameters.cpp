// A term declares its parameters once; options, units, refusals and the manifest follow.
#include <catch2/catch.hpp>

#include <array>
#include <set>
#include <string>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/catalogue/model_choice.h>
#include <pliant/catalogue/parameter_values.h>
#include <pliant/model/gravity.h>

namespace pliant::test::parameters_test {
using Catch::Contains;

namespace {

enum class Way { down, up };

/// Weight with parameters of all kinds.
struct Push {
  Real strength = 0, limit = 0;
  Way way = Way::down;
  bool twice = false;

  static std::string_view name() { return "push"; }
  void read(ParameterReader& p) {
    strength = p.number({.name = "strength",
                         .symbol = "F_p",
                         .unit = dimension::energy,
                         .help = "strength of the push",
                         .value = 3,
                         .max = 9,
                         .role = Role::contact_energy});
    limit = p.automatic({.name = "limit", .help = "its limit", .automatic = "twice the strength"}, 2 * strength);
    way = p.choice({.name = "way", .help = "where to", .printed = "up"},
                   named<Way>({{"down", Way::down}, {"up", Way::up}}));
    twice = p.flag({.name = "twice", .help = "do it twice"});
  }
};

Push last;  // as the model has read it

struct Pushed {
  static std::unique_ptr<ForceField<2>> force_field(ParameterReader& p, const Surroundings<2>& s) {
    last = configured(p, Push{});
    return std::make_unique<Model<2, Gravity<2>>>(Gravity<2>{s.gravity});
  }
};

/// As a scenario offers models, once options have been read.
struct Offer {
  ModelChoice choice{
      {own_model<Pushed>("pushed", "weight that is pushed", ModelKind::sp), catalogue_model(ModelKind::rough)}};
  Options options;

  explicit Offer(const std::vector<std::string>& arguments = {}) {
    choice.bind(options, UnitSystem::gravitational());
    options.parse(arguments);
    choice.refuse_unread(options);
    choice.resolve<2>({});
  }
};

}  // namespace

TEST_CASE("a parameter that a term declares is an option, with its range, unit and default") {
  Offer usual;
  CHECK(last.strength == 3);
  CHECK(last.limit == 6);
  CHECK(last.way == Way::down);
  CHECK(!last.twice);
  CHECK_THAT(usual.options.help(), Contains("strength of the push [") &&
                                       Contains("[rho g sigma_avg^3; default 3; ≥ 0, ≤ 9; -model pushed]") &&
                                       Contains("default twice the strength") && Contains("-way <down|up>"));

  Offer given({"-strength", "4", "-way", "up", "-twice"});
  CHECK(given.choice.force_field<2>({}) != nullptr);
  CHECK(last.strength == 4);
  CHECK(last.limit == 8);
  CHECK(last.way == Way::up);
  CHECK(last.twice);
  Offer limited({"-limit", "1"});
  CHECK(last.limit == 1);

  CHECK_THROWS_WITH(Offer({"-strength", "10"}), Contains("at most 9"));
  CHECK_THROWS_WITH(Offer({"-way", "left"}), Contains("must be one of down, up"));
  CHECK_THROWS_WITH(Offer({"-model", "rough", "-strength", "1"}),
                    Contains("-strength (command line) with -model rough, which does not read it; leave it out, or use "
                             "-model pushed"));
}

TEST_CASE("the manifest says which term reads a parameter, and whether its value is the default") {
  const Offer given({"-strength", "4", "-twice", "no"});
  const auto json = given.options.json();
  CHECK(json["strength"]["term"] == "push");
  CHECK(json["strength"]["symbol"] == "F_p");
  CHECK(json["strength"]["unit"] == "rho g sigma_avg^3");
  CHECK(json["strength"]["is_default"] == false);
  CHECK(json["twice"]["is_default"] == true);
  CHECK(json["limit"]["value"] == 8);
  CHECK(json["limit"]["is_default"] == true);
  CHECK(json["k_a"]["term"].is_null());  // the model does not read it
  CHECK(!json["model"].contains("term"));
  const Offer rough({"-model", "rough"});
  CHECK(rough.options.json()["k_a"]["term"] == "area");
  CHECK(rough.options.json()["strength"]["term"].is_null());
}

TEST_CASE("scenarios speak of parameters by their roles") {
  Offer offer;
  CHECK(offer.choice.option(Role::contact_energy) == "-strength");
  CHECK(offer.choice.value(Role::contact_energy) == 3);
  CHECK(offer.choice.option(Role::wall_energy).empty());
  offer.choice.name = "rough";
  CHECK(offer.choice.option(Role::contact_energy) == "-e_c");
  CHECK(offer.choice.options({Role::perimeter, Role::bending}) == "-k_l or -k_b");

  // A parameter that the scenario sets is not an option.
  ModelChoice choice({catalogue_model(ModelKind::bubble)});
  choice.keep(Role::mean_radius);
  Options options;
  choice.bind(options, UnitSystem::droplets());
  CHECK(!options.json().contains("R_mean"));
  CHECK(options.json().contains("phi_c"));
}

TEST_CASE("values of parameters by name or role") {
  ParameterValues values{{Role::contact_energy, 5.0}, {"way", std::string("up")}, {"twice", 1.0}};
  const Push push = configured(values, Push{});
  CHECK(push.strength == 5);
  CHECK(push.limit == 10);
  CHECK(push.way == Way::up);
  CHECK(push.twice);
  values.set("way", std::string("left"));
  CHECK_THROWS_WITH(configured(values, Push{}), Contains("way is left, but must be one of down, up"));
}

TEST_CASE("units follow from dimensions") {
  const UnitSystem g = UnitSystem::gravitational(), drop = UnitSystem::droplets(), cgs = UnitSystem::cgs();
  CHECK(g.text(dimension::energy, 0) == "rho g sigma_avg^(d+1)");
  CHECK(g.text(dimension::energy, 3) == "rho g sigma_avg^4");
  CHECK(g.text({1, -5, 0}, 3) == "rho g/sigma_avg^2");
  CHECK(g.text(dimension::force, 0) == "rho g sigma_avg^d");
  CHECK(g.text(dimension::energy, 2) == "rho g sigma_avg^3");
  CHECK(g.text({1, -3, 0}, 2) == "rho g/sigma_avg");
  CHECK(g.text({1, -1, 0}, 2) == "rho g sigma_avg");
  CHECK(g.text({1, 3, 0}, 2) == "rho g sigma_avg^5");
  CHECK(g.text(dimension::drag, 0) == "rho g sigma_avg^(d-1) t0");
  CHECK(g.text(dimension::length, 0) == "sigma_avg");
  CHECK(g.text(dimension::number, 0).empty());
  CHECK(drop.text(dimension::energy, 2) == "F R");
  CHECK(drop.text(dimension::drag, 2) == "F t0/R");
  CHECK(cgs.text({1, -1, 0}, 2) == "g/s^2");
  CHECK(cgs.text(dimension::drag, 2) == "g/s");
  CHECK(cgs.text(dimension::acceleration, 2) == "cm/s^2");
  CHECK(cgs.text({0, 0, -1}, 2) == "1/s");
}

TEST_CASE("all parameters of the catalogue say what they are, once") {
  for (const bool substrate : {false, true}) {
    ParameterTable table({.substrate = substrate, .rest_outlines = substrate});
    for (const ModelKind kind :
         {ModelKind::sp, ModelKind::rough, ModelKind::smooth, ModelKind::shape, ModelKind::bubble, ModelKind::disk})
      if (!substrate || kind == ModelKind::rough || kind == ModelKind::disk) table.declare(catalogue_model(kind));
    std::set<std::string> names;
    for (const ParameterTable::Entry& entry : table.entries()) {
      CAPTURE(entry.name);
      CHECK(names.insert(entry.name).second);
      CHECK(!entry.help.empty());
      CHECK(entry.help.size() <= 160);
      for (const ParameterTable::Reading& reading : entry.readings)
        CHECK((!reading.term.empty() || entry.role == Role::contact_law));
    }
    CHECK(names.size() > 20);
  }
}

}  // namespace pliant::test::parameters_test
