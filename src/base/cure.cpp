#include <pliant/base/cure.h>

#include <utility>
#include <vector>

#include <fmt/format.h>

#include <pliant/base/text.h>

namespace pliant {
namespace {

thread_local std::function<std::string(Cure)> option_of;

const char* phrase(Cure cure) {
  switch (cure) {
    case Cure::shorter_step:
      return "a shorter step";
    case Cure::stiffer_contacts:
      return "stiffer contacts";
    case Cure::stiffer_walls:
      return "stiffer walls";
    case Cure::softer_particles:
      return "softer particles";
    case Cure::edge_contacts:
      return "contacts with edges";
    case Cure::contact_barrier:
      return "a contact barrier";
    case Cure::more_particles:
      return "more particles";
    case Cure::wider_container:
      return "a wider container";
    case Cure::narrower_orifice:
      return "a narrower orifice";
    case Cure::wider_orifice:
      return "a wider orifice";
    case Cure::other_angle:
      return "another angle of the walls";
    case Cure::own_outline:
      return "an outline from a file";
    case Cure::wider_obstacles:
      return "more room between obstacles";
    case Cure::no_reinsertion:
      return "a flow without reinsertion";
    case Cure::rounder_shape:
      return "a smaller shape parameter";
    case Cure::even_vertices:
      return "an even number of vertices";
    case Cure::more_vertices:
      return "more vertices";
    case Cure::smaller_aspect:
      return "a smaller aspect ratio";
    case Cure::equal_sizes:
      return "more equal sizes";
    case Cure::weaker_attraction:
      return "a lower depletion energy";
    case Cure::less_overlap:
      return "less overlap at the start";
    case Cure::smaller_load:
      return "a smaller load";
    case Cure::two_dimensions:
      return "two dimensions";
    case Cure::three_dimensions:
      return "three dimensions";
    case Cure::verlet:
      return "velocity Verlet";
    case Cure::ts:
      return "PETSc TS";
    case Cure::split_forces:
      return "implicit shape energies alone";
    case Cure::whole_forces:
      return "one treatment of all forces";
    case Cure::drag:
      return "drag";
    case Cure::no_compression:
      return "no compression";
    case Cure::other_folder:
      return "another folder";
  }
  return "";
}

}  // namespace

std::string cures(std::initializer_list<Cure> several) {
  std::vector<std::string> phrases, with_options;
  for (const Cure cure : several) {
    phrases.emplace_back(phrase(cure));
    if (const std::string option = option_of ? option_of(cure) : ""; !option.empty())
      with_options.push_back(fmt::format("{} (-{})", phrase(cure), option));
  }
  return alternatives(with_options.empty() ? phrases : with_options);
}

CureOptions::CureOptions(std::function<std::string(Cure)> option) { option_of = std::move(option); }
CureOptions::~CureOptions() { option_of = nullptr; }

}  // namespace pliant
