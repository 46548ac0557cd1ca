#include <pliant/ts/sundials/arkode.h>
#include <pliant/ts/sundials/cvode.h>
#include <pliant/ts/sundials/sundials.h>

namespace pliant {

PetscErrorCode sundials_register() {
  PetscFunctionBegin;
  PetscCall(TSRegister(ts_cvode, sundials::cvode_create));
  PetscCall(TSRegister(ts_arkode, sundials::arkode_create));
  PetscFunctionReturn(0);
}

PetscErrorCode arkode_explicit_table(TS ts, ArkodeTable* table) { return sundials::explicit_table(ts, table); }

}  // namespace pliant
