// Cures that messages advise. A lower layer names the cure; the running scenario adds its option.
#pragma once

#include <functional>
#include <initializer_list>
#include <string>

namespace pliant {

enum class Cure {
  shorter_step,
  stiffer_contacts,
  stiffer_walls,
  softer_particles,
  edge_contacts,    ///< let vertices touch edges, not only vertices
  contact_barrier,  ///< contact energies without bound
  more_particles,
  wider_container,
  narrower_orifice,
  wider_orifice,
  other_angle,  ///< of the walls
  own_outline,
  wider_obstacles,  ///< more space between obstacles
  no_reinsertion,
  rounder_shape,
  even_vertices,
  more_vertices,
  smaller_aspect,
  equal_sizes,
  weaker_attraction,
  less_overlap,  ///< at the start
  smaller_load,
  two_dimensions,
  three_dimensions,
  verlet,
  ts,            ///< PETSc TS as the integrator
  split_forces,  ///< an implicit method treats shape energies implicitly, other forces explicitly
  whole_forces,  ///< it treats all forces alike
  drag,
  no_compression,
  other_folder
};

/// "a shorter step (-dt) or stiffer contacts (-e_c)": the cures for which the running scenario has options. All cures,
/// without options, if the scenario has no option for any of them.
std::string cures(std::initializer_list<Cure> several);

/// While it lives, messages name options. One at a time in a process.
class CureOptions {
 public:
  /// option: the option that is the cure, without "-" ("dt", "integrator verlet"), or empty.
  explicit CureOptions(std::function<std::string(Cure)> option);
  ~CureOptions();
  CureOptions(const CureOptions&) = delete;
  CureOptions& operator=(const CureOptions&) = delete;
};

}  // namespace pliant
