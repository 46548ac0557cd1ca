// A model with a term of its own (line_tension.h), under the name `droplet` beside the models of pliant: the scenario
// hopper runs it, with the command line, files, restarts and figures of pliant:
//   own_term hopper -model droplet -tension 20 -output runs/droplets
//   own_term check 2     checks the term
#include <charconv>

#include <pliant/model/fused_terms.h>
#include <pliant/model/lip_contact.h>
#include <pliant/run/scenario.h>
#include <pliant/scenarios/hopper/hopper.h>

#include "check.h"
#include "line_tension.h"

namespace {
using namespace pliant;

/// Polygons with a preferred area and a line tension instead of a preferred perimeter. Their outlines touch as those of
/// smooth particles do.
struct Droplet {
  Real tension = 20;

  void bind(Options& o) {
    o.bind("tension", tension,
           {.help = "line tension gamma", .unit = "rho g sigma_avg^2", .min = 0, .on_restart = OnRestart::fixed});
  }
  std::unique_ptr<ForceField<2>> force_field(const ModelParameters& p, const pliant::Vec<2>& gravity) const {
    using Outlines = Fused<EdgeKernel, EdgeContact<>, EdgeFriction>;
    using Outer = Fused<PointKernel, Gravity<2>, Drag<2>>;
    return std::make_unique<Model<2, Area, LineTension, Outlines, WallContact<2>, LipContact<>, Outer>>(
        Area{p.k_a}, LineTension{tension}, Outlines({p.epsilon}, {p.mu, p.friction_point}),
        WallContact<2>{p.epsilon_wall}, LipContact<>{p.epsilon_wall, p.lip_edges}, Outer({gravity}, {p.zeta}));
  }
};

Scenario check_scenario() {
  return {.name = "check",
          .help = "derivatives of the line tension, and a droplet at rest",
          .arguments = "TENSION",
          .run = [](const Arguments& arguments, const Ranks& ranks) {
            const std::string text = arguments.size() == 1 ? arguments[0] : "";
            Real tension = 0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), tension);
            if (error != std::errc() || end != text.data() + text.size() || !(tension > 0))
              throw InputError("usage: {} check TENSION, a positive number", program_name());
            const bool good = ranks.broadcast(ranks.root() && check::passes(tension));
            return good ? ExitCode::done : ExitCode::numerical_failure;
          }};
}

}  // namespace

int main(int argc, char** argv) {
  return run_program(
      argc, argv,
      {hopper_scenario({own_model<Droplet>("droplet", "droplets with a line tension", ModelKind::smooth,
                                           {"e_c", "e_w", "k_a", "mu", "friction_point", "zeta", "lip_contact"})}),
       check_scenario()});
}
