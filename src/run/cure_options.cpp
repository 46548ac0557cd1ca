#include <pliant/run/cure_options.h>

#include <map>
#include <vector>

namespace pliant {

std::string option_for(Cure cure, const Options& options) {
  static const std::map<Cure, std::vector<std::string>> table{
      {Cure::shorter_step, {"dt"}},
      {Cure::stiffer_contacts, {"stiffness"}},
      {Cure::stiffer_walls, {"stiffness"}},
      {Cure::softer_particles, {"stiffness"}},
      {Cure::more_particles, {"n"}},
      {Cure::wider_container, {"hopper_wall_distance", "channel_width"}},
      {Cure::narrower_orifice, {"hopper_width"}},
      {Cure::own_outline, {"outline"}},
      {Cure::wider_obstacles, {"obstacle"}},
      {Cure::no_reinsertion, {"flow"}},
      {Cure::rounder_shape, {"shape_parameter"}},
      {Cure::even_vertices, {"n_vertices"}},
      {Cure::more_vertices, {"n_vertices"}},
      {Cure::smaller_aspect, {"aspect"}},
      {Cure::ts, {"integrator"}},
      {Cure::other_folder, {"output"}},
  };
  if (const std::string name = options.curing(cure); !name.empty()) return name;
  const auto found = table.find(cure);
  if (found == table.end()) return "";
  const nlohmann::json known = options.json();
  for (const std::string& name : found->second)
    if (known.contains(name)) return name;
  return "";
}

}  // namespace pliant
