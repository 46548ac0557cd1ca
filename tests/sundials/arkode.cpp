// TS type arkode: orders of all its methods, exact and reference solutions, TS around it, and errors.
#include <catch2/catch.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "problems.h"
#include "solver.h"
#include "support/order.h"

namespace pliant::test::arkode_test {
using namespace problems;
using Catch::Matchers::Contains;

namespace {

// ẏ = explicit_part + implicit_part, without invariants or symmetries that a method could profit from.
struct Additive {
  static constexpr double t_end = 2;
  static std::array<double, 2> explicit_part(double t, const double* y) {
    return {std::sin(2 * t) - y[0] * y[1], y[0] * y[0] / 2};
  }
  static std::array<double, 2> implicit_part(double t, const double* y) {
    return {-2 * y[0] + y[1] * y[1], y[0] - (1 + std::cos(t) / 2) * y[1]};
  }
  static std::array<double, 4> explicit_jacobian(const double* y) { return {-y[1], -y[0], y[0], 0}; }
  static std::array<double, 4> implicit_jacobian(double t, const double* y) {
    return {-2, 2 * y[1], 1, -(1 + std::cos(t) / 2)};
  }

  // Writes out = a function of y, of xdot if it is not null.
  template <class Function>
  static PetscErrorCode apply(::Vec y, ::Vec ydot, ::Vec f, Function function) {
    const PetscScalar *in, *rate = nullptr;
    PetscScalar* out;
    PetscFunctionBegin;
    PetscCall(VecGetArrayRead(y, &in));
    if (ydot) PetscCall(VecGetArrayRead(ydot, &rate));
    PetscCall(VecGetArrayWrite(f, &out));
    function(in, rate, out);
    PetscCall(VecRestoreArrayWrite(f, &out));
    if (ydot) PetscCall(VecRestoreArrayRead(ydot, &rate));
    PetscCall(VecRestoreArrayRead(y, &in));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode rhs_explicit(TS, PetscReal t, ::Vec y, ::Vec f, void*) {
    return apply(y, nullptr, f, [&](const double* in, const double*, double* out) {
      const auto e = explicit_part(t, in);
      out[0] = e[0], out[1] = e[1];
    });
  }
  static PetscErrorCode rhs(TS, PetscReal t, ::Vec y, ::Vec f, void*) {
    return apply(y, nullptr, f, [&](const double* in, const double*, double* out) {
      const auto e = explicit_part(t, in), i = implicit_part(t, in);
      out[0] = e[0] + i[0], out[1] = e[1] + i[1];
    });
  }
  static PetscErrorCode ifunction(TS, PetscReal t, ::Vec y, ::Vec ydot, ::Vec f, void*) {
    return apply(y, ydot, f, [&](const double* in, const double* rate, double* out) {
      const auto i = implicit_part(t, in);
      out[0] = rate[0] - i[0], out[1] = rate[1] - i[1];
    });
  }
  static PetscErrorCode set_matrix(::Mat a, const std::array<double, 4>& values) {
    const PetscInt rows[] = {0, 1};
    PetscFunctionBegin;
    PetscCall(MatSetValues(a, 2, rows, 2, rows, values.data(), INSERT_VALUES));
    PetscCall(MatAssemblyBegin(a, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(a, MAT_FINAL_ASSEMBLY));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode jacobian(TS, PetscReal t, ::Vec y, ::Mat, ::Mat p, void*) {
    const PetscScalar* in;
    PetscFunctionBegin;
    PetscCall(VecGetArrayRead(y, &in));
    auto values = implicit_jacobian(t, in);
    const auto other = explicit_jacobian(in);
    PetscCall(VecRestoreArrayRead(y, &in));
    for (int i = 0; i < 4; ++i) values[i] += other[i];
    PetscCall(set_matrix(p, values));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode ijacobian(TS, PetscReal t, ::Vec y, ::Vec, PetscReal shift, ::Mat, ::Mat p, void*) {
    const PetscScalar* in;
    PetscFunctionBegin;
    PetscCall(VecGetArrayRead(y, &in));
    auto values = implicit_jacobian(t, in);
    PetscCall(VecRestoreArrayRead(y, &in));
    for (double& v : values) v = -v;
    values[0] += shift, values[3] += shift;
    PetscCall(set_matrix(p, values));
    PetscFunctionReturn(0);
  }
};

enum class Form { rhs, rhs_with_jacobian, implicit, split };

Solver additive(Form form) {
  Solver s({1, 0.5}, form == Form::rhs || form == Form::rhs_with_jacobian ? Additive::rhs : Additive::rhs_explicit,
           nullptr);
  if (form == Form::rhs_with_jacobian) s.use_jacobian(Additive::jacobian, nullptr);
  if (form == Form::implicit || form == Form::split) {
    petsc_check(MatCreateSeqDense(PETSC_COMM_SELF, 2, 2, nullptr, s.jacobian.out()));
    petsc_check(TSSetIFunction(s.ts, nullptr, Additive::ifunction, nullptr));
    petsc_check(TSSetIJacobian(s.ts, s.jacobian, s.jacobian, Additive::ijacobian, nullptr));
  }
  return s;
}

double additive_error(const std::string& options, Form form, double h) {
  static const std::vector<double> reference = [] {
    Solver s = additive(Form::rhs);
    s.configure("-ts_type rk -ts_rk_type 8vr -ts_adapt_type none -ts_dt 0.005");
    s.solve(Additive::t_end);
    return s.values();
  }();
  Solver s = additive(form);
  s.configure(
      "-ts_type arkode -ts_arkode_fixed_step -ts_rtol 1e-13 -ts_atol 1e-13 -ts_arkode_max_iterations 30 "
      "-ksp_type preonly -pc_type lu -ts_dt " +
      fmt::format("{} ", h) + options);
  s.solve(Additive::t_end);
  return distance(s.values(), reference);
}

struct Table {
  const char* name;
  int order;
};

// Steps coarse enough for the last errors to be above rounding.
double first_step(int order) { return order < 4 ? 0.05 : order < 6 ? 0.125 : order < 8 ? 0.2 : 0.5; }

void require_orders(const std::string& type, const std::vector<Table>& tables, Form form) {
  for (const Table& table : tables) {
    const std::string options = "-ts_arkode_type " + type + " -ts_arkode_table " + table.name;
    require_order(
        table.name, [&](double h) { return additive_error(options, form, h); }, first_step(table.order), table.order,
        1e-14);
  }
}

// Another right-hand side without a context, with its calls counted, one of which may fail.
struct Counted {
  TSRHSFunction function;
  int calls = 0, fail_at_call = 0;
  static PetscErrorCode rhs(TS ts, PetscReal t, ::Vec y, ::Vec f, void* context) {
    auto& self = *static_cast<Counted*>(context);
    if (++self.calls == self.fail_at_call) return PETSC_ERR_MEMC;
    return self.function(ts, t, y, f, nullptr);
  }
};

// (x, v) rotates fast about (z, 0), z falls slowly.
struct Oscillator {
  static constexpr double frequency = 200;
  int calls = 0;
  static void slow(const double* in, double* out) { out[0] = out[1] = 0, out[2] = -in[2] / (1 + in[0] * in[0]); }
  static void fast(const double* in, double* out) {
    out[0] = frequency * in[1], out[1] = -frequency * (in[0] - in[2]), out[2] = 0;
  }
  static PetscErrorCode rhs_slow(TS, PetscReal, ::Vec y, ::Vec f, void*) {
    return Additive::apply(y, nullptr, f, [](const double* in, const double*, double* out) { slow(in, out); });
  }
  static PetscErrorCode ifunction(TS, PetscReal, ::Vec y, ::Vec ydot, ::Vec f, void* context) {
    ++static_cast<Oscillator*>(context)->calls;
    return Additive::apply(y, ydot, f, [](const double* in, const double* rate, double* out) {
      fast(in, out);
      for (int i = 0; i < 3; ++i) out[i] = rate[i] - out[i];
    });
  }
  static PetscErrorCode total(TS, PetscReal, ::Vec y, ::Vec f, void*) {
    return Additive::apply(y, nullptr, f, [](const double* in, const double*, double* out) {
      double more[3];
      slow(in, out), fast(in, more);
      for (int i = 0; i < 3; ++i) out[i] += more[i];
    });
  }
};

// The Brusselator with its diffusion in the implicit function.
struct Diffusion {
  // f = reaction of y, or ẏ − diffusion of y.
  static PetscErrorCode reaction(TS ts, PetscReal t, ::Vec y, ::Vec f, void*) {
    PetscVec diffusion;
    PetscFunctionBegin;
    PetscCall(VecDuplicate(y, diffusion.out()));
    PetscCall(Brusselator::rhs(ts, t, y, f, nullptr));
    PetscCall(spread(ts, y, diffusion));
    PetscCall(VecAXPY(f, -1, diffusion));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode ifunction(TS ts, PetscReal, ::Vec y, ::Vec ydot, ::Vec f, void*) {
    PetscFunctionBegin;
    PetscCall(spread(ts, y, f));
    PetscCall(VecAYPX(f, -1, ydot));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode ijacobian(TS ts, PetscReal, ::Vec, ::Vec, PetscReal shift, ::Mat, ::Mat p, void*) {
    DM dm;
    DMDALocalInfo info;
    PetscFunctionBegin;
    PetscCall(TSGetDM(ts, &dm));
    PetscCall(DMDAGetLocalInfo(dm, &info));
    const double k = coefficient(info);
    PetscCall(MatZeroEntries(p));
    for (PetscInt i = info.xs; i < info.xs + info.xm; ++i) {
      for (PetscInt c = 0; c < 2; ++c) {
        for (const PetscInt j : {i - 1, i, i + 1}) {
          if (j < 0 || j >= info.mx) continue;
          MatStencil row{}, column{};
          row.i = i, row.c = c, column.i = j, column.c = c;
          const PetscScalar value = i == j ? shift + 2 * k : -k;
          PetscCall(MatSetValuesStencil(p, 1, &row, 1, &column, &value, INSERT_VALUES));
        }
      }
    }
    PetscCall(MatAssemblyBegin(p, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(p, MAT_FINAL_ASSEMBLY));
    PetscFunctionReturn(0);
  }

 private:
  static double coefficient(const DMDALocalInfo& info) {
    return Brusselator::diffusion * (info.mx + 1) * (info.mx + 1);
  }
  static PetscErrorCode spread(TS ts, ::Vec y, ::Vec f) {
    DM dm;
    DMDALocalInfo info;
    ::Vec local;
    PetscScalar **in, **out;
    PetscFunctionBegin;
    PetscCall(TSGetDM(ts, &dm));
    PetscCall(DMDAGetLocalInfo(dm, &info));
    PetscCall(DMGetLocalVector(dm, &local));
    PetscCall(DMGlobalToLocal(dm, y, INSERT_VALUES, local));
    PetscCall(DMDAVecGetArrayDOF(dm, local, &in));
    PetscCall(DMDAVecGetArrayDOFWrite(dm, f, &out));
    if (info.xs == 0) in[-1][0] = 1, in[-1][1] = 3;
    if (info.xs + info.xm == info.mx) in[info.mx][0] = 1, in[info.mx][1] = 3;
    for (PetscInt i = info.xs; i < info.xs + info.xm; ++i)
      for (int c = 0; c < 2; ++c) out[i][c] = coefficient(info) * (in[i - 1][c] - 2 * in[i][c] + in[i + 1][c]);
    PetscCall(DMDAVecRestoreArrayDOFWrite(dm, f, &out));
    PetscCall(DMDAVecRestoreArrayDOF(dm, local, &in));
    PetscCall(DMRestoreLocalVector(dm, &local));
    PetscFunctionReturn(0);
  }
};

PetscErrorCode decay(TS, PetscReal, ::Vec y, ::Vec f, void*) {
  PetscFunctionBegin;
  PetscCall(VecCopy(y, f));
  PetscCall(VecScale(f, -1));
  PetscFunctionReturn(0);
}

PetscErrorCode nan_after_one(TS ts, PetscReal t, ::Vec y, ::Vec f, void*) {
  PetscFunctionBegin;
  PetscCall(decay(ts, t, y, f, nullptr));
  if (t > 1) PetscCall(VecSet(f, std::nan("")));
  PetscFunctionReturn(0);
}

PetscErrorCode root(TS, PetscReal, ::Vec y, ::Vec f, void*) {
  return Additive::apply(y, nullptr, f,
                         [](const double* in, const double*, double* out) { out[0] = -std::sqrt(in[0]) - 0.5; });
}
PetscErrorCode not_negative(TS, PetscReal, ::Vec y, PetscBool* accept) {
  PetscReal least;
  PetscFunctionBegin;
  PetscCall(VecMin(y, nullptr, &least));
  *accept = least >= 0 ? PETSC_TRUE : PETSC_FALSE;
  PetscFunctionReturn(0);
}

// (x, v), (x, v) of two oscillators.
PetscErrorCode oscillators(TS, PetscReal, ::Vec y, ::Vec f, void*) {
  return Additive::apply(y, nullptr, f, [](const double* in, const double*, double* out) {
    out[0] = in[1], out[1] = -in[0], out[2] = in[3], out[3] = -25 * in[2];
  });
}

// 2 ẏ + y
PetscErrorCode heavy(TS, PetscReal, ::Vec y, ::Vec ydot, ::Vec f, void*) {
  PetscFunctionBegin;
  PetscCall(VecWAXPY(f, 2, ydot, y));
  PetscFunctionReturn(0);
}

Solver kepler() {
  const auto start = Kepler::exact(0);
  return {{start.begin(), start.end()}, Kepler::rhs, nullptr};
}

}  // namespace

TEST_CASE("every explicit table of ARKODE has its order") {
  require_orders("erk",
                 {{"ARKODE_HEUN_EULER_2_1_2", 2},
                  {"ARKODE_BOGACKI_SHAMPINE_4_2_3", 3},
                  {"ARKODE_ARK324L2SA_ERK_4_2_3", 3},
                  {"ARKODE_KNOTH_WOLKE_3_3", 3},
                  {"ARKODE_ZONNEVELD_5_3_4", 4},
                  {"ARKODE_ARK436L2SA_ERK_6_3_4", 4},
                  {"ARKODE_ARK437L2SA_ERK_7_3_4", 4},
                  {"ARKODE_SAYFY_ABURUB_6_3_4", 4},
                  {"ARKODE_CASH_KARP_6_4_5", 5},
                  {"ARKODE_FEHLBERG_6_4_5", 5},
                  {"ARKODE_DORMAND_PRINCE_7_4_5", 5},
                  {"ARKODE_ARK548L2SA_ERK_8_4_5", 5},
                  {"ARKODE_ARK548L2SAb_ERK_8_4_5", 5},
                  {"ARKODE_VERNER_8_5_6", 6},
                  {"ARKODE_FEHLBERG_13_7_8", 8}},
                 Form::rhs);
}

TEST_CASE("every diagonally implicit table of ARKODE has its order") {
  require_orders("dirk",
                 {{"sdirk_2_1_2", 2},
                  {"billington_3_3_2", 2},
                  {"trbdf2_3_3_2", 2},
                  {"kvaerno_4_2_3", 3},
                  {"ark324l2sa_dirk_4_2_3", 3},
                  {"esdirk324l2sa_4_2_3", 3},
                  {"esdirk325l2sa_5_2_3", 3},
                  {"esdirk32i5l2sa_5_2_3", 3},
                  {"cash_5_2_4", 4},
                  {"cash_5_3_4", 4},
                  {"sdirk_5_3_4", 4},
                  {"kvaerno_5_3_4", 4},
                  {"ark436l2sa_dirk_6_3_4", 4},
                  {"ark437l2sa_dirk_7_3_4", 4},
                  {"esdirk436l2sa_6_3_4", 4},
                  {"esdirk43i6l2sa_6_3_4", 4},
                  {"qesdirk436l2sa_6_3_4", 4},
                  {"esdirk437l2sa_7_3_4", 4},
                  {"kvaerno_7_4_5", 5},
                  {"ark548l2sa_dirk_8_4_5", 5},
                  {"ark548l2sab_dirk_8_4_5", 5},
                  {"esdirk547l2sa_7_4_5", 5},
                  {"esdirk547l2sa2_7_4_5", 5}},
                 Form::rhs_with_jacobian);
}

TEST_CASE("every additive table of ARKODE has its order") {
  require_orders("imex",
                 {{"ark324l2sa", 3}, {"ark436l2sa", 4}, {"ark437l2sa", 4}, {"ark548l2sa", 5}, {"ark548l2sab", 5}},
                 Form::split);
}

TEST_CASE("the explicit multirate methods of ARKODE have their order") {
  require_orders("mri", {{"mis_kw3", 3}, {"mri_gark_erk33a", 3}, {"mri_gark_erk45a", 4}}, Form::split);
}

TEST_CASE("explicit steps cost what their table costs") {
  const auto calls_for = [](const std::string& table) {
    Counted counted{Additive::rhs};
    Solver s({1, 0.5}, Counted::rhs, &counted);
    s.configure(
        "-ts_type arkode -ts_arkode_fixed_step -ts_dt 0.1 -ts_exact_final_time stepover -ts_max_steps 20 "
        "-ts_arkode_table " +
        table);
    s.solve(100);
    REQUIRE(s.steps() == 20);
    return counted.calls;
  };
  // The first evaluation, then one per stage, or one less if the last stage is the first of the next step.
  CHECK(calls_for("dormand_prince") == 1 + 20 * 6);
  CHECK(calls_for("bogacki_shampine") == 1 + 20 * 3);
  CHECK(calls_for("heun_euler") == 1 + 20 * 2);
  CHECK(calls_for("cash_karp") == 1 + 20 * 6);
  CHECK(calls_for("fehlberg_13") == 1 + 20 * 13);
}

TEST_CASE("errors of arkode on Kepler's problem fall with the tolerance") {
  const std::string options =
      GENERATE("-ts_arkode_table dormand_prince", "-ts_arkode_order 3", "-ts_arkode_order 4", "-ts_arkode_order 6",
               "-ts_arkode_order 8", "-ts_arkode_adapt pi", "-ts_arkode_adapt exp_gus -ts_arkode_safety 0.8",
               "-ts_arkode_type dirk -ts_arkode_nonlinear fixedpoint -ts_arkode_max_iterations 10",
               "-ts_arkode_type dirk -ts_arkode_linear spgmr");
  std::vector<double> errors;
  for (const double tol : {1e-5, 1e-7, 1e-9}) {
    Solver s = kepler();
    s.configure("-ts_type arkode -ts_dt 1e-2 " + tolerances(tol) + options);
    CHECK(s.solve(Kepler::period) == TS_CONVERGED_TIME);
    CHECK(s.time() == Kepler::period);
    errors.push_back(distance(s.values(), Kepler::exact(0)));
    INFO(options << " tolerance " << tol << " error " << errors.back() << " steps " << s.steps());
    // Some ten to thousand steps with an error of the tolerance each, and a phase error that grows like t².
    CHECK(errors.back() < 3000 * tol);
  }
  CHECK(errors[1] < errors[0] / 10);
  CHECK(errors[2] < errors[1] / 10);
}

TEST_CASE("arkode at a tight tolerance agrees with rk and arkimex") {
  const auto end_of = [](Form form, const std::string& options) {
    Solver s = additive(form);
    s.configure("-ts_dt 1e-2 -snes_rtol 1e-13 -snes_stol 1e-13 -ksp_type preonly -pc_type lu " + options);
    s.solve(Additive::t_end);
    return s.values();
  };
  const auto rk = end_of(Form::rhs, "-ts_type rk -ts_rk_type 5dp" + tolerances(1e-11));
  const auto arkimex = end_of(Form::split, "-ts_type arkimex -ts_arkimex_type 4" + tolerances(1e-10));
  REQUIRE(distance(rk, arkimex) < 1e-8);
  const std::string arkode = "-ts_type arkode" + tolerances(1e-10);
  CHECK(distance(end_of(Form::rhs, arkode), rk) < 1e-8);
  CHECK(distance(end_of(Form::rhs_with_jacobian, arkode + " -ts_arkode_type dirk"), rk) < 1e-8);
  CHECK(distance(end_of(Form::implicit, arkode + " -ts_arkode_type dirk"), rk) < 1e-8);
  CHECK(distance(end_of(Form::split, arkode + " -ts_arkode_type dirk"), rk) < 1e-8);
  CHECK(distance(end_of(Form::split, arkode + " -ts_arkode_type imex"), rk) < 1e-8);
  CHECK(distance(end_of(Form::split, arkode + " -ts_arkode_type imex -ts_arkode_nonlinear fixedpoint "
                                              "-ts_arkode_max_iterations 10"),
                 rk) < 1e-8);
  CHECK(distance(end_of(Form::split, arkode + " -ts_arkode_type imex -ts_arkode_linear spgmr"), rk) < 1e-8);
}

TEST_CASE("arkode on a stiff problem: Newton over the KSP with the Jacobian") {
  const std::string options = GENERATE("", "-ts_arkode_table esdirk437l2sa", "-ts_arkode_order 5",
                                       "-ts_arkode_table kvaerno_5_3_4", "-ksp_type preonly -pc_type lu");
  VanDerPol problem;
  Solver s({2, 0}, VanDerPol::rhs, &problem);
  s.use_jacobian(VanDerPol::jacobian, &problem);
  s.configure("-ts_type arkode -ts_arkode_type dirk -ts_dt 1e-6 -ts_max_steps 10000 " + tolerances(1e-7) + options);
  CHECK(s.solve(VanDerPol::t_end) == TS_CONVERGED_TIME);
  INFO(options << ": error " << distance(s.values(), VanDerPol::reference) << ", steps " << s.steps() << ", f "
               << problem.rhs_calls << ", Jacobians " << problem.jacobian_calls);
  CHECK(distance(s.values(), VanDerPol::reference) < 1e-4);
  CHECK(problem.jacobian_calls > 0);
  CHECK(problem.jacobian_calls < problem.rhs_calls / 5);
  CHECK(problem.rhs_calls < 60000);  // an explicit method needs a million
}

TEST_CASE("arkode without a Jacobian") {
  VanDerPol problem;
  Solver s({2, 0}, VanDerPol::rhs, &problem);
  SECTION("uses SPGMR") {
    s.configure("-ts_type arkode -ts_arkode_type dirk -ts_dt 1e-6 -ts_max_steps 10000 " + tolerances(1e-6));
    CHECK(s.solve(VanDerPol::t_end) == TS_CONVERGED_TIME);
    CHECK(distance(s.values(), VanDerPol::reference) < 1e-3);
    CHECK(view(s.ts).find("spgmr: linear iterations=") != std::string::npos);
  }
  SECTION("refuses the KSP") {
    s.configure("-ts_type arkode -ts_arkode_type dirk -ts_arkode_linear ksp");
    CHECK_THROWS_WITH(s.solve(1), Contains("TSSetRHSJacobian"));
  }
}

TEST_CASE("additive steps on the Brusselator with implicit diffusion", "[ranks]") {
  const auto end_of = [](const std::string& options) {
    Handle<DM, DMDestroy> dm;
    PetscMat matrix;
    petsc_check(Brusselator::dm_create(PETSC_COMM_WORLD, 30, dm.out()));
    petsc_check(DMCreateMatrix(dm, matrix.out()));
    Solver s(dm, Diffusion::reaction, nullptr);
    petsc_check(TSSetIFunction(s.ts, nullptr, Diffusion::ifunction, nullptr));
    petsc_check(TSSetIJacobian(s.ts, matrix, matrix, Diffusion::ijacobian, nullptr));
    petsc_check(Brusselator::initial(dm, s.y));
    s.configure("-ts_dt 1e-3 -ksp_rtol 1e-10 -snes_rtol 1e-10 -snes_stol 1e-10 " + options);
    CHECK(s.solve(5) == TS_CONVERGED_TIME);
    return s.values();
  };
  const auto reference = end_of("-ts_type arkimex -ts_arkimex_type 5" + tolerances(1e-9));
  for (const std::string order : {"3", "4", "5"}) {
    const auto here = end_of("-ts_type arkode -ts_arkode_type imex -ts_arkode_order " + order + tolerances(1e-6));
    INFO("order " << order << ", difference " << distance(here, reference));
    CHECK(distance(here, reference) < 1e-4);
  }
}

TEST_CASE("a multirate method evaluates the slow part rarely") {
  Counted slow{Oscillator::rhs_slow}, all{Oscillator::total};
  Oscillator fast;
  Solver s({1, 0, 1}, Counted::rhs, &slow), rk({1, 0, 1}, Counted::rhs, &all);
  petsc_check(TSSetIFunction(s.ts, nullptr, Oscillator::ifunction, &fast));
  s.configure("-ts_type arkode -ts_arkode_type mri -ts_arkode_order 4 -ts_arkode_fast_table fehlberg_13 -ts_dt 0.05" +
              tolerances(1e-9));
  s.solve(2);
  rk.configure("-ts_type rk -ts_rk_type 8vr -ts_dt 0.001" + tolerances(1e-12));
  rk.solve(2);
  INFO("slow " << slow.calls << ", fast " << fast.calls << ", together " << all.calls << ", difference "
               << s.values()[2] - rk.values()[2]);
  CHECK(std::abs(s.values()[2] - rk.values()[2]) < 1e-5);
  CHECK(slow.calls == 1 + 40 * 5);  // five evaluations per step
  CHECK(fast.calls > 20 * slow.calls);
}

TEST_CASE("arkode finds the bounces of a ball") {
  const std::string options = GENERATE("", "-ts_arkode_order 8", "-ts_arkode_type dirk",
                                       "-ts_arkode_order 4 -ts_arkode_fixed_step -ts_dt 0.01");
  Bounce ball;
  Counted counted{Bounce::rhs};
  Solver s({1, 0}, Counted::rhs, &counted);
  PetscInt direction[] = {0};
  PetscBool terminate[] = {PETSC_FALSE};
  s.configure("-ts_type arkode -ts_dt 0.01 " + tolerances(1e-9) + options);
  petsc_check(TSSetEventHandler(s.ts, 1, direction, terminate, Bounce::event, Bounce::bounce, &ball));
  petsc_check(TSSetEventTolerances(s.ts, 1e-10, nullptr));
  CHECK(s.solve(5) == TS_CONVERGED_TIME);
  // The dense output has order 5 at most, which is too low for the long steps of a method of order 8.
  const double bound = options == "-ts_arkode_order 8" ? 1e-5 : 1e-7;
  INFO(options << ": " << ball.times.size() << " bounces, evaluations " << counted.calls << ", steps " << s.steps()
               << ", error " << distance(s.values(), Bounce::exact(5)));
  REQUIRE(Bounce::exact_time(static_cast<int>(ball.times.size())) > 5);
  REQUIRE(ball.times.size() > 2);
  for (std::size_t i = 0; i < ball.times.size(); ++i)
    CHECK(std::abs(ball.times[i] - Bounce::exact_time(static_cast<int>(i))) < bound);
  CHECK(distance(s.values(), Bounce::exact(5)) < bound);
  CHECK(counted.calls < 5000);
}

TEST_CASE("arkode ends where TS wants it to") {
  Solver s = kepler();
  SECTION("at the final time exactly") {
    s.configure("-ts_type arkode -ts_dt 0.01" + tolerances(1e-8));
    s.solve(1);
    CHECK(s.time() == 1);
    s.solve(2.5);  // continues
    CHECK(s.time() == 2.5);
    CHECK(distance(s.values(), Kepler::exact(2.5)) < 1e-6);
  }
  SECTION("from a first step that ARKODE finds") {
    s.configure("-ts_type arkode -ts_dt 0" + tolerances(1e-8));
    s.solve(1);
    CHECK(s.time() == 1);
    CHECK(s.rejections() <= 1);
    CHECK(distance(s.values(), Kepler::exact(1)) < 1e-6);
  }
  SECTION("beyond it") {
    s.configure("-ts_type arkode -ts_dt 0.01 -ts_exact_final_time stepover" + tolerances(1e-8));
    s.solve(1);
    CHECK(s.time() > 1);
    CHECK(distance(s.values(), Kepler::exact(s.time())) < 1e-6);
  }
  SECTION("with the solution at it, by interpolation") {
    s.configure("-ts_type arkode -ts_dt 0.01 -ts_exact_final_time interpolate" + tolerances(1e-8));
    s.solve(1);
    CHECK(s.time() > 1);
    CHECK(distance(s.values(), Kepler::exact(1)) < 1e-6);
  }
  SECTION("at the times of a span") {
    PetscReal times[] = {0, 0.3, 0.31, 1.7, 2};
    ::Vec* solutions;
    PetscInt n;
    petsc_check(TSSetTimeSpan(s.ts, 5, times));
    s.configure("-ts_type arkode -ts_dt 0.01 -ts_arkode_table fehlberg_13" + tolerances(1e-10));
    s.solve(2);
    petsc_check(TSGetTimeSpanSolutions(s.ts, &n, &solutions));
    REQUIRE(n == 5);
    // The spans do not use dense output, whose order is below the order of this table.
    for (int i = 0; i < 5; ++i) CHECK(distance(s.values(solutions[i]), Kepler::exact(times[i])) < 1e-8);
  }
}

TEST_CASE("a step of TS may be rolled back and taken in parts") {
  Counted counted{Kepler::rhs};
  Solver s({0.7, 0, 0, Kepler::exact(0)[3]}, Counted::rhs, &counted);
  s.configure("-ts_type arkode -ts_dt 0.01" + tolerances(1e-8));
  petsc_check(TSSetSolution(s.ts, s.y));
  petsc_check(TSSetMaxTime(s.ts, 10));
  for (int i = 0; i < 10; ++i) petsc_check(TSStep(s.ts));
  const double before = s.time();
  const auto start = s.values();
  petsc_check(TSStep(s.ts));
  const double after = s.time();
  const auto end = s.values();
  const int calls = counted.calls;
  petsc_check(TSRollBack(s.ts));
  CHECK(s.time() == before);
  CHECK(s.values() == start);
  petsc_check(TSSetTimeStep(s.ts, 0.3 * (after - before)));
  petsc_check(TSStep(s.ts));
  CHECK(s.time() == before + 0.3 * (after - before));
  CHECK(distance(s.values(), Kepler::exact(s.time())) < 1e-6);
  CHECK(counted.calls <= calls + 1);  // for the dense output of order 4
  petsc_check(TSStep(s.ts));
  CHECK(s.time() == after);
  CHECK(s.values() == end);
}

TEST_CASE("arkode begins anew where the solution is not its own") {
  const auto calls_of = [](double factor) {
    Counted counted{decay};
    Solver s({1}, Counted::rhs, &counted);
    s.configure("-ts_type arkode -ts_dt 1e-5" + tolerances(1e-9));
    s.solve(1);
    if (factor != 1) petsc_check(VecScale(s.y, factor));  // without TSRestartStep
    const int before = counted.calls;
    s.solve(2);
    CHECK(s.values()[0] == Approx(factor * std::exp(-2.)).epsilon(1e-7));
    return counted.calls - before;
  };
  const int unchanged = calls_of(1), changed = calls_of(3), cold = [] {
    Counted counted{decay};
    Solver s({3}, Counted::rhs, &counted);
    s.configure("-ts_type arkode -ts_dt 1e-5" + tolerances(1e-9));
    s.solve(1);
    return counted.calls;
  }();
  INFO("evaluations: unchanged " << unchanged << ", changed " << changed << ", from a small step " << cold);
  CHECK(changed < cold);  // with a step that is known
  CHECK(changed < 1.5 * unchanged);
}

TEST_CASE("step sizes of arkode keep the limits of TSAdapt") {
  struct Range {
    double least = 1e300, most = 0;
    static PetscErrorCode monitor(TS ts, PetscInt, PetscReal t, ::Vec, void* context) {
      auto& self = *static_cast<Range*>(context);
      PetscReal previous;
      PetscFunctionBegin;
      PetscCall(TSGetPrevTime(ts, &previous));
      if (t > previous) self.least = std::min(self.least, t - previous), self.most = std::max(self.most, t - previous);
      PetscFunctionReturn(0);
    }
  } range;
  Solver s = kepler();
  s.configure("-ts_type arkode -ts_dt 0.04 -ts_adapt_dt_max 0.05 -ts_adapt_dt_min 0.03 -ts_exact_final_time stepover" +
              tolerances(1e-5));
  petsc_check(TSMonitorSet(s.ts, Range::monitor, &range, nullptr));
  s.solve(3);
  CHECK(range.most <= 0.05 * (1 + 1e-12));
  CHECK(range.most > 0.049);
  CHECK(range.least >= 0.03 * (1 - 1e-12));
  CHECK(s.steps() <= 101);

  Solver few = kepler();
  few.configure("-ts_type arkode -ts_dt 0.01 -ts_max_steps 7" + tolerances(1e-8));
  CHECK(few.solve(3) == TS_CONVERGED_ITS);
  CHECK(few.steps() == 7);
}

TEST_CASE("rejected steps are counted, the next step is reported") {
  Solver s = kepler();
  s.configure("-ts_type arkode -ts_dt 1 -ts_exact_final_time stepover" + tolerances(1e-8));
  s.solve(0.5);
  const std::string text = view(s.ts);
  CHECK(s.rejections() > 0);
  CHECK(s.rejections() == number_after(text, "error test failures"));
  CHECK(s.steps() == number_after(text, "  steps"));
  CHECK(s.time_step() == Approx(number_after(text, "next step")).epsilon(1e-4));
}

TEST_CASE("every tolerance of a vector counts") {
  const auto error_of = [](double first, double second) {
    Solver s({1, 0, 1, 0}, oscillators, nullptr);  // two of them, of frequency 1 and 5
    PetscVec tolerance;
    petsc_check(VecDuplicate(s.y, tolerance.out()));
    for (const PetscInt i : {0, 1, 2, 3}) petsc_check(VecSetValue(tolerance, i, i < 2 ? first : second, INSERT_VALUES));
    petsc_check(VecAssemblyBegin(tolerance));
    petsc_check(VecAssemblyEnd(tolerance));
    s.configure("-ts_type arkode -ts_dt 1e-2");
    petsc_check(TSSetTolerances(s.ts, 0, tolerance, 0, tolerance));
    s.solve(5);
    return std::abs(s.values()[2] - std::cos(25.));
  };
  CHECK(error_of(1e-3, 1e-9) < 1e-6);
  CHECK(error_of(1e-3, 1e-3) > 1e-4);
}

TEST_CASE("-ts_view of arkode names the table and counts") {
  Counted counted{Kepler::rhs};
  Solver s({0.7, 0, 0, Kepler::exact(0)[3]}, Counted::rhs, &counted);
  s.configure("-ts_type arkode -ts_arkode_table verner -ts_dt 0.01" + tolerances(1e-8));
  s.solve(1);
  const std::string text = view(s.ts);
  CHECK_THAT(text, Contains("ARKODE erk, table VERNER_8_5_6, adaptive steps"));
  CHECK(number_after(text, "right-hand sides") == counted.calls);

  Solver implicit = additive(Form::split);
  implicit.configure("-ts_type arkode -ts_arkode_type imex -ts_dt 0.01 -ksp_type preonly -pc_type lu");
  implicit.solve(1);
  const std::string more = view(implicit.ts);
  CHECK_THAT(more, Contains("ARKODE imex, table ARK436L2SA_6_3_4"));
  CHECK_THAT(more, Contains("type: preonly"));
  PetscInt iterations, linear;
  petsc_check(TSGetSNESIterations(implicit.ts, &iterations));
  petsc_check(TSGetKSPIterations(implicit.ts, &linear));
  CHECK(number_after(more, "nonlinear iterations") == iterations);
  CHECK(number_after(more, "linear iterations") > 0);
  CHECK(linear > 0);
  CHECK(linear <= iterations);  // a direct solve each, at most
  CHECK(number_after(more, "explicit") >= 6 * implicit.steps());
}

TEST_CASE("tables of arkode are found by name") {
  const auto table_of = [](const std::string& options) {
    Solver s = additive(Form::split);
    if (options.find("erk") != std::string::npos) s = additive(Form::rhs);
    s.configure("-ts_type arkode -ts_arkode_type " + options);
    petsc_check(TSSetSolution(s.ts, s.y));
    petsc_check(TSSetUp(s.ts));
    return view(s.ts);
  };
  CHECK_THAT(table_of("erk"), Contains("table DORMAND_PRINCE_7_4_5"));
  CHECK_THAT(table_of("erk -ts_arkode_table Cash_Karp"), Contains("table CASH_KARP_6_4_5"));
  CHECK_THAT(table_of("erk -ts_arkode_table ARKODE_FEHLBERG_6_4_5"), Contains("table FEHLBERG_6_4_5"));
  CHECK_THAT(table_of("erk -ts_arkode_order 8"), Contains("table FEHLBERG_13_7_8"));
  CHECK_THAT(table_of("imex -ts_arkode_table ark548l2sa"), Contains("table ARK548L2SA_8_4_5"));
  CHECK_THAT(table_of("mri"), Contains("table MIS_KW3"));
  CHECK_THROWS_WITH(table_of("erk -ts_arkode_table fehlberg"), Contains("more than one table"));
  CHECK_THROWS_WITH(table_of("erk -ts_arkode_table rk4"),
                    Contains("no table of the type erk") && Contains("zonneveld"));
  CHECK_THROWS_WITH(table_of("dirk -ts_arkode_order 8"), Contains("2, 3, 4, 5"));
  CHECK_THROWS_WITH(table_of("erk -ts_arkode_table knoth_wolke"), Contains("-ts_arkode_fixed_step"));
}

TEST_CASE("arkode refuses what it cannot solve") {
  SECTION("an implicit function for an explicit method") {
    Solver s = additive(Form::split);
    s.configure("-ts_type arkode");
    CHECK_THROWS_WITH(s.solve(1), Contains("implicit function"));
  }
  SECTION("one part where there should be two") {
    Solver s = additive(Form::rhs);
    s.configure("-ts_type arkode -ts_arkode_type imex");
    CHECK_THROWS_WITH(s.solve(1), Contains("TSSetIFunction"));
  }
  SECTION("a mass matrix") {
    Solver s = additive(Form::split);
    petsc_check(TSSetIFunction(s.ts, nullptr, heavy, nullptr));
    s.configure("-ts_type arkode -ts_arkode_type imex");
    CHECK_THROWS_WITH(s.solve(1), Contains("mass matrix"));
  }
}

TEST_CASE("errors of callbacks come out of arkode unchanged") {
  const std::string type = GENERATE("erk", "dirk", "imex", "mri");
  for (const int call : {1, 2, 30}) {
    Solver s = additive(type == "imex" || type == "mri" ? Form::split : Form::rhs);
    Counted counted{type == "imex" || type == "mri" ? Additive::rhs_explicit : Additive::rhs};
    counted.fail_at_call = call;
    petsc_check(TSSetRHSFunction(s.ts, nullptr, Counted::rhs, &counted));
    s.configure("-ts_type arkode -ts_dt 0.01 -ts_arkode_type " + type);
    petsc_check(TSSetMaxTime(s.ts, 2));
    INFO(type << ", call " << call);
    CHECK(TSSolve(s.ts, s.y) == PETSC_ERR_MEMC);
    CHECK(counted.calls == call);
  }
  Solver s = additive(Form::rhs);
  petsc_check(TSSetRHSFunction(
      s.ts, nullptr,
      [](TS, PetscReal, ::Vec, ::Vec, void*) { return petsc_callback([] { throw OutputError("disk full"); }); },
      nullptr));
  s.configure("-ts_type arkode -ts_arkode_type " + type);
  if (type == "erk" || type == "dirk") CHECK_THROWS_AS(s.solve(1), OutputError);
}

TEST_CASE("steps of arkode that meet values out of bounds are made shorter") {
  // ẏ = −√y − 1/2, undefined for y < 0: a large step that ends at y > 0 may have stages below.
  const std::string options = GENERATE("", "-ts_arkode_type dirk");
  for (const bool domain : {false, true}) {
    Solver s({1}, root, nullptr);
    if (domain) petsc_check(TSSetFunctionDomainError(s.ts, not_negative));
    s.configure("-ts_type arkode -ts_dt 5 " + tolerances(1e-8) + options);
    CHECK(s.solve(0.7) == TS_CONVERGED_TIME);
    CHECK(s.rejections() > 0);
    // With w = √y: 2 w + 1 = (2 w0 + 1) …, t = 2 (w0 − w) − ln((2 w0 + 1)/(2 w + 1)).
    const double w = std::sqrt(s.values()[0]);
    CHECK(2 * (1 - w) - std::log(3 / (2 * w + 1)) == Approx(0.7).epsilon(1e-6));
  }
}

TEST_CASE("arkode gives up with a reason") {
  const auto reason_of = [](Solver& s, const std::string& options) {
    petsc_check(TSSetErrorIfStepFails(s.ts, PETSC_FALSE));
    s.configure("-ts_type arkode -ts_dt 0.01 " + options);
    return s.solve(2);
  };
  SECTION("values that are not finite") {
    const std::string options = GENERATE("", "-ts_arkode_type dirk", "-ts_arkode_fixed_step");
    INFO(options);
    Solver s({1}, nan_after_one, nullptr);
    CHECK(reason_of(s, options) < 0);
    CHECK(s.time() <= 1);
    CHECK(s.time() > 0.9);
    CHECK(std::isfinite(s.values()[0]));
  }
  SECTION("from the first value on") {
    Solver s(
        {1}, [](TS, PetscReal, ::Vec, ::Vec f, void*) { return VecSet(f, std::nan("")); }, nullptr);
    CHECK(reason_of(s, "") == TS_DIVERGED_STEP_REJECTED);
  }
  SECTION("too much accuracy") {
    Solver s({1}, decay, nullptr);
    CHECK(reason_of(s, tolerances(1e-20)) == TS_DIVERGED_STEP_REJECTED);
    CHECK(s.values()[0] == 1);
  }
  SECTION("errors too large at the smallest step") {
    Solver s = kepler();
    CHECK(reason_of(s, "-ts_adapt_dt_min 0.1" + tolerances(1e-12)) == TS_DIVERGED_STEP_REJECTED);
  }
  SECTION("too many rejections in a row") {
    Solver s = kepler();
    CHECK(reason_of(s, "-ts_dt 1 -ts_max_reject 1" + tolerances(1e-12)) == TS_DIVERGED_STEP_REJECTED);
    CHECK(s.rejections() > 0);
  }
  SECTION("and goes on where it is asked for something easier") {
    Solver s = kepler();
    CHECK(reason_of(s, tolerances(1e-20)) < 0);
    petsc_check(TSSetTolerances(s.ts, 1e-8, nullptr, 1e-8, nullptr));
    CHECK(s.solve(2) == TS_CONVERGED_TIME);
    CHECK(distance(s.values(), Kepler::exact(2)) < 1e-6);
  }
  SECTION("a nonlinear solve that does not converge") {
    VanDerPol problem;
    Solver s({2, 0}, VanDerPol::rhs, &problem);
    CHECK(reason_of(s, "-ts_arkode_type dirk -ts_arkode_nonlinear fixedpoint -ts_arkode_fixed_step") ==
          TS_DIVERGED_NONLINEAR_SOLVE);
  }
}

}  // namespace pliant::test::arkode_test
