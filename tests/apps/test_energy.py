"""Steps that are too long are refused or noticed: limits of stability by method, error control, the energy audit."""

import json

import numpy as np
import pytest
from conftest import SMALL, Results, pliant
from test_channel import SMALL as CHANNEL

CLOSED = {"n": 60, "hopper_wall_distance": 8, "hopper_width": 1e-6, "pack_fraction": 0.5, "t_end": 4, "integrator": "ts"}
TS = {**SMALL, "integrator": "ts"}


def summary_of(folder):
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("method", [{"ts_type": "euler"}, {"ts_type": "rk", "ts_rk_type": "1fe"},
                                    {"ts_type": "rk", "ts_rk_type": "2a", "ts_adapt_type": "none"},
                                    {"ts_type": "ssp", "ts_ssp_nstages": 2}])
def test_methods_without_a_stable_step(method, tmp_path):
    """Undamped oscillations grow at any step; with drag there is a limit, far below the limit of Verlet."""
    run = lambda name, **more: pliant("hopper", output=tmp_path / name, **{**CLOSED, "dt": 5e-4, **method, **more})
    refused = run("refused", zeta=0)
    assert refused.returncode == 2 and "no step is stable" in refused.stderr and "-integrator verlet" in refused.stderr
    limited = run("limited", zeta=0.1)
    if method["ts_type"] == "euler" or method.get("ts_rk_type") == "1fe":
        assert limited.returncode == 2 and "times the limit of stability" in limited.stderr


@pytest.mark.parametrize("method", [{"ts_type": "ssp"}, {"ts_type": "rk", "ts_rk_type": "2b", "ts_adapt_type": "none"}])
def test_the_default_step_is_stable_for_the_method(method, tmp_path):
    """Velocity Verlet would allow a longer step."""
    options = {"n": 50, "hopper_wall_distance": 8, "integrator": "ts", **method}
    result = pliant("hopper", output=tmp_path / "run", **options, t_end=0.01)
    assert result.returncode == 0 and "dt/dt_critical = 0.70" in result.stdout, result.stderr
    longer = pliant("hopper", output=tmp_path / "longer", **options, t_end=0.01, dt=1e-3)
    assert longer.returncode == 2 and "shorten it or leave it out" in longer.stderr


def test_energy_that_a_method_makes(tmp_path):
    made = pliant("hopper", output=tmp_path / "made", **CLOSED, zeta=0, dt=5e-4, ts_type="euler", allow_unstable_dt="yes")
    assert made.returncode == 3 and "energy is not conserved" in made.stderr, made.stderr
    s = summary_of(tmp_path / "made")
    assert s["status"] == "failed" and s["energy_audit"]["relative_error"] > 0.1
    allowed = pliant("hopper", output=tmp_path / "allowed", **CLOSED, zeta=0, dt=5e-4, ts_type="euler",
                     allow_unstable_dt="yes", allow_energy_error="yes")
    assert allowed.returncode == 0 and "energy is conserved to" in allowed.stderr


def test_a_gain_of_energy_in_few_steps(tmp_path):
    """The heat of drag has too few samples for an error, but it is not negative."""
    made = pliant("hopper", output=tmp_path / "run", n=40, hopper_wall_distance=8, hopper_width=4, t_end=1.2, zeta=0.01, mu=0, dt=0.006,
                  allow_unstable_dt="yes")
    assert made.returncode == 3 and "% (uncertainty unknown: too few samples of the heat): energy is not conserved" in made.stderr, made.stderr
    assert summary_of(tmp_path / "run")["energy_audit"]["uncertainty"] is None


@pytest.mark.parametrize("options, words", [
    ({"ts_adapt_dt_min": 1.2e-2}, "-ts_adapt_dt_min 0.012 is"),
    ({"ts_adapt_dt_min": 10}, "error: -ts_adapt_dt_min 10 is not below the longest step, 0."),
    ({"ts_adapt_dt_min": 1e-3, "ts_adapt_dt_max": 5e-4}, "error: -ts_adapt_dt_min 0.001 is not below the longest step, 0.0005 (-ts_adapt_dt_max)"),
    ({"ts_rtol": 1}, "-ts_rtol 1 does not control errors"),
    ({"ts_atol": 3}, "-ts_atol 3 does not control errors"),
    ({"ts_type": "cvode", "ts_rtol": 1}, "-ts_rtol 1 does not control errors"),
    ({"ts_type": "bdf", "snes_rtol": 1}, "-snes_rtol 1 lets the solver stop before it has begun"),
    ({"ts_type": "cn", "snes_atol": 10}, "-snes_atol 10 lets the solver stop before it has begun"),
    ({"ts_type": "bdf", "ksp_rtol": 1}, "-ksp_rtol 1 lets the solver stop before it has begun"),
    ({"ts_type": "arkimex", "ksp_atol": 0.1}, "-ksp_atol 0.1 lets the solver stop before it has begun"),
    ({"ts_type": "cn", "snes_max_it": 0}, "-snes_max_it 0: the solver needs at least one iteration"),
    ({"ts_adapt_max_ignore": 1e9}, "-ts_adapt_max_ignore cannot be set"),
    ({"ts_adapt_type": "cfl"}, "-ts_adapt_type cfl does not control"),
    ({"ts_type": "arkode", "ts_arkode_fixed_step": "yes", "dt": 2e-2}, "times the limit of stability"),
])
def test_error_control_that_is_taken_away(options, words, tmp_path):
    refused = pliant("hopper", output=tmp_path / "run", **{**TS, **options})
    assert refused.returncode == 2 and words in refused.stderr, refused.stderr


def test_steps_above_the_tolerance(tmp_path):
    """Accepted all the same, counted, and reported; their energy error ends the run."""
    for name, options in {"least": {"ts_adapt_dt_min": 2e-3, "ts_rtol": 1e-7, "ts_atol": 1e-7},
                          "always": {"ts_adapt_always_accept": "yes", "ts_rtol": 1e-7, "ts_atol": 1e-7}}.items():
        result = pliant("hopper", output=tmp_path / name, **{**TS, **options})
        assert "steps were accepted with an error above the tolerance" in result.stderr
        s = summary_of(tmp_path / name)
        assert 0 < s["steps_above_tolerance"] <= s["steps"]
    made = pliant("hopper", output=tmp_path / "made", **TS, ts_adapt_dt_min=1.2e-2, allow_unstable_dt="yes")
    assert made.returncode == 3
    assert pliant("hopper", output=tmp_path / "fine", **TS).stderr == ""
    assert summary_of(tmp_path / "fine")["steps_above_tolerance"] == 0


@pytest.mark.parametrize("options", [{}, {"mu": 0}, {"zeta": 0}, {"model": "disk", "mu": 0}, {"flow": "discharge"},
                                     {"integrator": "ts"}, {"model": "rough", "n_vertices": 8, "n": 30, "t_end": 2}])
def test_the_audit_of_sound_runs(options, tmp_path):
    options = {**SMALL, **options}
    if options.get("model") == "disk":
        options.pop("mu")
    result = pliant("hopper", output=tmp_path / "run", **options)
    assert result.returncode == 0 and "energy is conserved to" not in result.stderr, result.stderr
    audit = summary_of(tmp_path / "run")["energy_audit"]
    assert audit["heat"] > 0 and audit["error"] == pytest.approx(audit["change"] - audit["work"] + audit["heat"])
    assert audit["relative_error"] < 0.01 + 3 * audit["uncertainty"] and audit["uncertainty"] < 0.05
    assert "energy: change" in result.stdout


def budget_errors(series):
    energy = series["kinetic_energy"] + series["potential_energy"] + series["gravity_energy"]
    return energy - energy[0] - series["work"] + series["heat"]


@pytest.mark.parametrize("options", [{}, {"flow": "discharge"}, {"model": "disk", "zeta": 0.5, "hopper_width": 4}, {"integrator": "ts"},
                                     {"model": "smooth", "n_vertices": 8, "edge_width": 0.3, "n": 30, "t_end": 3},
                                     {"dim": 3, "hopper_wall_distance": 4, "pack_fraction": 0.5},
                                     {"dim": 3, "model": "rough", "n": 10, "hopper_wall_distance": 5, "pack_fraction": 0.3, "t_end": 2}])
def test_every_sample_balances(options, tmp_path):
    """Samples at other times than the audit's values of the heat, which are 64 steps of Verlet, or 8 of TS, apart."""
    options = {**SMALL, "sample_interval": 0.03, **options}
    if options.get("model") == "disk":
        options.pop("mu")
    result = pliant("hopper", output=tmp_path / "run", **options)
    assert result.returncode == 0, result.stderr
    series, audit = Results(tmp_path / "run").series, summary_of(tmp_path / "run")["energy_audit"]
    scale = max(abs(audit[name]) for name in ("work", "heat", "change"))
    assert np.abs(budget_errors(series)).max() < (2 * audit["relative_error"] + 3 * audit["uncertainty"] + 1e-3) * scale < 0.1 * scale
    rising = np.diff(series["heat"])  # the power differs between two times of the audit: steps backwards are small
    assert series["heat"][0] == 0 == series["work"][0] and rising.min() > -1e-3 * scale and series["heat"][-1] > 0.5 * scale
    assert series["work"][-1] == audit["work"] and series["heat"][-1] == pytest.approx(audit["heat"], rel=1e-12)
    if options["t_end"] == SMALL["t_end"]:
        assert (np.diff(series["work"]) != 0).sum() > 2  # reinsertions, or removals


def test_without_an_audit_there_is_no_budget(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **{**TS, "mu": 0, "t_end": 1}, dynamics="overdamped")
    assert result.returncode == 0, result.stderr
    series = Results(tmp_path / "run").series
    assert "gravity_energy" in series and not {"work", "heat"} & set(series)


def test_the_audit_goes_on_after_a_restart(tmp_path):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    assert pliant("hopper", output=whole, **SMALL).returncode == 0
    assert pliant("hopper", output=parts, **{**SMALL, "t_end": 2.345}).returncode == 0
    assert pliant("hopper", restart=parts, t_end=SMALL["t_end"]).returncode == 0
    assert summary_of(parts)["energy_audit"] == summary_of(whole)["energy_audit"]
    a, b = Results(whole).series, Results(parts).series
    assert all(np.array_equal(a[name], b[name]) for name in ("gravity_energy", "work", "heat")) and a["work"][-1] != 0


def test_a_raft_that_makes_energy(tmp_path):
    resting = {"rows": 2, "columns": 1, "delta": 0, "motion": "extension", "v_wall": 1e-4, "t_end": 400, "ts_adapt_type": "none"}
    made = pliant("raft", output=tmp_path / "made", **resting, ts_type="euler", dt=0.25, allow_unstable_dt="yes")
    assert made.returncode == 3, made.stderr


def test_a_channel_that_makes_energy(tmp_path):
    sound = pliant("channel", output=tmp_path / "sound", **{**CHANNEL, "pushes": 1})
    s = summary_of(tmp_path / "sound")
    assert sound.returncode == 0 and s["energy_audit"]["relative_error"] < 0.01
    assert s["energy_audit"]["heat"] == s["heat"]["value"]
    made = pliant("channel", output=tmp_path / "made", **{**CHANNEL, "pushes": 1}, dt=2.8 * s["dt_critical"],
                  allow_unstable_dt="yes")
    assert made.returncode == 3, made.stderr


def test_the_work_of_plungers_does_not_depend_on_samples(tmp_path):
    work = []
    for travel in (0.011, 1):
        pliant("channel", output=tmp_path / str(travel), **{**CHANNEL, "pushes": 1}, sample_travel=travel)
        work.append(Results(tmp_path / str(travel)).series["plunger_work"][-1])
    assert work[0] == work[1] != 0


def test_the_step_of_ts_dt(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **TS, ts_dt=5e-4)
    assert result.returncode == 0 and "dt = 0.0005 t0" in result.stdout
    assert summary_of(tmp_path / "run")["dt"] == 5e-4
