"""Energy budget of simulations: the energies change by work − heat, whoever does the work."""

import shutil
import subprocess
import sys
import warnings

import numpy as np
import pliant
import pytest


def box_of_walls(paddle=False, dim=2):
    walls = pliant.Walls(dim)
    walls.half_space((0,) * dim, (0,) * (dim - 1) + (1,))
    if dim == 2:
        walls.segment((-3.2, 0), (-3.2, 20))
        walls.segment((3.2, 20), (3.2, 0))
    if paddle:
        walls.disk((0, 0.8), 0.8, amplitude=(0.6, 0), frequency=2.0)
    return walls


PLACES = np.stack(np.meshgrid(np.arange(-2.4, 2.5, 1.1), np.arange(2.2, 7, 1.1)), axis=-1).reshape(-1, 2)


def make(model="sp", dim=2, paddle=True, **options):
    options = {"gravity": (0,) * (dim - 1) + (-1,), **options}
    rng = np.random.default_rng(1)
    if dim == 3:
        x = np.insert(PLACES, 1, 0, axis=1) + 0.05 * rng.random((len(PLACES), 3))
        return pliant.Simulation(x, 1, model=model, walls=box_of_walls(dim=3), velocities=0.3 * rng.standard_normal(x.shape), **options)
    if model in ("rough", "smooth"):
        polygons = pliant.regular_polygons(PLACES, 0.9, 8, rng.random(len(PLACES)))
        return pliant.Simulation(polygons=polygons, model=model, walls=box_of_walls(paddle), **options)
    if model == "bubble":
        walls = pliant.Walls()
        walls.half_space((0, 0), (0, 1))
        walls.half_space((0, 13.5), (0, -1), velocity=(0, -0.5))
        return pliant.Simulation(2 * PLACES, 2, model=model, walls=walls, **options)
    v = {} if "dynamics" in options else {"velocities": 0.3 * rng.standard_normal(PLACES.shape)}
    return pliant.Simulation(PLACES, 1, model=model, walls=box_of_walls(paddle), **v, **options)


def total(sim):
    return sum(sim.energies.values())


def assert_balanced(folder, tolerance=0.01, work=True, heat=True):
    """At each sample; and none of the parts is missing."""
    series = pliant.Run(folder).series
    lost = series["heat" if "heat" in series else "dissipated"]
    change = series["energy"] - series["energy"][0]
    scale = max(abs(change).max(), abs(series["work"]).max(), lost.max())
    np.testing.assert_allclose(change, series["work"] - lost, atol=tolerance * scale)
    assert (abs(series["work"]).max() > 1e-3 * scale) == work
    assert (lost.max() > 0.02 * scale) == heat
    return series


CASES = [
    ("sp", {"zeta": 0.3}), ("sp", {"mu": 1.0}), ("sp", {"dim": 3, "zeta": 0.3, "mu": 0.5}), ("disk", {"e_disk": 2000, "dt": 3e-4}),
    ("disk", {"e_disk": 2000, "dt": 3e-4, "zeta": 0.3}), ("disk", {"dim": 3, "e_disk": 2000, "dt": 3e-4}), ("rough", {"zeta": 0.5, "t": 0.6, "paddle": False, "k_l": 500, "e_c": 2000}),
    ("smooth", {"zeta": 0.5, "mu": 0.1, "t": 0.5, "paddle": False}), ("sp", {"zeta": 0.3, "integrator": "rk", "ts_rtol": 1e-5}),
    ("sp", {"dynamics": "overdamped", "zeta": 3.0, "e_w": 100, "ts_adapt_dt_max": 5e-4}), ("bubble", {"phi_c": 1e-3, "gravity": (0, -0.01), "t": 4})]


@pytest.mark.parametrize("model, options", CASES, ids=lambda value: str(value))
def test_each_sample_balances(model, options, tmp_path):
    options = dict(options)
    t, paddle = options.pop("t", 2), options.setdefault("paddle", True) and options.get("dim", 2) == 2
    with make(model, output=tmp_path / "run", sample_interval=0.05, **options) as sim:
        sim.run(t)
    series = assert_balanced(tmp_path / "run", work=paddle)
    assert "gravity_energy" in series


@pytest.mark.parametrize("model, options", [
    ("sp", {"zeta": 0.3}), ("disk", {"zeta": 0.3, "e_disk": 2000, "dt": 3e-4}), ("sp", {"zeta": 0.3, "integrator": "rk", "ts_rtol": 1e-5}),
    ("sp", {"dynamics": "overdamped", "zeta": 3.0, "e_w": 100, "ts_adapt_dt_max": 5e-4})], ids=lambda value: str(value))
def test_changes_from_outside_are_work(model, options, tmp_path):
    """Ramps, kicks, moved particles and walls, in callbacks and between runs."""
    energy = "e_disk" if model == "disk" else "e_sp"
    sim = make(model, output=tmp_path / "run", sample_interval=0.05, **{energy: 2000, **options})

    def ramp(sim):
        sim.set(**{energy: 2000 + 2000 * sim.t})
        sim.positions[:] += 0.01
        if "dynamics" not in options:
            sim.velocities[::2] += (0.3, 0)
        if sim.t > 0.4:
            sim.move_wall(3, velocity=(-0.5, 0))

    sim.run(0.7, callback=ramp, every=0.07)
    sim.positions[:, 1] += 0.2
    sim.run(0.2)
    sim.minimize(force_tolerance=1e-3)
    sim.run(0.2)
    start = pliant.Run(tmp_path / "run").series["energy"][0]
    assert total(sim) - start == pytest.approx(sim.work - sim.dissipated, abs=0.03 * (abs(sim.work) + sim.dissipated))
    sim.close()
    assert_balanced(tmp_path / "run", 0.02)


def test_kicks_in_step_with_the_look_at_the_heat(tmp_path):
    """The power of the drag jumps at each kick; every 64 steps the audit computes this power, just before a kick."""
    with pliant.Simulation([[0, 0]], 1, zeta=20.0, dt=1e-3, output=tmp_path / "run", sample_interval=0.1) as sim:
        def kick(sim):
            if sim.steps % 64 == 0:
                sim.velocities[:] = (1, 0)
        sim.run(2, callback=kick)
    series = assert_balanced(tmp_path / "run")
    assert series["heat"].iloc[-1] > 5


@pytest.mark.parametrize("options", [{}, {"integrator": "rk", "ts_adapt_dt_max": 0.02}, {"dynamics": "overdamped", "zeta": 1.0}], ids=str)
def test_a_force_function_does_work(options, tmp_path):
    sim = pliant.Simulation([[0, 0], [3, 0]], 1, output=tmp_path / "run", sample_interval=0.1, dt=1e-3, **{"zeta": 0.2, **options})
    sim.force = lambda x, v, t: np.array([[1.0, 0], [0, np.cos(t)]])
    sim.run(1)
    if "dynamics" not in options:
        sim.velocities[:] += (0.5, 0)
    sim.run(1)
    x = sim.positions[0, 0]
    series = pliant.Run(tmp_path / "run").series
    sim.close()
    series = assert_balanced(tmp_path / "run", 1e-3)
    if "dynamics" not in options:  # work of a constant force; the kick adds m v Δv + m Δv²/2 for both
        assert series["work"].iloc[-1] > x


def test_a_constant_force_does_force_times_way(tmp_path):
    sim = pliant.Simulation([[0, 0]], 1, zeta=0.2, dt=1e-3)
    sim.force = lambda x, v, t: np.full_like(x, 2.0)
    sim.run(1)
    assert sim.work == pytest.approx(2 * sim.positions.sum(), rel=1e-6)
    assert sim.dissipated == pytest.approx(sim.work - total(sim), rel=2e-3)


@pytest.mark.parametrize("model, options", [("sp", {"zeta": 0.3}), ("disk", {"e_disk": 2000, "dt": 3e-4}), ("sp", {"dynamics": "overdamped", "zeta": 3.0, "e_w": 100, "ts_adapt_dt_max": 5e-4})],
                         ids=str)
def test_insertion_and_removal_are_work(model, options):
    sim = make(model, paddle=False, **options)
    start, added = total(sim), []

    def exchange(sim):
        sim.remove(sim.ids[:1])
        added.append(sim.t)
        sim.add([[0, 9 + 1.1 * len(added)]], 1)

    sim.run(1, callback=exchange, every=0.2)
    assert len(added) > 3 and sim.work > 1 and sim.dissipated > 0.01
    assert total(sim) - start == pytest.approx(sim.work - sim.dissipated, abs=0.01 * sim.work)
    work = sim.work
    before = total(sim)
    sim.remove(sim.ids[3:5])
    assert sim.work - work == pytest.approx(total(sim) - before, rel=1e-9)


def test_a_fall_through_a_periodic_box_balances(tmp_path):
    with pliant.Simulation([[1, 1], [1.5, 3]], 1, box=(6, 6), gravity=(0, -1), zeta=0.5, skin=0.02, output=tmp_path / "run",
                           sample_interval=0.5) as sim:
        sim.run(30)
        assert abs(sim.images).max() > 2
    assert_balanced(tmp_path / "run")


def test_two_particles_that_collide_once():
    """The collision is shorter than 64 steps, the interval at which the audit computes the heat of many particles."""
    sim = pliant.Simulation([[0, 0], [1.3, 0.2]], 1, velocities=[[1, 0], [-1, 0]], mu=3.0, e_sp=1000, dt=1e-3)
    start = total(sim)
    sim.run(2)
    assert start - total(sim) > 0.05 * start
    assert sim.dissipated == pytest.approx(start - total(sim), rel=1e-2)


def run_in_parts(sim, folder, stops, end):
    """The Run of a simulation that is closed and restarted at each stop."""
    for stop in stops:
        sim.run(until=stop)
        sim.close()
        sim = pliant.Simulation.restart(folder)
    sim.run(until=end)
    sim.close()
    return pliant.Run(folder)


def test_a_restart_continues_the_budget_bit_for_bit(tmp_path):
    def run(folder, stops):
        sim = make("disk", e_disk=2000, dt=3e-4, zeta=0.3, output=folder, sample_interval=0.05)
        return run_in_parts(sim, folder, stops, 1.0).series

    whole, parts = run(tmp_path / "whole", []), run(tmp_path / "parts", [0.33, 0.61])
    assert whole.equals(parts) and whole["heat"].iloc[-1] > 0.1
    with make("disk", e_disk=2000, dt=3e-4, zeta=0.3, output=tmp_path / "program", sample_interval=0.05) as sim:
        sim.run(until=0.4)
    subprocess.run([sys.executable, "-m", "pliant", tmp_path / "program", "--until", "1.0"], check=True)
    assert pliant.Run(tmp_path / "program").series.equals(whole)


def test_friction_of_many_particles_balances(tmp_path):
    """At first the audit samples friction at every 9th step, and later, when the heat is known, at every 64th."""
    def run(folder, stops):
        walls = pliant.Walls()
        walls.half_space((0, 0), (0, 1), amplitude=(0, 0.3), frequency=0.7)
        walls.line([(0, 40), (0, -2)])
        walls.line([(14, -2), (14, 40)])
        x = np.stack(np.meshgrid(np.arange(0.7, 13.5, 1.05), np.arange(0.7, 13, 1.05)), axis=-1).reshape(-1, 2)[:150]
        sim = pliant.Simulation(x + 0.04 * np.random.default_rng(4).random(x.shape), 1, walls=walls, gravity=(0, -1), mu=1.0, e_sp=1000,
                                e_w=1000, dt=1e-3, output=folder, sample_interval=0.5)
        return run_in_parts(sim, folder, stops, 40)

    whole, parts = run(tmp_path / "whole", []), run(tmp_path / "parts", [1.3, 17])
    assert_balanced(tmp_path / "whole")
    assert whole.series.equals(parts.series)
    audit = whole.summary["energy_audit"]
    assert audit["relative_error"] < 0.01 and 1e-3 < audit["uncertainty"] < 0.006


@pytest.mark.parametrize("when", ["called", "between"])
def test_a_restart_with_a_force_continues_the_budget(when, tmp_path):
    def force(x, v, t):
        return np.column_stack([np.cos(3 * t) - x[:, 0], 0 * t - x[:, 1]])

    sims = {}
    for name in ("whole", "parts"):
        sims[name] = sim = pliant.Simulation([[1, 0], [-1, 0.5]], 1, zeta=0.3, dt=1e-3, output=tmp_path / name, sample_interval=0.1)
        sim.force = force
        sim.run(0.5, callback=lambda sim: sim.save(), every=0.2)
        if name == "parts":
            if when == "between":
                sim.close()
            else:
                sim.run(0.05)  # dropped
                folder = tmp_path / "copy"
                shutil.copytree(tmp_path / name, folder)
                sim.close()
            sim = pliant.Simulation.restart(tmp_path / name if when == "between" else folder)
            sim.force = force
        sim.run(until=1)
        sims[name] = sim
    assert sims["parts"].work == pytest.approx(sims["whole"].work, rel=1e-5)


def crystal(**options):
    """Pressed disks, whose fastest oscillation grows if the step is above the limit of stability."""
    x = 0.93 * np.array([(i + 0.5 * (j % 2), j * 0.75**0.5) for i in range(6) for j in range(6)])
    v = 0.01 * np.random.default_rng(2).standard_normal(x.shape)
    return pliant.Simulation(x, 1, velocities=v, box=(0.93 * 6, 0.93 * 6 * 0.75**0.5), e_sp=100, e_w=1,
                             allow_passing_overlap=True, **options)


def test_energy_that_is_not_conserved_ends_the_run(tmp_path):
    stable = crystal()
    limit, start = stable.counters["dt_critical"], total(stable)
    stable.run(200 * limit)
    assert total(stable) == pytest.approx(start, rel=1e-2)
    unstable = {"dt": 1.1 * limit, "allow_unstable_dt": True}
    sim = crystal(output=tmp_path / "run", **unstable)
    with pytest.raises(pliant.NumericalError, match="energy is not conserved.*allow_energy_error"):
        sim.run(200 * limit)
    sim.close()
    assert "energy is not conserved" in pliant.Run(tmp_path / "run").summary["message"]
    crystal(allow_energy_error=True, **unstable).run(200 * limit)


def test_the_summary_has_the_audit(tmp_path):
    with make(zeta=0.3, output=tmp_path / "run") as sim:
        sim.run(1)
    audit = pliant.Run(tmp_path / "run").summary["energy_audit"]
    assert audit["work"] == pytest.approx(pliant.Run(tmp_path / "run").series["work"].iloc[-1])
    assert abs(audit["relative_error"]) < 0.01


CORNERS = {"U": [(-5, 20), (-5, 0), (5, 0), (5, 20)], "V": [(-5, 8.66), (0, 0), (5, 8.66)], "roof": [(-5, -5), (0, 0), (5, -5)]}


@pytest.mark.parametrize("shape, position, velocity, spin, steps", [
    ("U", (4.5489, 0.4355), (0.793, 0.042), -1.7474, 1000),
    ("V", (0.2, 1.1), (0.5, 0), 1, 3000),
    ("roof", (-0.35, 0.9), (0.6, 0), -0.3, 6000),
])
def test_friction_in_corners_of_walls(shape, position, velocity, spin, steps):
    """A concave corner has two contacts, in whatever order its points are given."""
    def run(add):
        walls = pliant.Walls()
        add(walls)
        sim = pliant.Simulation([position], diameters=0.9, walls=walls, gravity=(0, -1), model="disk", mu_disk=0.3, e_disk=300,
                                e_w=300, dt=2e-4, velocities=[velocity])
        sim.spins[:] = spin
        start, before = total(sim), sim.work - sim.dissipated
        sim.step(steps)
        assert sim.dissipated > 0.05
        assert total(sim) - start == pytest.approx(sim.work - sim.dissipated - before, abs=1e-3)
        return sim.positions[0].copy()

    points = CORNERS[shape]
    here = run(lambda walls: walls.line(points))
    assert run(lambda walls: walls.line(points[::-1])) == pytest.approx(here, abs=1e-12)
    if shape == "U":
        assert run(lambda walls: walls.polygon(points)) == pytest.approx(here, abs=1e-12)  # from inside
        separate = run(lambda walls: [walls.line(side) for side in zip(points, points[1:])])
        assert separate == pytest.approx(here, abs=1e-12)


def test_a_noticeable_energy_error_gives_a_warning():
    def spin_up(dt):
        random = np.random.default_rng(3)
        x = np.array([(i, j) for i in range(4) for j in range(4)]) * 0.95
        sim = pliant.Simulation(x, 1, velocities=random.standard_normal(x.shape), model="disk", mu_disk=0.5, **dt)
        sim.spins[:] = 3 * random.standard_normal(sim.spins.shape)
        sim.run(1)
        return sim

    with pytest.warns(pliant.PliantWarning, match=r"energy is conserved to .* % only: compare with a shorter step \(dt\)"):
        spin_up({})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        spin_up({"dt": 5e-5})
