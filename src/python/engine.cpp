#include <pliant/python/engine.h>

#include <pthread.h>
#include <unistd.h>

#include <chrono>
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
bool at_work = false;  ///< several simulations compute
bool ending = false;   ///< the interpreter ends
bool forked = false;   ///< this process is a fork of the process that has started PETSc

void start_session() {
  if (session != nullptr) return;
  const InheritedSignals signals;
  session = new PetscSession();
  signals.restore();
  starter = ::getpid();
  ::pthread_atfork(nullptr, nullptr, [] { forked = true; });
}

/// A thread that runs a simulation while the interpreter ends stops at the next check of signals.
void stop_other_thread() {
  constexpr int most_waits = 1000;
  ending = true;
  for (int k = 0; k < most_waits && user; ++k) {
    const py::gil_scoped_release released;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

/// PETSc and MPI end with the interpreter; a fork does not end the PETSc and MPI of its parent.
void end_session() {
  if (session == nullptr || forked) return;
  stop_other_thread();
  if (user) return;  // the thread computes, for example a packing: without PETSc it would crash
  ending = false;    // for simulations that close
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

py::object type_of(const Error& error) { return py::module_::import("pliant.errors").attr(class_of(error)); }

void translate(std::exception_ptr pointer) {  // NOLINT(performance-unnecessary-value-param): pybind11's type
  try {
    if (pointer) std::rethrow_exception(pointer);
  } catch (const Error& error) {
    PyErr_SetString(type_of(error).ptr(), error.what());
  }
}

void check_not_ending() {
  if (ending) throw UsageError("the interpreter ends while this thread uses the engine; join the thread first");
}

}  // namespace

void check_process() {
  if (forked)
    throw UsageError(
        "this process is a fork of process {}, which has started the engine, and cannot use it; start processes with "
        "multiprocessing.get_context(\"spawn\")",
        starter);
}

bool is_fork() { return forked; }

void check_signals() {
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  check_not_ending();
}

EngineUse::EngineUse(Kind kind) : outermost_(!user), runs_(kind == Kind::run) {
  check_process();
  check_not_ending();
  if (user && *user != std::this_thread::get_id())
    throw UsageError("another thread uses the engine; use one thread at a time, or processes");
  if (at_work)
    throw UsageError("advance() computes, and a signal handler cannot use simulations meanwhile; set a variable there");
  if (runs_ && running)
    throw UsageError("a callback cannot start another run or minimisation; start it after the one that calls it");
  start_session();
  user = std::this_thread::get_id();
  running = running || runs_;
}

EngineAtWork::EngineAtWork() { at_work = true; }
EngineAtWork::~EngineAtWork() { at_work = false; }

EngineUse::~EngineUse() {
  if (runs_) running = false;
  if (outermost_) user.reset();
}

py::object python_error(const std::exception_ptr& exception) {
  try {
    std::rethrow_exception(exception);
  } catch (...) {
    const Error error = error_in_flight();
    return type_of(error)(error.what());
  }
}

void bind_engine(py::module_& m) {
  py::register_exception_translator(translate);
  m.attr("version") = build_info().version;
  m.def(
      "build_info", [] { return build_info().text(); }, "Version and build of the engine.");
  py::module_::import("atexit").attr("register")(py::cpp_function(end_session));
}

}  // namespace pliant::python
