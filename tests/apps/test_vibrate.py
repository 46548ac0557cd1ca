"""A vibrated container: motion of a particle, budgets of energy and momentum, the bed below 1 g, restart, starts, refusals."""

import json

import numpy as np
import pytest
from conftest import Results, assert_same_runs, pliant
from scipy.integrate import solve_ivp
from test_parallel import on_ranks

SMALL = {"n": 30, "box_width": 6, "amplitude": 0.1, "frequency": 1, "cycles": 6, "frames_per_cycle": 2}
POLYGONS = {"model": "rough", "n": 6, "n_vertices": 8, "box_width": 4, "mu": 1, "e_c": 1000, "cycles": 3}


def vibrate(folder, **options):
    result = pliant("vibrate", output=folder, **{**SMALL, **options})
    assert result.returncode == 0, result.stderr
    return Results(folder)


def test_one_particle_moves_as_its_equation_says(tmp_path):
    """Free fall, and a harmonic contact with a floor at A (1 - cos ωt)."""
    A, f, e_w = 0.1, 0.8, 1000
    run = vibrate(tmp_path / "run", model="sp", n=1, size_distribution="mono", mu=1, e_w=e_w, amplitude=A, frequency=f,
                  cycles=4, samples_per_cycle=32, dt=2e-5)
    time, height, omega, radius, mass = run.series["time"], run.series["mean_height"], 2 * np.pi * f, 0.5, np.pi / 4

    def slope(t, y):
        gap = y[0] - A * (1 - np.cos(omega * t))
        return [y[1], -1 + max(0, 1 - gap / radius) * e_w / radius / mass]
    exact = solve_ivp(slope, (0, time[-1]), [height[0], 0], t_eval=time, rtol=1e-10, atol=1e-12, max_step=0.01)
    floor = A * (1 - np.cos(omega * time))
    assert np.ptp(height) > 0.3 and height.min() < radius
    assert height + floor == pytest.approx(exact.y[0], abs=1e-5)
    assert run.series["displacement"] == pytest.approx(floor, abs=1e-12)


def test_horizontal_vibration_takes_particles_along(tmp_path):
    """Between two walls a diameter apart a disk follows the walls."""
    run = vibrate(tmp_path / "run", direction="horizontal", n=1, size_distribution="mono", box_width=1.0001, lid=3)
    x = np.array([frame["centres"][0, 0] for frame in run.frames])
    time = np.array([frame["time"] for frame in run.frames])
    assert x == pytest.approx(0.1 * (1 - np.cos(2 * np.pi * time)), abs=2e-3) and np.ptp(x) > 0.19
    walls = np.array([frame["wall_segments"] for frame in run.frames])
    assert walls.shape[1:] == (4, 4) and walls[:, 1, 0] == pytest.approx(1.0001 / 2 + 0.1 * (1 - np.cos(2 * np.pi * time)))
    assert walls[:, :, 1] == pytest.approx(np.broadcast_to(walls[0, :, 1], walls[:, :, 1].shape))


@pytest.mark.parametrize("options", [{}, {"dim": 3, "n": 60}, {"model": "sp", "mu": 1}, {"zeta": 0.3}, {"direction": "horizontal"}, POLYGONS,
                                     {**POLYGONS, "model": "smooth", "cycles": 2}])
def test_budget_of_energy(options, tmp_path):
    run = vibrate(tmp_path / "run", **options)
    s = run.series
    energy = s["kinetic_energy"] + s["potential_energy"] + s["gravity_energy"]
    assert s["work"][-1] > 0.5
    audit = run.summary["energy_audit"]
    error = 0.02 * s["work"][-1] + 3 * audit["uncertainty"]  # friction without history is sampled
    assert np.abs(energy - energy[0] - s["work"] + s["heat"]).max() < error < 0.3 * s["work"][-1]
    assert audit["work"] == pytest.approx(s["work"][-1]) and audit["heat"] == pytest.approx(s["heat"][-1])
    assert (s["fluctuation_energy"] <= s["kinetic_energy"] * (1 + 1e-12)).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_budget_of_momentum(dim, tmp_path):
    """The impulse of the walls and the weight is the change of the momentum; the power of the floor is its work."""
    run = vibrate(tmp_path / "run", dim=dim, n=10 if dim == 2 else 30, box_width=4, samples_per_cycle=2000, cycles=2, e_w=1e3)
    s, weight, omega = run.series, run.summary["weight"]["value"], 2 * np.pi
    up = np.array([0] * (dim - 1) + [1])
    force = -s["wall_force"] - weight * up
    impulse = np.trapz(force, s["time"], axis=0)
    assert impulse == pytest.approx(s["momentum"][-1] - s["momentum"][0], abs=0.01 * weight)
    speed = 0.1 * omega * np.sin(omega * s["time"])
    assert np.trapz(-s["wall_force"][:, -1] * speed, s["time"]) == pytest.approx(s["work"][-1], rel=0.02)


def test_below_the_acceleration_of_gravity_the_bed_rides_on_the_floor(tmp_path):
    run = vibrate(tmp_path / "run", amplitude=0.01, cycles=80, frequency=1)  # 0.39 g
    late = run.series["time"] > 60
    assert np.ptp(run.series["mean_height"][late]) < 0.01
    jumps = vibrate(tmp_path / "jumps", amplitude=0.1, cycles=80, frequency=1)  # 3.9 g
    assert np.ptp(jumps.series["mean_height"][late]) > 0.1
    assert run.summary["acceleration"]["value"] == pytest.approx(0.01 * (2 * np.pi) ** 2)


def test_averages_over_cycles(tmp_path):
    run = vibrate(tmp_path / "run", cycles=160)
    s, summary, n = run.series, run.summary, 16
    assert summary["steady"], summary["steady_explanation"]
    assert len(s["time"]) == 160 * n + 1 and s["time"] == pytest.approx(np.arange(160 * n + 1) / n)
    first = 160 - summary["steady_cycles"]
    cycles = s["mean_height"][1:].reshape(160, n).mean(1)[first:]
    assert summary["mean_height"]["value"] == pytest.approx(cycles.mean())
    work = s["work"][::n]
    assert summary["power"]["value"] == pytest.approx((work[-1] - work[first]) / (160 - first), rel=1e-6)
    for name in ("mean_height", "fluctuation_energy", "power"):
        assert 0 < summary[name]["error"] < 0.2 * summary[name]["value"]


@pytest.mark.parametrize("options", [{}, {"dim": 3}, POLYGONS])
def test_restart_goes_on_with_the_same_bits(options, tmp_path):
    options = {**options, "cycles": 4}
    whole = vibrate(tmp_path / "whole", **options)
    vibrate(tmp_path / "part", **{**options, "cycles": 2})
    result = pliant("vibrate", restart=tmp_path / "part", cycles=4)
    assert result.returncode == 0, result.stderr
    assert_same_runs(whole, Results(tmp_path / "part"))


def test_threads_change_nothing(tmp_path):
    one, two = (vibrate(tmp_path / str(k), n=2500, box_width=40, threads=k, cycles=1).series for k in (1, 2))
    assert all(np.array_equal(one[name], two[name], equal_nan=True) for name in one)


def test_steps_longer_than_samples_are_refused(tmp_path):
    result = pliant("vibrate", n=3, box_width=6, cycles=2, integrator="ts", ts_adapt_dt_max=1, output=tmp_path / "run")
    assert result.returncode == 2 and "-ts_adapt_dt_max 1 is longer than the time between samples" in result.stderr


def test_integrators_agree(tmp_path):
    verlet = vibrate(tmp_path / "verlet", model="sp", mu=1, n=8, box_width=4, cycles=1, dt=1e-4)
    adaptive = vibrate(tmp_path / "ts", model="sp", mu=1, n=8, box_width=4, cycles=1, integrator="ts", ts_rtol=1e-9, ts_atol=1e-9)
    assert adaptive.series["mean_height"][-1] == pytest.approx(verlet.series["mean_height"][-1], abs=1e-3)


def test_a_start_from_a_frame_keeps_the_particles(tmp_path):
    first = vibrate(tmp_path / "first", cycles=3)
    result = pliant("vibrate", output=tmp_path / "second", start=tmp_path / "first/run.h5", box_width=6, cycles=1)
    assert result.returncode == 0, result.stderr
    assert "the energy of contacts could lift all particles by" in result.stdout and result.stderr == ""
    second = Results(tmp_path / "second")
    assert np.array_equal(second.frames[0]["centres"], first.frames[-1]["centres"])
    assert np.array_equal(second.frames[0]["velocities"], first.frames[-1]["velocities"])


def test_a_start_from_a_pressed_packing_warns(tmp_path):
    """The contact energy of pack is the unit; the default of vibrate is 10^4."""
    made = pliant("pack", output=tmp_path / "packing", n=30, pressure=1e-2)
    assert made.returncode == 0, made.stderr
    packing = Results(tmp_path / "packing")
    table = tmp_path / "packing.csv"
    table.write_text("x,y,diameter\n" + "".join(f"{x},{y + 0.6},{d}\n" for (x, y), d in
                                                zip(packing.frames[-1]["centres"], packing.topology["sigma"])), encoding="utf-8")
    options = {"start": table, "box_width": 20, "cycles": 1, "model": "sp", "mu": 1}
    result = pliant("vibrate", output=tmp_path / "run", **options, e_sp=1e4)
    assert result.returncode == 0, result.stderr
    assert f"-start {table}: contacts store an energy that could lift all particles by" in result.stderr
    assert "lower the contact energy (-e_sp)" in result.stderr
    run = Results(tmp_path / "run")
    lift = float(result.stderr.split("particles by ")[1].split()[0])
    s, mass = run.series, run.summary["weight"]["value"]
    assert lift == pytest.approx(s["potential_energy"][0] / mass, rel=1e-2) and lift > 1
    soft = pliant("vibrate", output=tmp_path / "soft", **options, e_sp=20)
    assert soft.returncode == 0 and soft.stderr == "", soft.stderr


@pytest.mark.ranks
def test_ranks_agree(tmp_path):
    one = vibrate(tmp_path / "one", n=60, cycles=1, zeta=0.3)
    result = on_ranks(3, "vibrate", output=tmp_path / "three", **{**SMALL, "n": 60, "cycles": 1, "zeta": 0.3})
    assert result.returncode == 0, result.stderr
    three = Results(tmp_path / "three")
    for name in ("mean_height", "kinetic_energy", "work", "heat", "wall_force"):
        assert three.series[name] == pytest.approx(one.series[name], rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("options, message", [
    ({"model": "sp"}, "nothing dissipates the energy that the walls add"),
    ({"restitution": 1, "mu_disk": 0, "mu_wall": 0, "mu_disk_dynamic": 0, "mu_wall_dynamic": 0}, "nothing dissipates"),
    ({"lid": 2}, "use a higher lid"), ({"box_width": 1}, "upper end; use a wider container (-box_width)\n"), ({"amplitude": 0}, "amplitude"), ({"frequency": -1}, "frequency"),
    ({"model": "rough", "mu": 1, "dim": 3}, "-dim 2"), ({"n_vertices": 8}, "does not read it"), ({"dt": 0.1}, "limit of stability"),
    ({"direction": "up"}, "vertical"), ({"g": 9.81}, "unit of acceleration"), ({"samples_per_cycle": 2}, "samples_per_cycle"),
    ({"cycles": 1e9, "dt": 1e-9}, "too many steps"), ({"sample_interval": 1}, "sample_interval"), ({"t_end": 5}, "t_end")])
def test_bad_options(options, message, tmp_path):
    result = pliant("vibrate", output=tmp_path / "run", **{**SMALL, **options})
    assert result.returncode == 2 and message in result.stderr and len(result.stderr.splitlines()) == 1, result.stderr
    assert not (tmp_path / "run").exists()


def test_a_container_that_is_too_violent_ends_the_run(tmp_path):
    result = pliant("vibrate", output=tmp_path / "run", **{**SMALL, "amplitude": 20, "frequency": 5})
    assert result.returncode == 3 and "wall" in result.stderr, result.stderr
    assert json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))["status"] == "failed"
