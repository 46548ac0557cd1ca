#include <malloc.h>
#include <pliant/base/petsc.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <utility>

namespace pliant {
namespace {

// A PETSc error handler has one context for the process; therefore the last error is stored per thread.
thread_local std::string last_message;
thread_local bool last_in_options;  // the last error came from a function that reads options
thread_local std::exception_ptr last_exception;

PetscErrorCode keep_message(MPI_Comm, int, const char* function, const char*, PetscErrorCode code, PetscErrorType type,
                            const char* message, void*) {
  if (type == PETSC_ERROR_INITIAL) {
    last_message = message != nullptr ? message : "";
    if (const auto line_end = last_message.find('\n'); line_end != std::string::npos) last_message.erase(line_end);
    last_in_options = false;
  }
  // PETSc names every function that the error passes through. Only options select orderings of matrices.
  const std::string_view name = function != nullptr ? function : "";
  if (name.find("Options") != name.npos || name == "MatGetOrdering") last_in_options = true;
  return code;
}

bool is_users(PetscErrorCode code) {
  return last_in_options || code == PETSC_ERR_ARG_UNKNOWN_TYPE || code == PETSC_ERR_MISSING_FACTOR ||
         code == PETSC_ERR_USER_INPUT;
}

/// SuperLU_DIST, a library of PETSc, makes malloc keep all freed memory: every temporary array would count from its
/// first use to the end of the run. Here large arrays are returned to the system; small arrays are kept, which is
/// faster.
void return_freed_memory() {
#ifdef __GLIBC__
  mallopt(M_MMAP_MAX, 65536);
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  mallopt(M_TRIM_THRESHOLD, 1 << 24);
#endif
}

/// Without a launcher there is one rank. Open MPI would look for networks, which takes a third of a second, and start a
/// daemon. Without a daemon, processes would share a session folder, and one process removes files that another is
/// about to use. Settings of the user override these.
void prepare_single_rank() {
  constexpr std::array launchers{"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID"};
  if (std::any_of(launchers.begin(), launchers.end(), [](const char* name) { return std::getenv(name) != nullptr; }))
    return;
  constexpr std::array<std::pair<const char*, const char*>, 4> settings{{{"OMPI_MCA_ess_singleton_isolated", "1"},
                                                                         {"OMPI_MCA_orte_create_session_dirs", "0"},
                                                                         {"OMPI_MCA_pml", "ob1"},
                                                                         {"OMPI_MCA_btl", "self"}}};
  for (const auto& [name, value] : settings) (void)setenv(name, value, 0);
}

}  // namespace

PetscSession::PetscSession() {
  PetscBool running = PETSC_FALSE;
  (void)PetscInitialized(&running);
  if (running == PETSC_FALSE) {
    // PETSc's own signal handlers would print a page and end the program at SIGHUP, SIGTERM and others.
    static char name[] = "pliant", no_handlers[] = "-no_signal_handler";
    static char *names[] = {name, no_handlers, nullptr}, **arguments = names;
    static int count = 2;
    prepare_single_rank();
    if (PetscInitialize(&count, &arguments, nullptr, nullptr) != 0)
      throw NumericalError("PETSc could not be started; start it once per process, and check MPI");
    owner_ = true;
    return_freed_memory();
  }
  (void)PetscPushErrorHandler(keep_message, nullptr);
  if (owner_) (void)PetscOptionsClear(nullptr);  // PETSc has read PETSC_OPTIONS and .petscrc, too
}

void PetscSession::end() {
  if (!std::exchange(open_, false)) return;
  const PetscErrorCode code = owner_ ? PetscFinalize() : 0;
  (void)PetscPopErrorHandler();
  if (code != 0) throw OutputError("the output that PETSc prints at the end could not be written: {}", last_message);
}

PetscSession::~PetscSession() {
  try {
    end();
  } catch (const OutputError&) {  // an error is on its way already
  }
}

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
  if (code == PETSC_ERR_FILE_OPEN || code == PETSC_ERR_FILE_WRITE) throw OutputError("PETSc: {}", message);
  if (code == PETSC_ERR_MEM)
    throw MemoryError(
        fmt::format("memory of PETSc ({}) could not be allocated", message.empty() ? "no message" : message));
  if (is_users(code)) throw InputError("PETSc refuses one of its options: {}", message);
  throw NumericalError("PETSc error {} ({}): {}", static_cast<int>(code), meaning != nullptr ? meaning : "unknown",
                       message.empty() ? "no message" : message);
}

}  // namespace pliant
