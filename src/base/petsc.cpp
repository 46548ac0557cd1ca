#include <malloc.h>
#include <pliant/base/petsc.h>

namespace pliant {
namespace {

// A PETSc error handler has one context for the process; the last error is kept per thread instead.
thread_local std::string last_message;
thread_local std::exception_ptr last_exception;

PetscErrorCode keep_message(MPI_Comm, int, const char*, const char*, PetscErrorCode code, PetscErrorType type,
                            const char* message, void*) {
  if (type == PETSC_ERROR_INITIAL) last_message = message != nullptr ? message : "";
  return code;
}

/// SuperLU_DIST, which PETSc brings along, has malloc keep all memory that is freed: every temporary array would count
/// from its first use to the end of the run. Large arrays go back again; small ones are kept, as that is quicker.
void return_freed_memory() {
#ifdef __GLIBC__
  mallopt(M_MMAP_MAX, 65536);
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 24);
#endif
}

void end_session(bool owner) {
  (void)PetscPopErrorHandler();
  if (owner) (void)PetscFinalize();
}

}  // namespace

PetscSession::PetscSession() {
  PetscBool running = PETSC_FALSE;
  (void)PetscInitialized(&running);
  if (running == PETSC_FALSE) {
    if (PetscInitializeNoArguments() != 0)
      throw NumericalError("PETSc could not be started; it starts once per process, and MPI must work");
    owner_ = true;
    return_freed_memory();
  }
  (void)PetscPushErrorHandler(keep_message, nullptr);
  if (owner_) (void)PetscOptionsClear(nullptr);  // PETSc has read PETSC_OPTIONS and .petscrc, in spite of "NoArguments"
}

PetscSession::~PetscSession() { end_session(owner_); }

PetscErrorCode petsc_store_exception(std::exception_ptr error) noexcept {
  last_exception = std::move(error);
  return PETSC_ERR_USER;
}

void petsc_check(PetscErrorCode code) {
  if (code == 0) return;
  // An exception that PETSc has swallowed (a rejected step) must not surface with a later, different error.
  const std::exception_ptr exception = std::exchange(last_exception, nullptr);
  const std::string message = std::exchange(last_message, {});
  if (code == PETSC_ERR_USER && exception) std::rethrow_exception(exception);
  const char* meaning = nullptr;
  (void)PetscErrorMessage(code, &meaning, nullptr);
  throw NumericalError("PETSc error {} ({}): {}", static_cast<int>(code), meaning != nullptr ? meaning : "unknown",
                       message.empty() ? "no message" : message);
}

}  // namespace pliant
