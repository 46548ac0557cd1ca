// Options of Coulomb friction that the scenarios of frictional disks share.
#pragma once

#include <limits>
#include <optional>
#include <string>

#include <pliant/base/options.h>
#include <pliant/model/surface_friction.h>

namespace pliant {

/// A coefficient of friction: that of surfaces that stick, and of surfaces that slide.
struct FrictionOptions {
  Real at_rest;
  std::optional<Real> sliding = {};                            ///< filled in by `resolve`
  Real usual_sliding = std::numeric_limits<Real>::infinity();  ///< what it is then, where the static one is not less

  /// Binds -NAME and -NAME_dynamic. where: what comes before their help, as "model disk: ".
  void bind(Options& options, const std::string& name, const std::string& help, const std::string& where = "");
  /// The latter alone. else_: what more there is to say of its automatic value.
  void bind_sliding(Options& options, const std::string& name, const std::string& where = "",
                    const std::string& else_ = "");
  /// Errors: InputError for a dynamic coefficient that is larger than the static one, or 0 where that is not.
  void resolve(const std::string& name);
  /// Once it is resolved.
  Coulomb coefficients() const { return {at_rest, *sliding}; }
};

}  // namespace pliant
