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
  own_outline,
  wider_obstacles,  ///< more space between obstacles
  no_reinsertion,
  rounder_shape,
  even_vertices,
  more_vertices,
  smaller_aspect,
  ts,  ///< PETSc TS as the integrator
  drag,
  other_folder
};

/// "a shorter step (-dt), stiffer contacts (-e_c) or a contact barrier": options where the running scenario has them.
std::string cures(std::initializer_list<Cure> several);

/// While it lives, messages name options. One at a time in a process.
class CureOptions {
 public:
  /// option: the name of the option that is the cure, without "-", or empty.
  explicit CureOptions(std::function<std::string(Cure)> option);
  ~CureOptions();
  CureOptions(const CureOptions&) = delete;
  CureOptions& operator=(const CureOptions&) = delete;
};

}  // namespace pliant
