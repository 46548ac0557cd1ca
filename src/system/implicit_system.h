// Interface of implicit and split methods to a system, beyond its acceleration.
#pragma once

#include <memory>

#include <pliant/system/equation.h>
#include <pliant/system/jacobian.h>

namespace pliant {

/// A system with derivatives, whose acceleration is a sum of parts.
class ImplicitSystem : public SecondOrderSystem {
 public:
  /// As acceleration(), by a group of the terms.
  virtual void group_acceleration(TermGroup group, Real t, const Real* x, const Real* v, Real* a) = 0;
  virtual std::unique_ptr<Jacobian> jacobian(JacobianForm form, JacobianKind kind, TermGroup group) = 0;
};

}  // namespace pliant
