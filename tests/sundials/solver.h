// A TS over a vector, set up by an options string.
#pragma once

#include <catch2/catch.hpp>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include <pliant/base/petsc.h>
#include <pliant/ts/sundials/sundials.h>

namespace problems {

using pliant::petsc_check;

// Options of PETSc for the life of the object.
struct Options {
  explicit Options(const std::string& text) {
    petsc_check(PetscOptionsClear(nullptr));
    petsc_check(PetscOptionsInsertString(nullptr, text.c_str()));
  }
  ~Options() { (void)PetscOptionsClear(nullptr); }
};

struct Solver {
  pliant::PetscVec y;
  pliant::PetscMat jacobian;
  pliant::PetscTs ts;

  // Of one rank, with the initial values y0.
  Solver(const std::vector<double>& y0, TSRHSFunction rhs, void* context) {
    create(PETSC_COMM_SELF);
    petsc_check(VecCreateSeq(PETSC_COMM_SELF, static_cast<PetscInt>(y0.size()), y.out()));
    set(y0);
    petsc_check(TSSetRHSFunction(ts, nullptr, rhs, context));
  }
  // Of all ranks, with the points of a DM.
  Solver(DM dm, TSRHSFunction rhs, void* context) {
    create(PETSC_COMM_WORLD);
    petsc_check(DMCreateGlobalVector(dm, y.out()));
    petsc_check(TSSetDM(ts, dm));
    petsc_check(TSSetRHSFunction(ts, nullptr, rhs, context));
  }

  // A dense matrix, for small systems on one rank.
  void use_jacobian(TSRHSJacobian function, void* context) {
    PetscInt n;
    petsc_check(VecGetSize(y, &n));
    petsc_check(MatCreateSeqAIJ(PETSC_COMM_SELF, n, n, n, nullptr, jacobian.out()));
    petsc_check(TSSetRHSJacobian(ts, jacobian, jacobian, function, context));
  }
  void set(const std::vector<double>& values) {
    PetscScalar* out;
    petsc_check(VecGetArrayWrite(y, &out));
    std::copy(values.begin(), values.end(), out);
    petsc_check(VecRestoreArrayWrite(y, &out));
  }
  // The local values.
  std::vector<double> values(::Vec of = nullptr) const {
    const PetscScalar* in;
    PetscInt n;
    if (of == nullptr) of = y;
    petsc_check(VecGetLocalSize(of, &n));
    petsc_check(VecGetArrayRead(of, &in));
    std::vector<double> copy(in, in + n);
    petsc_check(VecRestoreArrayRead(of, &in));
    return copy;
  }
  void configure(const std::string& options) {
    const Options scope(options);
    petsc_check(TSSetFromOptions(ts));
  }
  TSConvergedReason solve(double t_end) {
    TSConvergedReason reason;
    petsc_check(TSSetMaxTime(ts, t_end));
    petsc_check(TSSolve(ts, y));
    petsc_check(TSGetConvergedReason(ts, &reason));
    return reason;
  }
  double time() const {
    PetscReal t;
    petsc_check(TSGetTime(ts, &t));
    return t;
  }
  double time_step() const {
    PetscReal h;
    petsc_check(TSGetTimeStep(ts, &h));
    return h;
  }
  PetscInt steps() const {
    PetscInt n;
    petsc_check(TSGetStepNumber(ts, &n));
    return n;
  }
  PetscInt rejections() const {
    PetscInt n;
    petsc_check(TSGetStepRejections(ts, &n));
    return n;
  }

 private:
  void create(MPI_Comm comm) {
    petsc_check(pliant::sundials_register());
    petsc_check(TSCreate(comm, ts.out()));
    petsc_check(TSSetProblemType(ts, TS_NONLINEAR));
    petsc_check(TSSetMaxSteps(ts, 1000000));
    petsc_check(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_MATCHSTEP));
  }
};

template <class A, class B>
double distance(const A& a, const B& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = std::abs(a[i] - b[i]);
    if (!(d <= worst)) worst = d;  // keeps a NaN
  }
  return worst;
}

inline std::string tolerances(double tol) { return fmt::format(" -ts_rtol {} -ts_atol {} ", tol, tol); }

// Output of -ts_view.
inline std::string view(TS ts) {
  char* text = nullptr;
  std::size_t size = 0;
  std::FILE* file = open_memstream(&text, &size);
  PetscViewer viewer = nullptr;
  petsc_check(PetscViewerASCIIOpenWithFILE(PETSC_COMM_SELF, file, &viewer));
  petsc_check(TSView(ts, viewer));
  petsc_check(PetscViewerDestroy(&viewer));
  std::fclose(file);
  std::string copy(text, size);
  std::free(text);
  return copy;
}

// The number of name=number in the text.
inline double number_after(const std::string& text, const std::string& name) {
  const auto at = text.find(name + "=");
  REQUIRE(at != std::string::npos);
  return std::stod(text.substr(at + name.size() + 1));
}

}  // namespace problems
