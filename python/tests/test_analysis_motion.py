"""pliant.analysis: mean squared displacement, D²_min and non-affine motion, with known answers."""

import re

import numpy as np
import pytest
from lattices import random_disks
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import write_run

from pliant import Run, analysis
from pliant.analysis import Particles
from pliant.run import lattice


def test_msd_of_uniform_motion_and_of_a_walk():
    time = np.arange(6) * 0.5
    velocity = np.array([[1.0, 0.0], [0.0, 2.0]])
    table = analysis.mean_squared_displacement(time[:, None, None] * velocity, time)
    assert_allclose(table["time"], time[1:])
    assert_allclose(table["msd"], 2.5 * time[1:] ** 2)
    assert_allclose(table["msd_x"], 0.5 * time[1:] ** 2)
    assert_array_equal(table["samples"], [10, 8, 6, 4, 2])
    # <u⁴> = (1 + 16)/2 t⁴
    assert_allclose(table["alpha2"], 8.5 * 2 / (4 * 2.5**2) - 1)
    same = analysis.mean_squared_displacement(time[:, None, None] * np.ones((1, 5, 3)), time, drift=False)
    assert_allclose(same["msd"], 0, atol=1e-20)
    walk = np.cumsum(np.random.default_rng(1).normal(size=(60, 800, 3)), axis=0)
    table = analysis.mean_squared_displacement(walk, lags=[1, 4, 9])
    assert_allclose(table["msd"], 3 * np.array([1, 4, 9]), rtol=0.02)
    assert_allclose(table["alpha2"], 0, atol=0.02)


def test_msd_leaves_out_reinsertions_and_absent_particles():
    place = np.zeros((4, 3, 2))
    place[:, :, 0] = np.arange(4)[:, None]
    place[2:, 1, 1] = 100.0  # jumps between the frames 1 and 2
    place[3, 2] = np.nan
    jumps = np.zeros((4, 3), int)
    jumps[2:, 1] = 1
    table = analysis.mean_squared_displacement(place, reinsertions=jumps)
    assert_allclose(table["msd"], [1, 4, 9])
    assert_array_equal(table["samples"], [3 + 2 + 2, 2 + 1, 1])
    assert analysis.mean_squared_displacement(place)["msd"].max() > 1000


def test_msd_of_a_run_recognises_reinsertions(tmp_path):
    path, truth = write_run(tmp_path / "run", n=20)
    with Run(path) as run:
        table = analysis.mean_squared_displacement(run)
        # Of particle i there are i % 1, i % 2, i % 3 reinsertions in the three frames; particle 0 has left after the first.
        stayed = [i for i in range(1, 20) if i % 3 == 0]
        moved = truth["centres"][2][stayed] - truth["centres"][0][stayed]
        assert_allclose(table["msd"][1], (moved**2).sum(1).mean())
        assert table["samples"][1] == len(stayed)
        assert_allclose(table["time"], [0.5, 1.0])
        with pytest.raises(ValueError, match="1 frames have no displacements; write frames more often"):
            analysis.mean_squared_displacement(run.frames[:1])


def test_msd_across_a_periodic_border(tmp_path):
    import h5py
    path, _ = write_run(tmp_path / "run", n=4, frames=2)
    with h5py.File(path / "run.h5", "r+") as file:
        file["geometry/box"] = [[0.0, 0.0], [10.0, np.inf]]
        for k, x in enumerate((9.9, 0.1)):
            group = file[f"frames/{k:06d}"]
            del group["positions"], group["active"], group["reinsertions"]
            group["positions"] = np.c_[np.full(4, x), np.arange(4.0)]
            group["images"] = np.c_[np.full(4, k), np.zeros(4, int)]
            group["active"] = np.ones(4, np.uint8)
            group["reinsertions"] = np.zeros(4, np.int32)
    with Run(path) as run:
        assert_allclose(analysis.mean_squared_displacement(run)["msd"], 0.04)
        assert_allclose(analysis.displacements(*run.frames), np.tile([0.2, 0], (4, 1)))


@pytest.mark.parametrize("call, message", [
    (lambda: analysis.mean_squared_displacement(np.zeros((3, 2))), "give [frames, N, 2]"),
    (lambda: analysis.mean_squared_displacement(np.zeros((3, 2, 2)), lags=[3]), "give numbers of frames from 1 to 2"),
    (lambda: analysis.mean_squared_displacement(np.zeros((3, 2, 2)), times=[1, 2]), "give [3] and [3, 2]"),
    (lambda: analysis.displacements(np.zeros((3, 2)), np.zeros((4, 2))), "the same particles in the same order"),
    (lambda: analysis.d2_min(Particles(np.zeros((3, 2)), box=[9, 9]), np.zeros((3, 2))), "open in the same directions"),
    (lambda: analysis.d2_min(Particles(np.zeros((3, 2)), box=[9, 9]), Particles(np.zeros((3, 2)), box=[9, np.inf])), "in the same directions"),
    (lambda: Particles(np.zeros((3, 2)), ids=[1, 2, 1]), "the id 1 occurs 2 times"),
    (lambda: Particles(np.zeros((3, 2)), ids=[1, 2]), "ids has the shape [2]")])
def test_bad_input(call, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        call()


@pytest.mark.parametrize("dim", [2, 3])
def test_affine_motion(dim):
    rng = np.random.default_rng(2)
    before = rng.uniform(0, 10, (200, dim))
    matrix = np.eye(dim) + 0.1 * rng.normal(size=(dim, dim))
    after = before @ matrix.T + rng.normal(size=dim)
    value, number = analysis.d2_min(before, after)
    assert_allclose(value, 0, atol=1e-20)
    assert (number == 15).all()
    found = analysis.deformation(before, after)
    assert_allclose(found, np.broadcast_to(matrix, found.shape), rtol=1e-9)
    symmetric, rotation = analysis.strain(found)
    assert_allclose(symmetric + rotation + np.eye(dim), found)
    assert_allclose(rotation, -rotation.transpose(0, 2, 1))
    # A shift of all has no non-affine part.
    assert_allclose(analysis.non_affine_displacements(before, before + 3.0, 1.0), 0, atol=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_d2_min_equals_lstsq(dim):
    rng = np.random.default_rng(4)
    part = random_disks(120, 8.0 if dim == 2 else 5.0, dim=dim)
    moved = (part.positions + rng.normal(0, 0.1, part.positions.shape)) % part.period
    near = analysis.within(part, 1.6)
    value, number = analysis.d2_min(part, Particles(moved, box=part.box), near)
    fitted = analysis.deformation(part, Particles(moved, box=part.box), near)
    assert_array_equal(number, near.number)
    for i in range(part.count):
        others = near.second[near.first == i]
        if len(others) <= dim:
            assert np.isnan(value[i])
            continue
        old = part.nearest_image(part.positions[others] - part.positions[i])
        new = part.nearest_image(moved[others] - moved[i])
        solution = np.linalg.lstsq(old, new, rcond=None)[0]
        assert_allclose(value[i], ((new - old @ solution) ** 2).sum(), rtol=1e-8)
        assert_allclose(fitted[i], solution.T, rtol=1e-6, atol=1e-9)


def test_one_particle_that_moves_alone():
    """On a square lattice with the eight neighbours: D²_min of the particle is u² (8 - 0), as the best F is the identity: the
    sum over the neighbours of x is zero. A neighbour at r has u² (1 - r·M⁻¹·r), M = 6·1 the moment of the eight."""
    place = np.stack(np.meshgrid(np.arange(7.0), np.arange(7.0), indexing="ij"), -1).reshape(-1, 2)
    moved = place.copy()
    moved[24] += [0.0, 0.3]  # the middle
    value, number = analysis.d2_min(place, moved, analysis.within(place, 1.5))
    assert number[24] == 8
    assert_allclose(value[24], 8 * 0.09)
    assert_allclose(value[[23, 25, 17, 31]], 0.09 * (1 - 1 / 6))
    assert_allclose(value[[16, 18, 30, 32]], 0.09 * (1 - 2 / 6))
    assert_allclose(value[:14], 0, atol=1e-20)
    weight = np.exp(-1 / 2), np.exp(-1)
    na = analysis.non_affine_displacements(place, moved, 1.0)
    total = 1 + sum(np.exp(-((place - place[24]) ** 2).sum(1) / 2)[((place - place[24]) ** 2).sum(1) <= 16]) - 1
    assert_allclose(na[24], [0, 0.3 * (1 - 1 / total)])
    assert_allclose(na[24, 1] - 0.3, -0.3 / total)
    assert weight[0] > weight[1] and na[0, 1] <= 0


CHANGES = [([4.0, 4.3], None, [4.4, 4.73], None), ([4.0, 4.3], None, [4.0, 4.3], [0.9]), ([4.0, 5.0], [0.4], [4.2, 5.25], [1.3]),
           ([3.0, 3.0, 3.0], None, [2.7, 2.7, 2.7], None), ([3.0, 3.5, 3.0], [0.3, 0.2, 0.1], [3.0, 3.5, 3.0], [0.9, 0.2, 0.1]),
           ([4.0, np.inf], None, [4.8, np.inf], None)]


@pytest.mark.parametrize("count", [1, 4, 30])
@pytest.mark.parametrize("length, tilt, other_length, other_tilt", CHANGES)
def test_particles_that_follow_a_box_have_no_non_affine_motion(count, length, tilt, other_length, other_tilt):
    """At random places, which are uneven, with a width of the mean that reaches over several images of the box."""
    edges, others = lattice(length, tilt), lattice(other_length, other_tilt)
    dim, is_open = len(edges), np.diag(edges) == 0
    strain = np.linalg.solve(edges + np.diag(is_open), others + np.diag(is_open))
    places = np.random.default_rng(3).uniform(0, 3, (count, dim))
    before, after = Particles(places, box=length, tilt=tilt), Particles(places @ strain, box=other_length, tilt=other_tilt)
    assert_allclose(analysis.non_affine_displacements(before, after, 1.5), 0, atol=1e-12)
    value, number = analysis.d2_min(before, after)
    assert_allclose(value, 0, atol=1e-18)
    assert (number == 15).all()
    if count > 1 or not is_open.any():  # images of one particle are on a line
        assert_allclose(analysis.deformation(before, after), np.broadcast_to(strain.T, (count, dim, dim)), atol=1e-9)


@pytest.mark.parametrize("length, tilt, other_length, other_tilt", CHANGES)
def test_non_affine_motion_in_a_box_that_changes(length, tilt, other_length, other_tilt):
    """Against sums over all images, of particles that move by themselves in addition to their box."""
    edges, others = lattice(length, tilt), lattice(other_length, other_tilt)
    dim, is_open = len(edges), np.diag(edges) == 0
    strain = np.linalg.solve(edges + np.diag(is_open), others + np.diag(is_open))
    rng = np.random.default_rng(8)
    places = rng.uniform(0, 3, (5, dim))
    own = rng.normal(0, 0.1, (5, dim))
    before, after = Particles(places, box=length, tilt=tilt), Particles(places @ strain + own, box=other_length, tilt=other_tilt)
    width = 0.8
    images = np.unique(np.stack(np.meshgrid(*[np.arange(-5, 6)] * dim), -1).reshape(-1, dim) @ edges, axis=0)
    least, _ = analysis.d2_min(before, after)
    found = analysis.non_affine_displacements(before, after, width)
    for i in range(5):
        old = (places[None] - places[i] + images[:, None]).reshape(-1, dim)
        of = np.tile(np.arange(5), len(images))
        r = np.linalg.norm(old, axis=1)
        weight = np.exp(-r**2 / (2 * width**2)) * (r <= 4 * width)
        assert_allclose(found[i], own[i] - weight @ own[of] / weight.sum(), atol=1e-12)
        near = np.argsort(r)[1:16]
        new = old[near] @ strain + own[of[near]] - own[i]
        fit = np.linalg.lstsq(old[near], new, rcond=None)[0]
        assert_allclose(least[i], ((new - old[near] @ fit) ** 2).sum(), rtol=1e-9)


def test_few_particles_in_an_open_box():
    """All others are neighbours; with too few others the value is NaN. Absent particles count nowhere."""
    place = np.random.default_rng(1).uniform(0, 5, (20, 2))
    strained = place @ [[1.1, 0.2], [0.0, 0.9]]
    for count in (20, 9, 4, 3, 1, 0):
        after = Particles(strained, active=np.arange(20) < count)
        value, number = analysis.d2_min(place, after)
        assert_array_equal(number[:count], min(15, max(count - 1, 0)))
        assert_array_equal(np.isfinite(value), np.arange(20) < (count if count > 3 else 0))
        assert_allclose(value[np.isfinite(value)], 0, atol=1e-18)
        assert np.isfinite(analysis.non_affine_displacements(place, after, 1.0)[:count]).all()


def test_particles_are_matched_by_their_ids():
    """Other rows, others that have left (NaN) and others that are new; results are in the rows of the first moment."""
    rng = np.random.default_rng(2)
    place = rng.uniform(0, 9, (40, 2))
    moved = place + rng.normal(0, 0.1, (40, 2))
    rows = rng.permutation(40)
    left = rows[:3]
    stays = np.setdiff1d(np.arange(40), left)
    before = Particles(place, ids=np.arange(40) + 100, box=[9, 9])
    after = Particles(np.r_[moved[rows[3:]], [[4, 4]]] % 9, ids=np.r_[rows[3:] + 100, 500], box=[9, 9])
    found = analysis.displacements(before, after)
    assert np.isnan(found[left]).all()
    assert_allclose(found[stays], (moved - place)[stays], atol=1e-12)
    plain = Particles(place, box=[9, 9]), Particles(moved % 9, box=[9, 9], active=np.isin(np.arange(40), stays))
    for function in (lambda a, b: analysis.d2_min(a, b)[0], lambda a, b: analysis.non_affine_displacements(a, b, 1.0), analysis.deformation):
        assert_array_equal(function(before, after), function(*plain))
        assert np.isnan(function(before, after)[left]).all()
    msd = analysis.mean_squared_displacement([before, after])
    assert_allclose(msd["msd"], ((moved - place)[stays] ** 2).sum(1).mean())
    assert msd["samples"][0] == 37


def test_frames_of_different_particles_are_refused(tmp_path):
    with Run(write_run(tmp_path / "a", n=20)[0]) as a, Run(write_run(tmp_path / "b", n=21)[0]) as b:
        for function in (analysis.displacements, analysis.d2_min, analysis.deformation):
            with pytest.raises(ValueError, match="a has 20 particles and .*b 21, or their sizes differ; give two frames of the same run"):
                function(a.frames[0], b.frames[1])


def test_motion_in_a_run_leaves_reinserted_particles_out(tmp_path):
    path, _ = write_run(tmp_path / "run", n=150)
    with Run(path) as run:
        first, last = run.frames[0], run.frames[2]
        value, number = analysis.d2_min(first, last)
        gone = (np.arange(150) % 3 != 0) | (np.arange(150) == 0)
        assert np.isnan(value[gone]).all() and (number[gone] == 0).all()
        assert np.isfinite(value[~gone]).all() and (number[~gone] == 15).all()
        assert np.isnan(analysis.deformation(first, last)[gone]).all()
        near = analysis.within(first, 2.5)
        assert (analysis.d2_min(first, last, near)[1][~gone] <= near.number[~gone]).all()
        assert np.isnan(analysis.non_affine_displacements(first, last, 1.0)[gone]).all()
