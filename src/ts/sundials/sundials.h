// SUNDIALS' integrators as PETSc TS types.
#pragma once

#include <petscts.h>

#include <vector>

namespace pliant {

inline constexpr char ts_cvode[] = "cvode";
inline constexpr char ts_arkode[] = "arkode";

/// Registers the TS types `cvode` and `arkode`; call it after PetscInitialize, any number of times. Description and
/// options: src/ts/sundials/README.md.
PetscErrorCode sundials_register();

/// Coefficients of an explicit Runge–Kutta method.
struct ArkodeTable {
  bool fixed_step = false;     ///< -ts_arkode_fixed_step
  std::vector<PetscReal> a{};  ///< row by row [stages²]
  std::vector<PetscReal> b{};  ///< [stages]; empty unless -ts_arkode_type is erk
};
/// Reads the table of a TS of type `arkode`, after TSSetFromOptions.
PetscErrorCode arkode_explicit_table(TS ts, ArkodeTable* table);

}  // namespace pliant
