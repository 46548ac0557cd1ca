#include <pliant/python/engine.h>

#include <unistd.h>

#include <map>
#include <optional>
#include <thread>

#include <pliant/base/petsc.h>
#include <pliant/base/version.h>
#include <pliant/python/simulation.h>
#include <pliant/run/run_control.h>

namespace pliant::python {
namespace {

// All of it is read and written with the GIL held.
PetscSession* session = nullptr;  ///< never destroyed: end_session() ends it, and a fork must not
pid_t starter = 0;                ///< process that has started PETSc
std::optional<std::thread::id> user;
bool running = false;

void start_session() {
  if (session != nullptr) return;
  const InheritedSignals signals;
  session = new PetscSession();
  signals.restore();
  starter = ::getpid();
}

/// PETSc and MPI end with the interpreter; a fork does not end the PETSc and MPI of its parent.
void end_session() {
  if (session == nullptr || starter != ::getpid()) return;
  close_all_simulations();
  try {
    session->end();
  } catch (const Error& error) {
    PySys_WriteStderr("pliant: warning: %.900s\n", error.what());
  }
}

/// The class of pliant.errors for an error of the engine.
const char* class_of(const Error& error) {
  if (dynamic_cast<const UsageError*>(&error) != nullptr) return "UsageError";
  static const std::map<int, const char*> names{
      {2, "InputError"}, {3, "NumericalError"}, {4, "OutputError"}, {5, "OutOfMemoryError"}, {6, "FolderInUseError"}};
  const auto found = names.find(static_cast<int>(error.code()));
  return found == names.end() ? "PliantError" : found->second;
}

void translate(std::exception_ptr pointer) {  // NOLINT(performance-unnecessary-value-param): pybind11's type
  try {
    if (pointer) std::rethrow_exception(pointer);
  } catch (const Error& error) {
    const py::object type = py::module_::import("pliant.errors").attr(class_of(error));
    PyErr_SetString(type.ptr(), error.what());
  }
}

}  // namespace

EngineUse::EngineUse(Kind kind) : outermost_(!user), runs_(kind == Kind::run) {
  if (session != nullptr && starter != ::getpid())
    throw UsageError(
        "this process is a fork of process {}, which has started the engine, and cannot use it; start processes with "
        "multiprocessing.get_context(\"spawn\")",
        starter);
  if (user && *user != std::this_thread::get_id())
    throw UsageError("another thread uses the engine; use one thread at a time, or processes");
  if (runs_ && running)
    throw UsageError("a callback cannot start another run or minimisation; start it after the one that calls it");
  start_session();
  user = std::this_thread::get_id();
  running = running || runs_;
}

EngineUse::~EngineUse() {
  if (runs_) running = false;
  if (outermost_) user.reset();
}

void bind_engine(py::module_& m) {
  py::register_exception_translator(translate);
  m.attr("version") = build_info().version;
  m.def(
      "build_info", [] { return build_info().text(); }, "Version and build of the engine.");
  py::module_::import("atexit").attr("register")(py::cpp_function(end_session));
}

}  // namespace pliant::python
