"""Implicit integrators from the command line."""

import re

import pytest
from conftest import SMALL, hopper, pliant


@pytest.mark.parametrize("model", ["sp", "rough", "smooth"])
def test_jacobians_pass_petscs_own_test(tmp_path, model):
    result = pliant("hopper", output=tmp_path / "run", **{**SMALL, "model": model, "n": 8, "n_vertices": 6, "t_end": 2e-3},
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
