// Test problems as plain PETSc callbacks, with exact or reference solutions.
#pragma once

#include <petscdmda.h>
#include <petscts.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace problems {

// Planar two-body problem, y = (x, v), unit semi-axis and period 2π.
struct Kepler {
  static constexpr double eccentricity = 0.3;
  static constexpr double period = 2 * std::numbers::pi;

  static std::array<double, 4> exact(double t) {
    const double e = eccentricity, root = std::sqrt(1 - e * e);
    double anomaly = t;
    for (int i = 0; i < 50; ++i) anomaly -= (anomaly - e * std::sin(anomaly) - t) / (1 - e * std::cos(anomaly));
    const double c = std::cos(anomaly), s = std::sin(anomaly), rate = 1 / (1 - e * c);
    return {c - e, root * s, -s * rate, root * c * rate};
  }
  static PetscErrorCode rhs(TS, PetscReal, Vec y, Vec f, void*) {
    const PetscScalar* in;
    PetscScalar* out;
    PetscFunctionBegin;
    PetscCall(VecGetArrayRead(y, &in));
    PetscCall(VecGetArrayWrite(f, &out));
    const double r2 = in[0] * in[0] + in[1] * in[1], r3 = r2 * std::sqrt(r2);
    out[0] = in[2];
    out[1] = in[3];
    out[2] = -in[0] / r3;
    out[3] = -in[1] / r3;
    PetscCall(VecRestoreArrayWrite(f, &out));
    PetscCall(VecRestoreArrayRead(y, &in));
    PetscFunctionReturn(0);
  }
};

// Van der Pol, y'' = ((1 − y²) y' − y)/ε, from (2, 0).
struct VanDerPol {
  double epsilon = 1e-6;
  int rhs_calls = 0, jacobian_calls = 0;

  static constexpr double t_end = 2;
  // For ε = 1e-6 at t = 2: Mazzia and Magherini, Test Set for Initial Value Problem Solvers (2008), problem vdpol.
  static constexpr std::array<double, 2> reference{1.706167732170483, -0.8928097010247975};

  static PetscErrorCode rhs(TS, PetscReal, Vec y, Vec f, void* context) {
    auto& self = *static_cast<VanDerPol*>(context);
    const PetscScalar* in;
    PetscScalar* out;
    PetscFunctionBegin;
    ++self.rhs_calls;
    PetscCall(VecGetArrayRead(y, &in));
    PetscCall(VecGetArrayWrite(f, &out));
    out[0] = in[1];
    out[1] = ((1 - in[0] * in[0]) * in[1] - in[0]) / self.epsilon;
    PetscCall(VecRestoreArrayWrite(f, &out));
    PetscCall(VecRestoreArrayRead(y, &in));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode jacobian(TS, PetscReal, Vec y, Mat a, Mat p, void* context) {
    auto& self = *static_cast<VanDerPol*>(context);
    const PetscScalar* in;
    const PetscInt rows[] = {0, 1};
    PetscFunctionBegin;
    ++self.jacobian_calls;
    PetscCall(VecGetArrayRead(y, &in));
    const PetscScalar values[] = {0, 1, (-2 * in[0] * in[1] - 1) / self.epsilon, (1 - in[0] * in[0]) / self.epsilon};
    PetscCall(VecRestoreArrayRead(y, &in));
    PetscCall(MatSetValues(p, 2, rows, 2, rows, values, INSERT_VALUES));
    PetscCall(MatAssemblyBegin(p, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(p, MAT_FINAL_ASSEMBLY));
    if (a != p) {
      PetscCall(MatAssemblyBegin(a, MAT_FINAL_ASSEMBLY));
      PetscCall(MatAssemblyEnd(a, MAT_FINAL_ASSEMBLY));
    }
    PetscFunctionReturn(0);
  }
};

// Brusselator with diffusion on (0, 1), Hairer and Wanner II, section IV.1: u = 1, v = 3 at the ends. On any ranks:
// the unknowns (u, v) lie on the points of a DMDA (dm_create), matrices come from it.
struct Brusselator {
  static constexpr double a = 1, b = 3, diffusion = 1. / 50;

  static PetscErrorCode dm_create(MPI_Comm comm, PetscInt points, DM* dm) {
    PetscFunctionBegin;
    PetscCall(DMDACreate1d(comm, DM_BOUNDARY_GHOSTED, points, 2, 1, nullptr, dm));
    PetscCall(DMSetMatType(*dm, MATAIJ));
    PetscCall(DMSetUp(*dm));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode initial(DM dm, Vec y) {
    DMDALocalInfo info;
    PetscScalar** out;
    PetscFunctionBegin;
    PetscCall(DMDAGetLocalInfo(dm, &info));
    PetscCall(DMDAVecGetArrayDOFWrite(dm, y, &out));
    for (PetscInt i = info.xs; i < info.xs + info.xm; ++i) {
      out[i][0] = 1 + std::sin(2 * std::numbers::pi * (i + 1) / (info.mx + 1));
      out[i][1] = 3;
    }
    PetscCall(DMDAVecRestoreArrayDOFWrite(dm, y, &out));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode rhs(TS ts, PetscReal, Vec y, Vec f, void*) {
    DM dm;
    DMDALocalInfo info;
    Vec local;
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
    const double spread = diffusion * (info.mx + 1) * (info.mx + 1);
    for (PetscInt i = info.xs; i < info.xs + info.xm; ++i) {
      const double u = in[i][0], v = in[i][1];
      out[i][0] = a + u * u * v - (b + 1) * u + spread * (in[i - 1][0] - 2 * u + in[i + 1][0]);
      out[i][1] = b * u - u * u * v + spread * (in[i - 1][1] - 2 * v + in[i + 1][1]);
    }
    PetscCall(DMDAVecRestoreArrayDOFWrite(dm, f, &out));
    PetscCall(DMDAVecRestoreArrayDOF(dm, local, &in));
    PetscCall(DMRestoreLocalVector(dm, &local));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode jacobian(TS ts, PetscReal, Vec y, Mat matrix, Mat p, void*) {
    DM dm;
    DMDALocalInfo info;
    const PetscScalar* const* in;
    PetscFunctionBegin;
    PetscCall(TSGetDM(ts, &dm));
    PetscCall(DMDAGetLocalInfo(dm, &info));
    PetscCall(DMDAVecGetArrayDOFRead(dm, y, &in));
    const double spread = diffusion * (info.mx + 1) * (info.mx + 1);
    for (PetscInt i = info.xs; i < info.xs + info.xm; ++i) {
      const double u = in[i][0], v = in[i][1];
      MatStencil point{};
      point.i = i;
      const PetscScalar block[] = {2 * u * v - (b + 1) - 2 * spread, u * u, b - 2 * u * v, -u * u - 2 * spread};
      const PetscScalar neighbour[] = {spread, 0, 0, spread};
      PetscCall(MatSetValuesBlockedStencil(p, 1, &point, 1, &point, block, INSERT_VALUES));
      for (const PetscInt j : {i - 1, i + 1}) {
        if (j < 0 || j >= info.mx) continue;
        MatStencil next{};
        next.i = j;
        PetscCall(MatSetValuesBlockedStencil(p, 1, &point, 1, &next, neighbour, INSERT_VALUES));
      }
    }
    PetscCall(DMDAVecRestoreArrayDOFRead(dm, y, &in));
    PetscCall(MatAssemblyBegin(p, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(p, MAT_FINAL_ASSEMBLY));
    if (matrix != p) {
      PetscCall(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
      PetscCall(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
    }
    PetscFunctionReturn(0);
  }
};

// A mass on a spring that pulls it to x = −1, dropped at rest from x = 1: x'' = −1 − x, y = (x, v). The mass bounces at
// x = 0 with v ← −restitution v: an event and a jump of the solution, at times that are known.
struct Bounce {
  static constexpr double restitution = 0.9;
  std::vector<double> times;  // of the bounces, as found

  // Time of the n-th bounce (n = 0, 1, …), and the speed after it.
  static double exact_time(int n) {
    double t = std::acos(0.5);
    for (int i = 0; i < n; ++i) t += 2 * std::atan(exact_speed(i));
    return t;
  }
  static double exact_speed(int n) { return std::sqrt(3.) * std::pow(restitution, n + 1); }
  // (x, v) at t.
  static std::array<double, 2> exact(double t) {
    if (t < exact_time(0)) return {2 * std::cos(t) - 1, -2 * std::sin(t)};
    int n = 0;
    while (exact_time(n + 1) <= t) ++n;
    const double s = t - exact_time(n), v = exact_speed(n);
    return {std::cos(s) + v * std::sin(s) - 1, v * std::cos(s) - std::sin(s)};
  }

  static PetscErrorCode rhs(TS, PetscReal, Vec y, Vec f, void*) {
    const PetscScalar* in;
    PetscScalar* out;
    PetscFunctionBegin;
    PetscCall(VecGetArrayRead(y, &in));
    PetscCall(VecGetArrayWrite(f, &out));
    out[0] = in[1];
    out[1] = -1 - in[0];
    PetscCall(VecRestoreArrayWrite(f, &out));
    PetscCall(VecRestoreArrayRead(y, &in));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode event(TS, PetscReal, Vec y, PetscScalar* value, void*) {
    const PetscScalar* in;
    PetscFunctionBegin;
    PetscCall(VecGetArrayRead(y, &in));
    value[0] = in[0];
    PetscCall(VecRestoreArrayRead(y, &in));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode bounce(TS, PetscInt, PetscInt[], PetscReal t, Vec y, PetscBool, void* context) {
    PetscScalar* values;
    PetscFunctionBegin;
    static_cast<Bounce*>(context)->times.push_back(t);
    PetscCall(VecGetArray(y, &values));
    values[0] = 0;
    values[1] = restitution * std::abs(values[1]);
    PetscCall(VecRestoreArray(y, &values));
    PetscFunctionReturn(0);
  }
};

}  // namespace problems
