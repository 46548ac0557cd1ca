// The engine in a Python process: its start and end, and who may use it.
#pragma once

#include <pybind11/pybind11.h>

#include <exception>
#include <utility>

#include <pliant/base/errors.h>

namespace pliant::python {

namespace py = pybind11;

/// Something is used in a way that it does not allow (pliant.UsageError): after close, from another thread, in a fork.
struct UsageError : Error {
  template <class... Args>
  explicit UsageError(fmt::format_string<Args...> text, Args&&... args)
      : Error(ExitCode::bad_input, fmt::format(text, std::forward<Args>(args)...)) {}
};

/// Errors: UsageError in a fork of the process that has started the engine.
void check_process();
bool is_fork();

/// Permission to use the engine, from construction to destruction, both with the GIL held. PETSc and the options of a
/// run belong to the process, so one thread has it at a time. The first permission starts PETSc and MPI. Errors:
/// UsageError while another thread has it, at the end of the interpreter, and as check_process().
class EngineUse {
 public:
  /// run: the engine computes; a callback, which runs within a run, cannot start another one. Otherwise data are read
  /// or changed, also in callbacks.
  enum class Kind { run, access };
  explicit EngineUse(Kind kind);
  ~EngineUse();
  EngineUse(const EngineUse&) = delete;
  EngineUse& operator=(const EngineUse&) = delete;

 private:
  bool outermost_, runs_;
};

/// While it lives, threads of the engine compute, and no thread of Python may use the engine: also not the thread with
/// the permission, whose signal handlers may run meanwhile. With the GIL held.
class EngineAtWork {
 public:
  EngineAtWork();
  ~EngineAtWork();
  EngineAtWork(const EngineAtWork&) = delete;
  EngineAtWork& operator=(const EngineAtWork&) = delete;
};

/// The first exception of a function that a run calls after a step, such as a callback, to be thrown once the engine
/// has returned. All functions may be called without the GIL.
class PendingError {
 public:
  /// Calls body(); keeps its exception, which must not be one of Python.
  template <class Body>
  void keep(Body&& body) noexcept {
    try {
      body();
    } catch (...) {
      if (!error_) error_ = std::current_exception();
    }
  }
  /// As keep(), with the GIL: for Python code, and for libraries that serve one thread at a time.
  template <class Body>
  void guard(Body&& body) noexcept {
    const py::gil_scoped_acquire gil;
    keep(body);
  }
  explicit operator bool() const { return error_ != nullptr; }
  void rethrow() {
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  }

 private:
  std::exception_ptr error_;
};

/// Handlers of signals of the interpreter (Ctrl-C) run; their exceptions are thrown. With the GIL. Errors: UsageError
/// at the end of the interpreter, which waits for the runs of other threads.
void check_signals();

/// An instance of the class in pliant.errors for the exception.
py::object python_error(const std::exception_ptr& exception);

void bind_engine(py::module_& m);
void bind_scenarios(py::module_& m);

}  // namespace pliant::python
