// PETSc behind RAII and exceptions: errors become pliant::Error with PETSc's own message, handles destroy themselves.
#pragma once

#include <petscts.h>

#include <exception>
#include <string>
#include <utility>

#include <pliant/base/errors.h>

namespace pliant {

/// Initialises PETSc (and MPI) for the life of the object, with an empty options database (nothing from PETSC_OPTIONS
/// or .petscrc) and without its signal handlers, and silences PETSc errors: their text is stored for the exception that
/// `petsc_check` throws. If PETSc already runs, only the error handling changes. PETSc objects must be destroyed before
/// the session ends. Errors: NumericalError if PETSc cannot start (it starts once per process).
class PetscSession {
 public:
  PetscSession();
  ~PetscSession();
  PetscSession(const PetscSession&) = delete;
  PetscSession& operator=(const PetscSession&) = delete;

  /// Ends the session before its object. Errors: OutputError if PETSc could not write its files at the end
  /// (-log_view and others).
  void end();

 private:
  bool open_ = true;
  bool owner_ = false;  // whether this object finalises PETSc
};

/// If code is not zero: throws the exception that a callback stored with `petsc_callback`; else an InputError where
/// PETSc could not follow an option, an OutputError where it could not open a file, and otherwise a NumericalError,
/// with PETSc's message.
void petsc_check(PetscErrorCode code);

/// Runs body(); an exception becomes a PETSc error code, and petsc_check rethrows the original further up.
template <class Body>
PetscErrorCode petsc_callback(Body&& body) noexcept;

/// Stores the exception in flight and returns the code that petsc_check turns back into it.
PetscErrorCode petsc_store_exception(std::exception_ptr error) noexcept;

template <class Body>
PetscErrorCode petsc_callback(Body&& body) noexcept {
  try {
    std::forward<Body>(body)();
    return 0;
  } catch (...) {
    return petsc_store_exception(std::current_exception());
  }
}

/// Owner of a PETSc object: Handle<TS, TSDestroy>.
template <class T, PetscErrorCode (*Destroy)(T*)>
class Handle {
 public:
  Handle() = default;
  explicit Handle(T object) : object_(object) {}
  Handle(Handle&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(object_, other.object_);
    return *this;
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() {
    if (object_ != nullptr) (void)Destroy(&object_);
  }
  T get() const { return object_; }
  operator T() const { return object_; }  // NOLINT: reads as the PETSc object it is
  /// For PETSc's Create functions; the former object of the handle is destroyed.
  T* out() {
    if (object_ != nullptr) (void)Destroy(&object_);
    return &object_;
  }

 private:
  T object_ = nullptr;
};

using PetscVec = Handle<::Vec, VecDestroy>;
using PetscMat = Handle<::Mat, MatDestroy>;
using PetscTs = Handle<TS, TSDestroy>;

}  // namespace pliant
