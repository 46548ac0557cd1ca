// Ends runs in which closed surfaces pierce each other, are inside one another, or have lost their shape.
#pragma once

#include <string>

#include <pliant/base/ranks.h>
#include <pliant/model/term.h>

namespace pliant {

/// Cures that messages give.
struct SurfaceCures {
  std::string contacts;       ///< cures surfaces that pierce each other or are inside one another
  std::string shape;          ///< cures shapes without meaning
  std::string self_crossing;  ///< cures a particle that crosses itself, in addition to `shape`
  bool self_crossing_stops = true;
  bool piercing_stops = true;  ///< surfaces inside one another, too; not where particles have no contacts
};

/// Returns the number of own particles that cross themselves. Errors: NumericalError, on all ranks, for surfaces that
/// pierce each other or are inside one another, an inverted surface or one with a face without area, and, if it stops
/// the run, one that crosses itself.
Index check_surfaces(const StateView<3>& s, const Ranks& ranks, const SurfaceCures& cures);

}  // namespace pliant
