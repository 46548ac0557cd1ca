// A user-defined model, `line_tension`, with a user-defined term (line_tension.h), in addition to the models of pliant.
// The scenario hopper runs the model with the command line, files, restarts and figures of pliant:
//   own_term hopper -model line_tension -tension 20 -output runs/tension
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

/// Polygons with a preferred area and a line tension instead of a preferred perimeter. Their outlines touch like the
/// outlines of smooth particles.
struct TensePolygons {
  static std::unique_ptr<ForceField<2>> force_field(ParameterReader& p, const Surroundings<2>& s) {
    using Outlines = Fused<EdgeKernel, EdgeContact, EdgeFriction>;
    using Outer = Fused<PointKernel, Gravity<2>, Drag<2>>;
    const auto area = configured(p, Area{});
    const auto tension = configured(p, LineTension{});
    const auto contact = configured(p, EdgeContact{});
    const auto friction = configured(p, EdgeFriction{});
    const auto wall = configured(p, WallContact<2>{});
    const auto lip = configured(p, LipContact{});
    const auto drag = configured(p, Drag<2>{});
    return std::make_unique<Model<2, Area, LineTension, Outlines, WallContact<2>, LipContact, Outer>>(
        area, tension, Outlines(contact, friction), wall, lip, Outer({s.gravity}, drag));
  }
};

Scenario check_scenario() {
  return {.name = "check",
          .help = "derivatives of the line tension, and a polygon at rest",
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
      {hopper_scenario({own_model<TensePolygons>("line_tension", "polygons with a line tension", ModelKind::smooth)}),
       check_scenario()});
}
