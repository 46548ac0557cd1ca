"""Elastic moduli of a Simulation, compared with `pliant pack` and a crystal; refusals."""

import numpy as np
import pytest

import pliant
from pliant import Simulation, Walls


def of_frame(run, **options):
    frame = run.frames[-1]
    return Simulation(frame.centres, run.topology.sigma, box=frame.box[1], e_sp=1, **options)


@pytest.mark.parametrize("options", ({"n": 30, "size_ratio": 10, "pressure": 1e-4}, {"n": 40, "pressure": 1e-3},
                                     {"n": 48, "dim": 3, "pressure": 1e-2}), ids=("crystal", "disks", "spheres"))
def test_moduli_are_those_of_pack(options, tmp_path):
    run = pliant.pack(**options, moduli=True, output=tmp_path / "run", quiet=True, progress=False)
    found, s = of_frame(run).moduli(), run.summary
    assert [found.bulk, found.shear] == pytest.approx([s["bulk_modulus"], s["shear_modulus"]], rel=1e-10)
    assert found.shear_xy == pytest.approx(run.series["shear_modulus_xy"].iloc[-1], rel=1e-10)
    stiffness = run.vector_series["stiffness"][-1].reshape(found.stiffness.shape)  # a row for each component of the stress
    assert found.stiffness == pytest.approx(stiffness, abs=1e-10 * stiffness.max())
    assert found.pressure == pytest.approx(s["pressure"], rel=1e-10) and found.max_force < 1e-11
    assert (len(found.rattlers), found.contacts) == (s["rattlers"], s["contacts"])
    if "size_ratio" in options:  # 30 springs of length 2R and stiffness 1/(2R)², in a square lattice
        assert found.bulk == pytest.approx(30 / (4 * run.frames[-1].box[1].prod()), rel=1e-3)
        assert len(found.rattlers) == 15 and (run.topology.sigma[found.rattlers] < 1).all()


def packing(**options):
    x = np.stack(np.meshgrid(np.arange(6), np.arange(6)), axis=-1).reshape(-1, 2) * 0.86
    x = x + 0.1 * np.random.default_rng(1).random(x.shape)
    d = np.where(np.arange(36) % 2, 0.85, 1.1)
    sim = Simulation(x, d, box=(5.16, 5.16), e_sp=100, **options)
    sim.minimize(force_tolerance=1e-11)
    return sim


def test_the_bulk_modulus_is_the_slope_of_the_pressure():
    sim = packing()
    bulk, p = sim.moduli().bulk, []
    for strain in (1e-5, -1e-5):
        other = Simulation(sim.positions * (1 + strain), sim.diameters, box=(5.16 * (1 + strain),) * 2, e_sp=100)
        p.append(other.minimize(force_tolerance=1e-11).pressure)
    assert bulk == pytest.approx(-(p[0] - p[1]) / (4 * 1e-5), rel=1e-5)


def test_moduli_change_no_bit_of_the_motion():
    plain, measured = packing(), packing()
    for sim in (plain, measured):
        sim.velocities += np.random.default_rng(2).normal(size=(36, 2))
    pressed = packing()
    before = pressed.moduli()
    assert pressed.moduli().bulk == before.bulk
    for _ in range(5):
        plain.run(0.05)
        measured.run(0.05)
        with pytest.raises((pliant.InputError, pliant.NumericalError), match=r"equilibrium; call minimize\(|minimise its energy"):
            measured.moduli()
    assert np.array_equal(plain.positions, measured.positions) and np.array_equal(plain.velocities, measured.velocities)


def test_refusals():
    sim = packing()
    for threshold in (-1, 1, np.nan):
        with pytest.raises(pliant.InputError, match="threshold"):
            sim.moduli(threshold)
    sim.force = lambda x, v, t: 0 * x
    with pytest.raises(pliant.InputError, match="force function"):
        sim.moduli()
    sim.force = None
    sim.set(e_sp=50)
    assert sim.moduli().bulk > 0
    walls = Walls(2)
    walls.half_space((0, -10), (0, 1))
    x = [[0.5, 0.5], [1.4, 0.5]]
    for options, words in (({"box": (5, None)}, "direction 1 of the box is open"), ({}, "direction 0 of the box is open"),
                           ({"walls": walls}, "direction 0 of the box is open"),
                           ({"box": (5, 5), "model": "disk"}, "model disk rotate")):
        with pytest.raises(pliant.InputError, match=words):
            Simulation(x, 1, **options).moduli()
    with pytest.raises(pliant.InputError, match="model disk rotate.* use model sp"):  # by the engine
        Simulation(x, 1, box=(5, 5), model="disk")._core.moduli(1e-5)
    with pytest.raises(pliant.NumericalError, match="all 2 particles are rattlers"):
        Simulation(x, 1, box=(5, 5)).moduli()
    sim.close()
    with pytest.raises(pliant.UsageError):
        sim.moduli()
