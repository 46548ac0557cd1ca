// The exponent of the flow rate between friction and drag.
#pragma once

#include <cmath>

#include <pliant/base/errors.h>
#include <pliant/base/types.h>

namespace pliant {

/// β(λ) = (d − 1) − ½ tanh(log10(λ/λ_c)/b): from d − 1/2 (friction only, λ = 0) to d − 3/2 (drag only, λ = ∞).
/// Equal to [H 14] in 2D; as printed, [H 14] misses these limits in 3D.
/// lambda = ζ/μ in units of ζ0/μ0 (0 and ∞ allowed), lambda_c > 0, width b > 0 in decades. Throws InputError otherwise.
inline Real beta_sigmoid(Real lambda, int d, Real lambda_c, Real b) {
  if (!(lambda >= 0) || !(lambda_c > 0) || !(b > 0))
    throw InputError("exponent: lambda = {}, lambda_c = {}, b = {}; lambda must not be negative, the others positive",
                     lambda, lambda_c, b);
  return d - 1 - std::tanh(std::log10(lambda / lambda_c) / b) / 2;
}

}  // namespace pliant
