"""Steady shear at a rate: budget of energy and momentum, restart, ranks, integrators, statistics, refusals. Oscillatory
shear."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from conftest import Results, assert_same_runs, pliant
from test_parallel import assert_near_runs, complaints, needs_mpi, on_any_ranks, on_ranks

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))
from pliant import Run, analysis  # noqa: E402

DENSE = {"n": 24, "path": "quench", "fraction": 0.95, "shear_rate": 0.02, "strain": 1}
POLYGONS = {"n": 6, "n_vertices": 8, "path": "decompress", "fraction": 0.4, "pressure": 1e-2, "strain": 0.5}


def shear(folder, **options):
    result = pliant("shear", output=folder, **{**DENSE, **options})
    assert result.returncode == 0, result.stderr
    return Results(folder)


@pytest.mark.parametrize("options", [
    {}, {"drag": "per_mass", "zeta": 0.3}, {"dim": 3, "fraction": 0.8, "n": 40}, {"contact_law": "hertz", "zeta": 5},
    {"model": "rough", **POLYGONS}, {"model": "smooth", **POLYGONS}])
def test_budget_of_energy_and_momentum(options, tmp_path):
    """Energy relative to the flow = start + work of the stress − heat of the drag; contacts conserve momentum, and a drag that
    is proportional to the mass keeps the momentum relative to the flow at zero."""
    run = shear(tmp_path / "run", dt=0.003 if "model" in options else 0.03, **options)
    s = run.series
    change = s["energy"] - s["energy"][0]
    assert s["work"][-1] > 1e-3
    assert np.abs(change - s["work"] + s["heat"]).max() < 2e-3 * s["work"][-1]
    assert run.summary["energy_audit"]["relative_error"] < 2e-3
    assert s["strain"] == pytest.approx(s["time"] * 0.02) and s["strain"][-1] == pytest.approx(options.get("strain", 1), rel=1e-3)
    if options.get("drag") == "per_mass":
        assert np.abs(s["momentum"]).max() < 1e-12
    # Both parts of the stress, and the shares of the particles.
    dim = options.get("dim", 2)
    xy = s["stress"][:, 1]
    assert xy == pytest.approx(s["shear_stress"]) and (s["kinetic_stress"][1:, 0] < 0).all()
    diagonal = s["stress"][:, [0, 2]] if dim == 2 else s["stress"][:, [0, 3, 5]]
    assert s["pressure"] == pytest.approx(-diagonal.mean(1))
    for frame in run.frames[::2]:
        row = np.argmin(np.abs(s["time"] - frame["time"]))
        if s["time"][row] == frame["time"]:
            assert frame["particle_stress"].sum(0) == pytest.approx(s["stress"][row], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("options", [{}, {"dim": 3, "fraction": 0.8, "n": 40}])
def test_the_stress_of_frames_in_python_is_relative_to_the_flow(options, tmp_path):
    shear(tmp_path / "run", **options)
    run = Run(tmp_path / "run")
    series, rows = run.vector_series["stress"], np.triu_indices(run.dim)
    checked = 0
    for frame in run.frames:
        row = np.argmin(np.abs(run.series["time"] - frame.time))
        if run.series["time"][row] == frame.time:
            assert -analysis.mean_stress(frame)[rows] == pytest.approx(series[row], rel=1e-9, abs=1e-12)
            checked += 1
    assert checked > 2


def test_box_and_positions_of_frames(tmp_path):
    run = shear(tmp_path / "run", strain=2.3)
    for frame in run.frames:
        (lx, ly), tilt = frame["box"][1], frame["box"][2, 0]
        strain = frame["strain"]
        assert abs(tilt) <= lx / 2 + 1e-9 + 0.02 * ly and (tilt - strain * ly) / lx == pytest.approx(
            round((tilt - strain * ly) / lx), abs=1e-9)
        assert ((frame["centres"] >= 0) & (frame["centres"] < frame["box"][1])).all()
        # Velocities are near the velocities of the flow at the places of the frame.
        slip = frame["velocities"] - np.stack([0.02 * frame["centres"][:, 1], 0 * frame["centres"][:, 1]], 1)
        assert np.abs(slip).max() < 0.4


@pytest.mark.parametrize("options", [{}, {"model": "rough", **POLYGONS}, {"model": "smooth", **POLYGONS}, {"dim": 3, "fraction": 0.8, "n": 40}])
def test_restart_goes_on_with_the_same_bits(options, tmp_path):
    whole = shear(tmp_path / "whole", **{**options, "strain": 1.5})
    shear(tmp_path / "part", **{**options, "strain": 0.7})
    result = pliant("shear", restart=tmp_path / "part", strain=1.5)
    assert result.returncode == 0, result.stderr
    assert_same_runs(whole, Results(tmp_path / "part"))


def test_threads_change_nothing(tmp_path):
    one, two = (shear(tmp_path / str(k), n=3200, threads=k, strain=0.05).series for k in (1, 2))
    assert all(np.array_equal(one[name], two[name], equal_nan=True) for name in one)


def test_integrators_agree(tmp_path):
    """Trajectories of methods of different orders, and of an implicit one, which needs the derivatives of the drag."""
    common = {"strain": 0.1, "sample_interval": 1, "frame_interval": 1}
    exact = shear(tmp_path / "rk", integrator="ts", ts_rtol=1e-10, ts_atol=1e-10, **common)
    for name, options, error in (("verlet", {"dt": 0.005}, 2e-5), ("cn", {"integrator": "ts", "ts_type": "cn", "dt": 0.02}, 2e-4)):
        other = shear(tmp_path / name, **options, **common)
        assert other.frames[-1]["time"] == pytest.approx(exact.frames[-1]["time"])
        apart = other.frames[-1]["centres"] - exact.frames[-1]["centres"]
        length = exact.frames[-1]["box"][1]
        apart -= length * np.round(apart / length)
        assert np.abs(apart).max() < error, name


def test_flow_stress_of_rare_contacts_with_error_control(tmp_path):
    """Error control makes long steps in free flight and short steps during a contact. The mean weights both by their lengths,
    and no step passes over a contact."""
    options = {"n": 2, "size_distribution": "mono", "fraction": 0.6, "zeta": 0.3, "shear_rate": 0.03, "strain": 60}
    fixed = shear(tmp_path / "fixed", **options).summary
    for name, more in (("default", {}), ("fine", {"sample_interval": 0.02})):
        flow = shear(tmp_path / name, integrator="ts", **options, **more).summary
        for quantity in ("flow_stress", "flow_pressure"):
            assert flow[quantity]["value"] == pytest.approx(fixed[quantity]["value"], rel=0.04)


def test_work_with_error_control(tmp_path):
    """Steps of such methods are long: work and heat are sampled at every step."""
    run = shear(tmp_path / "run", shear_rate=0.1, integrator="ts", ts_type="rk")
    assert run.summary["steps"] < 100
    assert run.summary["energy_audit"]["relative_error"] < 0.02


def test_flow_stress_of_a_steady_state(tmp_path):
    """Without a steady state there is no flow stress; with one the work equals the heat in the mean."""
    short = shear(tmp_path / "short", strain=0.4).summary
    assert not short["steady"] and short["flow_stress"]["value"] is None and short["flow_stress"]["no_error"]
    run = shear(tmp_path / "run", strain=60, shear_rate=0.1, sample_interval=0.5, fraction=0.9)
    s = run.summary
    assert s["steady"], s["steady_explanation"]
    late = run.series["time"] >= s["steady_start"]["value"]
    assert s["flow_stress"]["value"] == pytest.approx(run.series["shear_stress"][late].mean())
    assert 0 < s["flow_stress"]["error"] < 0.2 * s["flow_stress"]["value"]
    assert s["viscosity"]["value"] == pytest.approx(s["flow_stress"]["value"] / 0.1)
    work, heat = (np.ptp(run.series[name][late]) for name in ("work", "heat"))
    assert work == pytest.approx(heat, rel=0.02)
    volume = run.frames[0]["box"][1].prod()
    assert work == pytest.approx(s["flow_stress"]["value"] * volume * 0.1 * np.ptp(run.series["time"][late]), rel=0.02)


def test_a_short_run_has_a_flow_stress_without_an_error(tmp_path):
    result = pliant("shear", output=tmp_path / "run", n=30, shear_rate=1e-3, strain=0.5, zeta=1e-3)
    stress = Results(tmp_path / "run").summary["flow_stress"]
    assert result.returncode == 0 and stress["value"] > 0 and stress["error"] is None
    assert "eps/sigma_avg^2 (no error: the run is too short), viscosity" in result.stdout and "nan" not in result.stdout


def test_particles_that_never_touch_have_no_stress_ratio(tmp_path):
    s = shear(tmp_path / "run", n=1, path="quench", fraction=0.5, shear_rate=0.1, strain=20).summary
    assert s["flow_stress"]["value"] == s["flow_pressure"]["value"] == 0
    assert s["stress_ratio"]["value"] is None and s["stress_ratio"]["no_error"] == "particles exert no pressure"


def test_work_of_rare_contacts(tmp_path):
    """Between two particles the stress changes within a few of the steps at which it is sampled: its work is uncertain, and
    such a gain of energy is no error."""
    run = shear(tmp_path / "run", n=2, path="decompress", fraction=0.9, shear_rate=0.1, strain=2)
    audit = run.summary["energy_audit"]
    assert audit["change"] > audit["work"] and audit["relative_error"] > 0.5 and audit["uncertainty"] > audit["relative_error"]


def test_steps_of_fast_flows(tmp_path):
    """The strain grows by 0.1 in a step, at most; more gives a warning."""
    run = shear(tmp_path / "run", shear_rate=20)
    assert run.summary["dt"] == pytest.approx(0.005)
    result = pliant("shear", output=tmp_path / "long", **{**DENSE, "shear_rate": 20, "dt": 0.01})
    assert result.returncode == 0 and "-dt 0.01 with -shear_rate 20: the strain grows by 0.2" in result.stderr, result.stderr


@pytest.mark.parametrize("options, message", [
    ({"shear_rate": 0}, "-shear_rate"), ({"shear_rate": 100, "dt": 0.02}, "is longer than the run, 0.01 t0"), ({"shear_rate": "nan"}, "-shear_rate"), ({"moduli": "yes"}, "-moduli"),
    ({"strain_step": 0.01}, "-strain_step"), ({"control": "pressure"}, "-control"), ({"dt": 5}, "limit of stability"),
    ({"path": "compress"}, "-path compress"), ({"zeta": -1}, "-zeta"), ({"cycles": 2}, "-cycles")])
def test_refusals(options, message, tmp_path):
    result = pliant("shear", output=tmp_path / "run", **{**DENSE, **options})
    assert result.returncode == 2 and message in result.stderr, result.stderr


@pytest.mark.parametrize("options, message", [
    ({"zeta": 1}, "-zeta"), ({"dt": 0.1}, "-dt"), ({"sample_interval": 0.5}, "-sample_interval"), ({"integrator": "ts"}, "-integrator")])
def test_refusals_of_quasistatic_shear(options, message, tmp_path):
    result = pliant("shear", output=tmp_path / "run", n=24, **options)
    assert result.returncode == 2 and message in result.stderr, result.stderr


def test_cycles_of_quasistatic_strain(tmp_path):
    """Below yield the stress returns with the strain; more cycles continue the run."""
    options = {"n": 24, "start_pressure": 1e-2, "pressure": 1e-2, "strain": 2e-4, "strain_step": 5e-5}
    run = [pliant("shear", output=tmp_path / "run", cycles=2, **options), Results(tmp_path / "run")]
    assert run[0].returncode == 0, run[0].stderr
    quarter = np.arange(5) * 5e-5
    cycle = np.concatenate([quarter, quarter[-2::-1], -quarter[1:], -quarter[-2::-1]])
    strain, stress = run[1].series["strain"][1:], run[1].series["shear_stress"][1:]
    assert strain == pytest.approx(np.concatenate([cycle, cycle[1:]]), abs=1e-12)
    assert stress[16] == pytest.approx(stress[0], abs=1e-7) and stress[32] == pytest.approx(stress[0], abs=1e-7)
    up, down = stress[4] - stress[0], stress[12] - stress[0]
    assert abs(up) > 1e-5 and down == pytest.approx(-up, rel=0.05)
    assert run[1].summary["ended_by"] == "cycles"
    one = pliant("shear", output=tmp_path / "one", cycles=1, **options)
    assert one.returncode == 0, one.stderr
    more = pliant("shear", restart=tmp_path / "one", cycles=2)
    assert more.returncode == 0, more.stderr
    assert_same_runs(run[1], Results(tmp_path / "one"))
    other = pliant("shear", restart=tmp_path / "one", cycles=3, strain=3e-4)
    assert other.returncode == 2 and "cycles of 0.0002" in other.stderr, other.stderr


def test_an_ensemble_has_the_flow_stress_of_its_members(tmp_path):
    """Also results that a run finds from its series are averaged over the members."""
    result = pliant("shear", output=tmp_path / "run", ensemble=3, **{**DENSE, "strain": 30, "shear_rate": 0.1, "sample_interval": 0.5})
    assert result.returncode == 0, result.stderr
    table = pd.read_csv(tmp_path / "run" / "members.csv")
    assert (table["flow_stress"] > 0).all()
    assert table["viscosity"].to_numpy() == pytest.approx(table["flow_stress"].to_numpy() / 0.1)
    assert "flow_stress" in result.stdout


def test_slow_flow_is_quasistatic(tmp_path):
    """Before a contact changes, stresses at two small rates differ from quasistatic ones by a viscous part proportional to the
    rate."""
    start = {"n": 24, "start_pressure": 1e-2, "pressure": 1e-2, "seed": 3, "strain": 0.003}
    result = pliant("shear", output=tmp_path / "steps", strain_step=1e-3, **start)
    assert result.returncode == 0, result.stderr
    steps = Results(tmp_path / "steps").series
    strain, stress = steps["strain"][2:], steps["shear_stress"][2:]
    assert np.ptp(stress) > 5e-5
    viscous = []
    for rate in (2e-5, 4e-5):
        result = pliant("shear", output=tmp_path / str(rate), shear_rate=rate, sample_interval=0.00025 / rate,
                        frame_interval=0.001 / rate, **start)
        assert result.returncode == 0, result.stderr
        flow = Results(tmp_path / str(rate)).series
        viscous.append(np.interp(strain, flow["strain"], flow["shear_stress"]) - stress)
    assert viscous[0] == pytest.approx(viscous[0].mean(), rel=0.05) and viscous[1] == pytest.approx(2 * viscous[0], rel=0.05)


# --- Ranks

FAST = {"shear_rate": 0.2, "strain": 1.2, "sample_interval": 0.2, "frame_interval": 1.5}
DISKS = {**FAST, "n": 60, "path": "quench", "fraction": 0.95}
DEFORMABLE = {**FAST, "n": 24, "n_vertices": 8, "path": "decompress", "fraction": 0.4, "pressure": 1e-2}
KINDS = {
    "disks": {**DISKS, "dt": 0.03},
    "hertz": {**DISKS, "dt": 0.03, "contact_law": "hertz", "drag": "per_mass"},
    "ts": {**DISKS, "dt": 0.03, "integrator": "ts", "ts_type": "rk", "ts_adapt_type": "none"},
    "spheres": {**DISKS, "dt": 0.03, "dim": 3, "fraction": 0.8},
    "rough": {**DEFORMABLE, "model": "rough"},
    "smooth": {**DEFORMABLE, "model": "smooth", "e_c": 0.1},
    "surfaces": {**FAST, "n": 8, "dim": 3, "model": "rough", "path": "quench"},
}


def shear_on_ranks(ranks, folder, **options):
    result = on_any_ranks(ranks, "shear", output=folder, **options)
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("steady shear:") == 1  # one rank prints
    return Results(folder)


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """Runs on one rank, each made once."""
    runs = {}

    def run(kind):
        if kind not in runs:
            runs[kind] = shear_on_ranks(1, tmp_path_factory.mktemp("serial") / kind, **KINDS[kind])
        return runs[kind]

    return run


@needs_mpi
@pytest.mark.parametrize("kind, ranks", [("disks", 2), ("disks", 3), ("hertz", 2), ("ts", 2), ("ts", 3), ("spheres", 2), ("spheres", 3),
                                         ("rough", 2), ("rough", 3), ("smooth", 3), ("surfaces", 3)])
def test_ranks_give_the_same_flow(kind, ranks, serial, tmp_path):
    """Over a strain in which particles cross the sheared edge and an edge of the box is shortened."""
    one, several = serial(kind), shear_on_ranks(ranks, tmp_path / "ranks", **KINDS[kind])
    assert_near_runs(one, several)
    assert several.frames[-1]["edge_shortened_by"] == 1
    assert (np.diff(several.column("images")[:, :, 1], axis=0) != 0).any()
    assert several.series["heat"][-1] > 0.1 and several.series["contact_pairs"][-1] > 5


@needs_mpi
@pytest.mark.parametrize("kind, first, then", [("disks", 2, 3), ("ts", 2, 2), ("rough", 3, 1), ("smooth", 1, 2)])
def test_a_flow_continued_on_ranks(kind, first, then, serial, tmp_path):
    """Also by another number of ranks; the second part shortens the edge."""
    shear_on_ranks(first, tmp_path / "run", **{**KINDS[kind], "strain": 0.45})
    result = on_any_ranks(then, "shear", restart=tmp_path / "run", strain=KINDS[kind]["strain"])
    assert result.returncode == 0, result.stderr
    assert_near_runs(serial(kind), Results(tmp_path / "run"))


@needs_mpi
@pytest.mark.parametrize("options", [{"n": 1}, {"n": 3, "dim": 3}, {"n": 2, "model": "rough"}, {"n": 3, "integrator": "ts", "ts_type": "cn", "dt": 0.02}])
def test_more_ranks_than_particles(options, tmp_path):
    options = {**FAST, "path": "quench", **options}
    assert_near_runs(shear_on_ranks(1, tmp_path / "one", **options), shear_on_ranks(4, tmp_path / "four", **options))


@needs_mpi
def test_a_stationary_flow_on_ranks(tmp_path):
    """Particles migrate many times. The trajectories of a chaotic flow differ, their averages agree."""
    options = {"n": 100, "path": "quench", "fraction": 0.9, "shear_rate": 0.1, "strain": 60, "sample_interval": 0.5, "frame_interval": 100}
    one, three = shear_on_ranks(1, tmp_path / "one", **options), shear_on_ranks(3, tmp_path / "three", **options)
    assert one.summary["steady"] and three.summary["steady"]
    for name in ("flow_stress", "viscosity", "flow_pressure", "stress_ratio"):
        a, b = one.summary[name], three.summary[name]
        assert abs(a["value"] - b["value"]) < 4 * np.hypot(a["error"], b["error"]), name
    assert three.summary["energy_audit"]["relative_error"] < 0.01
    assert three.frames[-1]["edge_shortened_by"] == 60


@needs_mpi
@pytest.mark.parametrize("options, code, message", [
    ({"shear_rate": None}, 2, "on one rank, not on 2: start the program without mpiexec"),
    ({"max_iterations": 1}, 3, "has not converged"),
    ({"model": "rough", "fraction": 0.8}, 2, "begin with a lower fraction"),
    ({"dt": 5}, 2, "limit of stability"),
    ({"model": "rough", "n": 24, "n_vertices": 8, "fraction": 0.4, "shear_rate": 5, "strain": 20, "e_c": 0.01, "sample_interval": 0.02}, 3, "lies inside particle"),
    ({"ensemble": 2}, 2, "without mpiexec")], ids=["quasistatic", "preparation", "dense", "long_step", "crossing", "ensemble"])
def test_errors_of_a_flow_end_all_ranks(options, code, message, tmp_path):
    given = {name: value for name, value in {**DISKS, **options}.items() if value is not None}
    if "shear_rate" not in given:
        given = {name: given[name] for name in ("n", "path", "fraction")}
    result = on_ranks(2, "shear", output=tmp_path / "run", **given)
    errors = [line for line in complaints(result) if "warning" not in line]
    assert result.returncode == code and len(errors) == 1 and message in errors[0], result.stderr


def test_particles_that_pass_through_each_other(tmp_path):
    dilute = {"n": 16, "fraction": 0.6, "shear_rate": 0.5, "zeta": 0.05, "strain": 40}
    run = shear(tmp_path / "passes", dt=0.02, sample_interval=5, **dilute)
    assert run.summary["passing_overlap"] > 0.95 and run.summary["flow_stress"]["error"] is None
    result = pliant("shear", output=tmp_path / "far", **{**DENSE, **dilute})
    assert result.returncode == 3 and "radii in a step relative to the flow" in result.stderr and "-shear_rate" in result.stderr
