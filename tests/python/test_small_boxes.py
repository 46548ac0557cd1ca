"""Contacts in small periodic boxes, where several images of a particle can touch another one: each of them counts."""

import numpy as np
import pytest

import pliant
from pliant import Simulation, analysis

PACKINGS = ({"n": 1}, {"n": 2}, {"n": 1, "dim": 3}, {"n": 4, "dim": 3}, {"n": 1, "model": "rough"}, {"n": 2, "model": "smooth"},
            {"n": 1, "model": "rough", "shape_parameter": 1.6}, {"n": 2, "model": "bubble"})


@pytest.mark.parametrize("options", PACKINGS, ids=str)
def test_frames_have_the_contacts_of_pack(options, tmp_path):
    run = pliant.pack(**options, pressure=1e-2, output=tmp_path / "run", quiet=True, progress=False)
    frame, s, dim = run.frames[-1], run.summary, run.dim
    stress = np.zeros((dim, dim))
    stress[np.triu_indices(dim)] = run.vector_series["stress"][-1]
    stress = stress + np.triu(stress, 1).T
    accuracy = 1e-5 * np.abs(stress).max()
    assert -analysis.mean_stress(frame, kinetic=False) == pytest.approx(stress, abs=accuracy)
    assert -analysis.particle_stress(frame, frame.box[1].prod()).sum(0) == pytest.approx(stress, abs=accuracy)
    assert len(analysis.touching_pairs(frame)) == s["touching_pairs"]
    assert analysis.mean_coordination(frame) == pytest.approx((s["coordination"], s["rattlers"] / options["n"]))
    assert frame.touching.sum() == 2 * s["touching_pairs"]
    pairs, force, vector = analysis.pair_forces(frame)
    moment = force.T @ vector / frame.box[1].prod()
    assert moment == pytest.approx(-stress, abs=accuracy)
    assert np.trace(analysis.fabric(frame)) == pytest.approx(1) and len(pairs) == s["touching_pairs"]


@pytest.mark.parametrize("dim, count, density", ((2, 1, 0.95), (2, 4, 0.95), (3, 8, 0.8)))
def test_a_simulation_has_the_stress_of_its_minimum(dim, count, density):
    length = (count * np.pi / (2 * dim) / density) ** (1 / dim)
    place = np.random.default_rng(3).random((count, dim)) * length
    sim = Simulation(place, 1.0, box=[length] * dim, e_sp=1.0, allow_passing_overlap=True)
    stress = sim.minimize(force_tolerance=1e-12).stress
    assert -analysis.mean_stress(sim) == pytest.approx(stress, rel=1e-9, abs=1e-12)
    fields = analysis.coarse_grained(sim, width=0.5)
    assert -fields.contact_stress.mean((*range(dim),)) == pytest.approx(stress, rel=1e-3, abs=1e-9)
