"""Implicit integrators from the command line."""

import re

import pytest
from conftest import SMALL, hopper, pliant


@pytest.mark.parametrize("model", ["sp", "rough", "smooth"])
def test_jacobians_pass_petscs_own_test(tmp_path, model):
    shape = {} if model == "sp" else {"n_vertices": 6}
    result = pliant("hopper", output=tmp_path / "run", **{**SMALL, "model": model, "n": 8, "t_end": 2e-3, **shape},
                    integrator="ts", ts_type="beuler", dt=1e-3, snes_test_jacobian=1e-6)
    assert result.returncode == 0, result.stderr
    ratios = re.findall(r"\|\|J - Jfd\|\|_F/\|\|J\|\|_F = ([-+.e\d]+)", result.stdout)
    assert ratios and max(map(float, ratios)) < 1e-6


@pytest.mark.parametrize("method", [{"ts_type": "bdf"}, {"ts_type": "alpha2", "jacobian": "matrix_free"},
                                    {"ts_type": "arkimex", "implicit": "shape"}])
def test_implicit_runs(tmp_path, method):
    run = hopper(tmp_path / "run", model="rough", n=8, n_vertices=6, t_end=0.05, dt=2e-4, integrator="ts", **method)
    assert run.summary["integrator"].startswith("ts:" + method["ts_type"])
    assert run.summary["jacobian_evaluations"] > 0 and run.summary["linear_iterations"] > 0
    assert run.summary["t"] == 0.05


def test_alpha2_goes_on_after_friction_sets_in(tmp_path):
    """Where friction jumps within a step there may be no solution; PETSc tries a first step with the same length again
    and again, and every particle that is reinserted makes a first step."""
    run = hopper(tmp_path / "run", n=200, hopper_wall_distance=16, hopper_width=5, mu=10, zeta=0, t_end=8, seed=2,
                 pack_fraction=0.84, dt=0.01, integrator="ts", ts_type="alpha2", ts_adapt_type="none")
    assert run.summary["t"] == 8 and 800 < run.summary["steps"] < 850
    assert run.summary["crossed_count"] > 10


@pytest.mark.parametrize("options, text", [
    ({"ts_arkode_type": "imex"}, "needs forces in two parts; use implicit shape energies alone (-implicit shape)"),
    ({"ts_arkode_type": "MRI"}, "needs forces in two parts; use implicit shape energies alone (-implicit shape)"),
    ({"implicit": "shape"}, "which -ts_arkode_type erk cannot treat differently; use imex, mri or one treatment of all forces (-implicit all)"),
    ({"implicit": "shape", "ts_arkode_type": "dirk"}, "which -ts_arkode_type dirk cannot treat differently; use imex, mri or"),
])
def test_methods_of_arkode_that_do_not_fit_the_split_are_refused(tmp_path, options, text):
    result = pliant("hopper", output=tmp_path / "run", **{**SMALL, "model": "rough", "n": 8, "n_vertices": 6},
                    integrator="ts", ts_type="arkode", **options)
    assert result.returncode == 2
    assert text in result.stderr
