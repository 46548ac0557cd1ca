"""The scenarios pack and shear: known counts of contacts, paths, work, moduli, restart, refusals."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import PROGRAM, Results, assert_same_runs, end, pliant, start, wait_for
from test_parallel import mpi_environment

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))
from pliant import Run  # noqa: E402
from pliant.report.frames import quantities, relative_pressure  # noqa: E402


PLOTS = Path(__file__).resolve().parents[2] / "python" / "plots"


def pack(folder, **options):
    result = pliant("pack", output=folder, **{"n": 32, **options})
    assert result.returncode == 0, result.stderr
    return Results(folder)


def test_colours_of_pictures_of_packings(tmp_path):
    """Particles at rest have no speed: reports show the pressure of each particle by default, pictures its contacts."""
    pack(tmp_path / "run", pressure=1e-3)
    with Run(tmp_path / "run") as run:
        names = [quantity.name for quantity in quantities(run, run.frames[-1])]
        assert names[0] == "pressure" and "speed" not in names
        for frame in run.frames:
            relative = relative_pressure(run, frame)
            assert relative.mean() == pytest.approx(1) and relative.max() > 1.5
            resting = frame.contacts[["particle_1", "particle_2"]].to_numpy()
            assert (relative[np.setdiff1d(np.arange(32), resting)] == 0).all()
        assert run.draw().figure.axes[1].get_ylabel() == "touching particles"
    pack(tmp_path / "bare", pressure=1e-3, frame_fields="contacts")
    with Run(tmp_path / "bare") as run:
        assert [quantity.name for quantity in quantities(run, run.frames[-1])][0] == "force"


@pytest.mark.parametrize("options", [{}, {"seed": 2}, {"dim": 3}, {"dim": 3, "seed": 2, "size_distribution": "mono"},
                                     {"path": "compress", "fraction": 0.8, "fraction_step": 5e-3}])
def test_soft_packings_are_isostatic(options, tmp_path):
    """Maxwell's count: one contact more than the coordinates of all particles but one."""
    run = pack(tmp_path / "run", pressure=1e-6, **options)
    s = run.summary
    dim = options.get("dim", 2)
    assert s["contacts"] == s["isostatic_contacts"] == dim * (s["backbone"] - 1) + 1
    assert s["backbone"] + s["rattlers"] == 32
    assert s["pressure"] == pytest.approx(1e-6, rel=1e-4) and s["max_force"] <= 1.1e-12
    assert s["ended_by"] == "pressure" and 0.5 < s["fraction"] < 0.9
    stress = run.series["stress"][-1]
    diagonal = stress[[0, 2]] if dim == 2 else stress[[0, 3, 5]]
    assert -diagonal.mean() == pytest.approx(s["pressure"])


def test_pressures_and_boxes_of_a_decompression(tmp_path):
    run = pack(tmp_path / "run", pressure=2e-4, steps_per_decade=2)
    expected = [1e-2, 10**-2.5, 1e-3, 10**-3.5, 2e-4]
    assert run.series["pressure"][1:] == pytest.approx(expected, rel=1e-4)
    assert (np.diff(run.series["fraction"][1:]) < 0).all() and (np.diff(run.series["energy"][1:]) < 0).all()
    for k, frame in enumerate(run.frames):
        box = frame["box"]
        assert box[1].prod() == pytest.approx(run.series["volume"][k], rel=1e-12) and (box[2] == 0).all()
        assert ((frame["centres"] >= box[0]) & (frame["centres"] < box[0] + box[1])).all()
    # dU = −p dV along the path, by the trapezoidal rule for small steps.
    fine = pack(tmp_path / "fine", pressure=5e-3, steps_per_decade=40).series
    work = -np.diff(fine["volume"][1:]) * (fine["pressure"][1:-1] + fine["pressure"][2:]) / 2
    assert np.diff(fine["energy"][1:]) == pytest.approx(work, rel=5e-3)


def test_a_symmetric_packing_is_no_saddle_point(tmp_path):
    """These equal spheres crystallise at the first minimum, and the crystal is unstable at the pressure of the second."""
    run = pack(tmp_path / "run", n=64, dim=3, size_distribution="mono", pressure=1e-2, seed=54, moduli="true", modes=4)
    frequencies = run.series["frequencies"][-1]
    assert frequencies[3] > 1e-2 and (abs(frequencies[:3]) < 1e-6).all()


def test_moduli_of_a_crystal(tmp_path):
    """Fifteen large disks are on 15 of the 17 sites of a square lattice, the others are rattlers: a uniform
    strain exerts no force on a disk."""
    run = pack(tmp_path / "run", n=30, size_ratio=10, pressure=1e-4, moduli="yes")
    assert run.summary["rattlers"] == 15 and run.summary["contacts"] == 30
    # 30 springs of length 2R and stiffness 1/(2R)²: U'' = 30 by the logarithm of the length of the box.
    assert run.summary["bulk_modulus"] == pytest.approx(30 / (4 * run.frames[-1]["box"][1].prod()), rel=1e-3)


@pytest.mark.parametrize("options", [{"n": 1, "fraction": 0.9}, {"n": 1, "dim": 3, "fraction": 0.6},
                                     {"n": 2, "fraction": 0.9, "model": "bubble"}])
def test_moduli_of_a_lattice(options, tmp_path):
    """No strain exerts a force on a particle, and nothing resists the motion of a single one."""
    low, high = (pack(tmp_path / f"{k}", **{**options, "fraction": options["fraction"] + k}, path="quench",
                      moduli="yes").summary for k in (0, 1e-4))
    by_difference = (high["pressure"] - low["pressure"]) / np.log(high["fraction"] / low["fraction"])
    assert (low["bulk_modulus"] + high["bulk_modulus"]) / 2 == pytest.approx(by_difference, rel=1e-6)


def test_particles_that_nothing_holds_leave_their_saddle_point(tmp_path):
    """These equal spheres crystallise; below p = 1e-3 only chains along one axis would touch."""
    s = pack(tmp_path / "run", n=128, dim=3, size_distribution="mono", seed=3).summary
    assert s["pressure"] == pytest.approx(1e-6, rel=1e-4) and s["contacts"] > 300 and s["rattlers"] < 20


def test_quench(tmp_path):
    loose = pack(tmp_path / "loose", path="quench", fraction=0.5).summary
    assert loose["pressure"] < 1e-9 and loose["contacts"] == 0 and loose["rattlers"] == 32
    dense = pack(tmp_path / "dense", path="quench", fraction=1).summary
    assert dense["fraction"] == pytest.approx(1) and dense["pressure"] > 0.05 and dense["contacts"] > 64


@pytest.mark.parametrize("options", [{}, {"force_tolerance": 0.1}, {"contact_law": "hertz"}, {"dim": 3, "fraction": 0.6},
                                     {"modes": 10, "n": 100}])
def test_particles_that_come_apart_are_at_no_saddle_point(options, tmp_path):
    """At a coarse tolerance a minimisation ends while pairs still push each other apart."""
    s = pack(tmp_path / "run", **{"n": 1000, "path": "quench", "fraction": 0.8, "force_tolerance": 1e-2, **options}).summary
    assert s["pressure"] < 1e-9 and s["contacts"] == 0


def test_an_ensemble_counts_the_packings_with_moduli(tmp_path):
    result = pliant("pack", output=tmp_path / "all", n=20, path="quench", fraction=0.82, moduli="yes", ensemble=6)
    assert result.returncode == 0, result.stderr
    loose = [line for line in (tmp_path / "all/members.csv").read_text(encoding="utf-8").splitlines()[1:] if line.endswith(",,,")]
    row = next(line for line in result.stdout.splitlines() if "bulk_modulus" in line)
    assert 0 < len(loose) < 6 and row.endswith(f"(of {6 - len(loose)} runs)")


@pytest.mark.parametrize("options", [{"force_tolerance": 1e-12}, {"pressure": 1e-12, "max_iterations": 2000}])
def test_a_tolerance_below_rounding_errors_ends(options, tmp_path):
    result = pliant("pack", output=tmp_path / "run", n=16, **options)
    assert result.returncode == 3 and "rounding errors keep the largest force at" in result.stderr
    assert "raise -force_tolerance" in result.stderr and "-max_iterations" not in result.stderr


def test_few_iterations_are_no_rounding_error(tmp_path):
    """Before the box has changed the forces on points are rounding errors, within the tolerance."""
    result = pliant("pack", output=tmp_path / "run", model="rough", n=12, pressure=1e-3, max_iterations=3)
    assert result.returncode == 3 and "limit of 3 iterations" in result.stderr and "-max_iterations" in result.stderr


@pytest.mark.parametrize("options", [
    {"shape_parameter": 1.16, "seed": 3, "pressure": 1e-5, "moduli": "yes"},
    {"n": 64, "shape_parameter": 1.08, "k_b": 0.01, "seed": 12, "pressure": 1e-3, "moduli": "yes"},
    {"model": "smooth", "n": 4, "n_vertices": 64, "pressure": 1e-2}])
def test_minima_of_polygons_take_few_evaluations(options, tmp_path):
    """FIRE alone takes 300 000 evaluations for the first run, and does not find the minima of the others in 10⁶."""
    s = pack(tmp_path / "run", **{"n": 16, "model": "rough", **options}).summary
    assert s["pressure"] == pytest.approx(options["pressure"]) and s["force_evaluations"] < 200_000


@pytest.mark.parametrize("options", [
    {"pressure": 1e-3}, {"dim": 3, "pressure": 1e-2, "n": 24, "seed": 3}, {"path": "quench", "fraction": 0.95},
    {"model": "rough", "n": 6, "n_vertices": 10, "pressure": 1e-2}, {"model": "bubble", "pressure": 1e-2}])
def test_minimisers_find_the_same_packing(options, tmp_path):
    options = {"n": 32, "moduli": "yes", **options}
    runs = {name: pack(tmp_path / name, minimiser=name, **options).summary for name in ("lbfgs", "newton", "fire")}
    assert all(summary["integrator"] == name for name, summary in runs.items())
    for name, s in runs.items():
        assert s["max_force"] <= 1e-12, name
        for value in ("energy", "pressure", "bulk_modulus", "shear_modulus"):
            assert s[value] == pytest.approx(runs["fire"][value], rel=1e-5), (name, value)
    assert runs["newton"]["force_evaluations"] < runs["fire"]["force_evaluations"]


def test_newton_reads_the_options_of_tao_and_restarts_keep_the_minimiser(tmp_path):
    shows = pliant("pack", "-tao_converged_reason", "-tao_bnk_ksp_converged_reason", output=tmp_path / "run", n=16,
                   pressure=1e-3, minimiser="newton", tao_type="bntr")
    assert shows.returncode == 0, shows.stderr
    assert "CONVERGED_USER" in shows.stdout and "Linear tao_bnk_ solve converged" in shows.stdout
    again = pliant("pack", restart=tmp_path / "run", pressure=1e-4, minimiser="lbfgs")
    assert again.returncode == 2 and "-minimiser lbfgs: the stored run has newton" in again.stderr


def test_polygons_in_a_fixed_box_take_few_evaluations(tmp_path):
    """FIRE alone takes 800 000 evaluations."""
    result = pliant("shear", output=tmp_path / "run", model="smooth", n=8, n_vertices=12, strain=0.01, strain_step=2e-3)
    assert result.returncode == 0, result.stderr
    assert Results(tmp_path / "run").summary["force_evaluations"] < 300_000


def test_polygons(tmp_path):
    s = pack(tmp_path / "run", n=6, model="rough", n_vertices=10, pressure=1e-2, start_pressure=1e-2).summary
    assert s["pressure"] == pytest.approx(1e-2, rel=1e-4) and s["rim_fraction"] > s["fraction"] > 0.4
    assert s["touching_pairs"] > 6


def test_polygons_that_creep_below_jamming(tmp_path):
    """The energy of small changes of a regular polygon is quartic, so that forces of 1e-12 take many iterations."""
    regular = {"n": 4, "model": "rough", "n_vertices": 12, "path": "compress", "fraction_step": 0.02, "pressure": 1e-3}
    run = pack(tmp_path / "run", **regular, max_iterations=30000)
    creeping = run.series["iterations"] > 30000
    assert creeping.any() and (run.series["pressure"][creeping] < 1e-6).all()
    assert (run.series["max_force"] <= 1e-9).all() and run.summary["pressure"] == pytest.approx(1e-3, rel=1e-4)
    later = pack(tmp_path / "later", **regular, max_iterations=100000).summary
    assert run.summary["fraction"] == pytest.approx(later["fraction"], rel=1e-6)
    # Derivatives need the finer tolerance.
    failed = pliant("pack", output=tmp_path / "moduli", **regular, max_iterations=30000, moduli="yes")
    assert failed.returncode == 3 and "bending stiffness (-k_b, now 0)" in failed.stderr
    pack(tmp_path / "stiff", **regular, max_iterations=30000, moduli="yes", k_b=1e-3)


def test_sheared_polygons_that_creep(tmp_path):
    """Shear at constant volume may unjam polygons."""
    result = pliant("shear", output=tmp_path / "run", n=6, model="rough", n_vertices=12, pressure=1e-4, strain=0.1,
                    strain_step=0.01, seed=3, max_iterations=100000)
    assert result.returncode == 0, result.stderr
    s = Results(tmp_path / "run").series
    assert (s["iterations"] >= 100000).any() and (s["max_force"][3:] <= 1e-10).all()


def droplet_energy(centres, radii, length, f0, phi_c, a_s):
    """Energy of droplets in a square or cubic box [T 2.1, 2.4], and whether pairs interact."""
    i, j = np.triu_indices(len(radii), 1)
    apart = centres[i] - centres[j]
    r = np.linalg.norm(apart - length * np.round(apart / length), axis=1)
    s, reach = radii[i] + radii[j], radii[i] + radii[j] + 2 * a_s
    A, B = radii[i] + a_s, radii[j] + a_s
    lens = np.where(r < reach, np.pi * (A + B - r)**2 * (r**2 + 2 * r * (A + B) - 3 * (A - B)**2) / (12 * r), 0)
    return (f0 * np.maximum(0, s - r)**2 / (2 * s)).sum() - phi_c / (8 * a_s**3) * lens.sum(), r < reach


@pytest.mark.parametrize("dim", [2, 3])
def test_droplets(dim, tmp_path):
    """Energy, force and pressure of the packing from the published formulas; attraction holds droplets without a load."""
    law = {"f0": 2, "phi_c": 2e-3, "a_s": 0.08}
    run = pack(tmp_path / "run", model="bubble", dim=dim, n=40, pressure=1e-7, start_pressure=1e-2, steps_per_decade=2, **law)
    frame, radii = run.frames[-1], run.topology["sigma"] / 2
    length = frame["box"][1, 0]
    energy, bound = droplet_energy(frame["centres"], radii, length, **law)
    assert run.series["energy"][-1] == pytest.approx(energy, rel=1e-10) and energy < 0
    h = 1e-5
    of_strain = [droplet_energy(frame["centres"] * (1 + k * h), radii, length * (1 + k * h), **law)[0] for k in (-1, 1)]
    pressure = -(of_strain[1] - of_strain[0]) / (2 * h) / dim / length**dim
    assert run.series["pressure"][-1] == pytest.approx(1e-7, rel=1e-3) and pressure == pytest.approx(1e-7, abs=1e-9)
    for k in range(dim):
        shifts = []
        for step in (-h, h):
            moved = frame["centres"].copy()
            moved[0, k] += step
            shifts.append(droplet_energy(moved, radii, length, **law)[0])
        assert shifts[1] - shifts[0] == pytest.approx(0, abs=2 * h * 1e-7)
    assert 0.9 * bound.sum() < run.summary["contacts"] <= bound.sum()  # bonds in tension are contacts


def test_droplets_that_attraction_presses_into_each_other_are_refused(tmp_path):
    for phi_c, message in ((1e-3, "droplets do not rest"), (5e-4, "lower -phi_c, now 0.0005")):
        result = pliant("pack", output=tmp_path / str(phi_c), model="bubble", phi_c=phi_c)
        assert result.returncode == 2 and message in result.stderr, result.stderr


def test_moduli_and_modes(tmp_path):
    """−V ∂p/∂V between two packings with the same contacts; translations are zero modes, the packing is stable."""
    run = pack(tmp_path / "run", pressure=0.0098, start_pressure=0.01, moduli="yes", modes=64)
    s = run.series
    (v0, v1), (p0, p1) = s["volume"][1:], s["pressure"][1:]
    slope = -(v0 + v1) / 2 * (p1 - p0) / (v1 - v0)
    assert slope == pytest.approx(s["bulk_modulus"][1:].mean(), rel=1e-3)
    assert (s["bulk_modulus"][1:] > s["shear_modulus"][1:]).all() and (s["shear_modulus"][1:] > 0).all()
    modes = s["frequencies"][-1][:2 * int(s["backbone"][-1])]
    assert (np.abs(modes[:2]) < 1e-4).all() and (modes[2:] > 1e-2).all() and np.isnan(s["bulk_modulus"][0])


@pytest.mark.parametrize("seed", [1, 2])
def test_zero_modes_of_polygons_without_bending(seed, tmp_path):
    """Each contact, edge and area removes a mode of a packing without pre-stress, but for one state of self-stress: the forces
    themselves. Of the modes with pre-stress only the translations are zero, and a few of the lowest are quartic without it."""
    options = {"n": 8, "model": "rough", "n_vertices": 10, "k_b": 0, "pressure": 1e-4, "start_pressure": 1e-2, "modes": 160, "seed": seed}
    run = pack(tmp_path / "run", pre_stress="dropped", **options)
    s = run.summary
    frequencies = np.abs(run.series["frequencies"][-1])
    frequencies = np.sort(frequencies[np.isfinite(frequencies)])
    zero = s["backbone"] * (10 - 1) - s["contacts"] + 1
    assert len(frequencies) == 2 * 10 * s["backbone"] and 8 < zero < 60
    assert s["zero_modes"] == run.series["zero_modes"][-1] == zero and s["isostatic_contacts"] - s["contacts"] == zero - 2
    assert frequencies[zero - 1] < 1e-6 < 1e-3 < frequencies[zero]
    kept = np.abs(pack(tmp_path / "kept", **options).series["frequencies"][-1])
    assert (np.sort(kept[np.isfinite(kept)])[:3] < [1e-6, 1e-6, np.inf]).all() and np.sort(kept)[2] > 1e-5


def test_quartic_modes_of_polygons(tmp_path):
    """Along modes without stiffness the energy is quadratic up to a crossover, with a coefficient proportional to the pressure, and
    quartic above it; along stiff modes it is quadratic. Bending leaves no mode without stiffness."""
    options = {"n": 8, "model": "rough", "n_vertices": 12, "shape_parameter": 1.08, "pressure": 1e-6, "modes": 192}
    counted, bent = (pack(tmp_path / f"{k_b:g}", k_b=k_b, pre_stress="dropped", **options).summary for k_b in (0, 0.01))
    missing = counted["isostatic_contacts"] - counted["contacts"]
    assert counted["zero_modes"] - 2 == missing > 8
    assert bent["zero_modes"] == 2 and bent["isostatic_contacts"] == 3 * bent["backbone"] - 1 <= bent["contacts"]
    pack(tmp_path / "along", mode_amplitude=0.05, **options)
    with Run(tmp_path / "along") as run:
        along, pressure = run.mode_energies, run.series["pressure"].to_numpy()
    assert along.amplitude == pytest.approx(0.05 * 10 ** (np.arange(-32, 1) / 8)) and along.energy.shape == (6, 192, 33)
    loose, stiff = slice(2, 2 + missing), slice(2 + missing, None)
    exponents = along.exponents(along.above_crossover)[-1]
    known = exponents[loose][np.isfinite(exponents[loose])]
    assert len(known) > missing / 2 and (abs(known - 4) < 0.1).all()
    small = np.broadcast_to(along.amplitude < 0.01, along.energy.shape)
    assert np.median(along.exponents(small)[-1, stiff]) == pytest.approx(2, abs=0.02)
    assert np.median(along.exponents(along.amplitude < 3e-5 * (along.energy > 0))[-2, loose]) == pytest.approx(2, abs=0.1)
    loose_ratio, stiff_ratio = (np.median(along.quadratic[-1, of] / along.quadratic[-2, of]) for of in (loose, stiff))
    assert loose_ratio == pytest.approx(pressure[-1] / pressure[-2], rel=0.1) and stiff_ratio == pytest.approx(1, rel=0.1)


def test_modes_in_frames_and_pictures(tmp_path):
    """Stored displacements are the eigenvectors of their frequencies: orthogonal with the masses. Scripts draw the run."""
    for model in ({}, {"model": "rough", "n": 6, "n_vertices": 8, "pressure": 1e-2, "start_pressure": 1e-2}):
        run = pack(tmp_path / str(len(model)), **{"pressure": 1e-3, "modes": 96 if model else 64, **model})
        modes = run.frames[-1]["modes"].reshape(len(run.frames[-1]["positions"]), 20, 2)
        assert np.linalg.norm(modes, axis=2).max(0) == pytest.approx(1) and (run.frames[0]["modes"] == 0).all()
        mass = np.repeat(run.topology["mass"] / np.diff(run.topology["offset"]), np.diff(run.topology["offset"]))
        overlaps = np.einsum("pka,p,pla->kl", modes, mass, modes)
        size = np.sqrt(np.diag(overlaps))
        assert np.abs(overlaps / np.outer(size, size) - np.eye(20)).max() < 1e-9
        for script, options in (("packing.py", []), ("packing.py", ["--mode", "3"]), ("density_of_states.py", [])):
            picture = tmp_path / "picture.png"
            result = subprocess.run(["/usr/bin/python3", PLOTS / script, tmp_path / str(len(model)), *options, "-o", picture],
                                    encoding="utf-8", capture_output=True)
            assert result.returncode == 0 and picture.stat().st_size > 10000, result.stderr
            picture.unlink()
    for script, options, message in (("packing.py", ["--mode", "21"], "mode 21"), ("packing.py", ["--mode", "0"], "mode 0")):
        result = subprocess.run(["/usr/bin/python3", PLOTS / script, tmp_path / "0", *options, "-o", tmp_path / "x.png"],
                                encoding="utf-8", capture_output=True)
        assert result.returncode != 0 and message in result.stderr
    few = pack(tmp_path / "few", pressure=1e-2, start_pressure=1e-2, modes=4)
    assert few.frames[-1]["modes"].shape == (32, 8)
    result = subprocess.run(["/usr/bin/python3", PLOTS / "density_of_states.py", tmp_path / "few", "-o", tmp_path / "x.png"],
                            encoding="utf-8", capture_output=True)
    all_modes = 2 * few.summary["backbone"]
    assert result.returncode != 0 and f"4 of {all_modes} modes" in result.stderr
    assert result.stderr.strip().endswith(f"needs all of them, -modes {all_modes}"), result.stderr


def test_deep_overlaps_are_refused(tmp_path):
    for options in ({"fraction": 3}, {"fraction": 2.9, "path": "quench"}):
        result = pliant("pack", output=tmp_path / "run", n=32, **options)
        assert result.returncode == 2 and "-fraction" in result.stderr, result.stderr


def test_shares_of_the_particles_of_the_stress(tmp_path):
    """The sum over all particles is the stress, whose trace is the pressure; a rattler has no share."""
    for options in ({"pressure": 1e-4}, {"dim": 3, "pressure": 1e-3},
                    {"n": 6, "model": "smooth", "n_vertices": 10, "pressure": 1e-2, "start_pressure": 1e-2}):
        run = pack(tmp_path / str(len(options)), **options)
        shares = run.frames[-1]["particle_stress"]
        assert shares.sum(0) == pytest.approx(run.series["stress"][-1], rel=1e-9, abs=1e-12)
        assert shares.shape[0] == len(run.topology["sigma"]) and (shares[:, 0] <= 1e-12).mean() > 0.7
    loose = pack(tmp_path / "loose", path="quench", fraction=0.5)
    assert np.abs(loose.frames[-1]["particle_stress"]).max() < 1e-9


def test_restart_goes_on_with_the_same_bits(tmp_path):
    whole = pack(tmp_path / "whole", pressure=1e-4, model="rough", n=4, n_vertices=8, start_pressure=1e-2)
    part = tmp_path / "part"
    made = pack(part, pressure=1e-3, model="rough", n=4, n_vertices=8, start_pressure=1e-2).summary["steps"]
    result = pliant("pack", restart=part, pressure=1e-4)
    assert result.returncode == 0, result.stderr
    assert f"\nlbfgs; output in {part}\ncontinuing after step {made}\n" in result.stdout and " t = " not in result.stdout
    assert_same_runs(whole, Results(part))


def test_a_stop_request_interrupts_a_packing(tmp_path):
    """The run, which makes one packing, stops in the middle of it; the same command resumes with the same bits."""
    options = {"n": 2500, "pressure": 1e-3, "start_pressure": 1e-3}
    whole = pack(tmp_path / "whole", **options)
    part = tmp_path / "part"
    child = start("pack", output=part, **options)
    wait_for((part / "checkpoint-a.h5").exists, child)
    time.sleep(0.3)
    end(child, signal.SIGTERM)
    assert child.returncode == 75 and Results(part).summary["t"] == 0
    result = pliant("pack", output=part, **options)
    assert result.returncode == 0, result.stderr
    resumed = Results(part)
    for run in (whole, resumed):
        del run.summary["list_rebuilds"]  # counts those of the interrupted packing, too
    assert_same_runs(whole, resumed)


def test_restart_of_a_finished_run_keeps_its_results(tmp_path):
    before = pack(tmp_path / "run", pressure=1e-3, moduli="yes").summary
    result = pliant("pack", restart=tmp_path / "run")
    assert result.returncode == 0, result.stderr
    after = Results(tmp_path / "run").summary
    for name in ("pressure", "stress", "energy", "fraction", "bulk_modulus", "shear_modulus"):
        assert after[name] == pytest.approx(before[name], rel=1e-9), name
    for name in ("contacts", "isostatic_contacts", "touching_pairs", "backbone", "rattlers", "coordination"):
        assert after[name] == before[name], name
    assert after["max_force"] < 1.1e-9


def test_threads_change_nothing(tmp_path):
    one, two = (pack(tmp_path / str(k), pressure=1e-3, n=300, threads=k).series for k in (1, 2))
    assert all(np.array_equal(one[name], two[name], equal_nan=True) for name in one)


@pytest.mark.parametrize("options, message", [
    ({"pressure": 0}, "-pressure"), ({"pressure": -1}, "-pressure"), ({"pressure": "nan"}, "-pressure"),
    ({"pressure": 1}, "-start_pressure"), ({"fraction": 0}, "-fraction"), ({"n": 0}, "-n"),
    ({"n_vertices": 8}, "-n_vertices"), ({"mesh": "a.off"}, "a.off"),
    ({"model": "rough", "shape_parameter": 0.5}, "-shape_parameter 0.5"),
    ({"fraction": 3}, "-fraction 3"), ({"model": "rough", "fraction": 1.01}, "begin with a lower fraction"),
    ({"path": "quench", "pressure": 1e-3}, "-pressure"), ({"path": "compress", "start_pressure": 1e-2}, "-start_pressure"),
    ({"path": "compress", "fraction": 0.95}, "there is nothing to compress"), ({"ensemble_workers": 2}, "give -ensemble"),
    ({"fraction_step": 1e-3}, "-path decompress, which does not read it"),
    ({"mu": 0.1}, "unknown option -mu"), ({"modes": 65}, "-modes 65"), ({"mode_amplitude": 0.1}, "-modes 0"),
    ({"tao_type": "ntr"}, "with -minimiser newton"), ({"minimiser": "cg"}, "-minimiser cg"),
    ({"minimiser": "newton", "tao_type": "ntl"}, "-tao_type ntl"),
    ({"minimiser": "newton", "tao_ntr_ksp_type": "gltr"}, "-tao_ntr_ksp_type gltr"),
    ({"minimiser": "newton", "tao_gatol": 1e-3}, "-tao_gatol"), ({"minimiser": "newton", "tao_blub": 1}, "-tao_blub"),
    ({"minimiser": "newton", "n": 20001}, "20001 points"),
    ({"max_iterations": 3}, "has not converged")])
def test_refusals(options, message, tmp_path):
    result = pliant("pack", output=tmp_path / "run", **{"n": 32, **options})
    assert result.returncode == (3 if "max_iterations" in options else 2) and message in result.stderr, result.stderr


def shear(folder, **options):
    result = pliant("shear", output=folder, **{"n": 32, "start_pressure": 1e-2, "pressure": 1e-2, **options})
    assert result.returncode == 0, result.stderr
    return Results(folder)


@pytest.mark.parametrize("options", [{}, {"dim": 3}, {"model": "rough", "n": 6, "n_vertices": 8, "strain": 0.01}])
def test_work_of_shear(options, tmp_path):
    """dU = V σ_xy dγ at constant volume while no contacts change."""
    run = shear(tmp_path / "run", **{"strain": 0.01, "strain_step": 2e-4, **options}).series
    sheared = slice(1, None)
    gamma, stress, energy = (run[name][sheared] for name in ("strain", "shear_stress", "energy"))
    assert gamma == pytest.approx(np.arange(51) * 2e-4) and np.ptp(run["volume"][sheared]) < 1e-9
    work = run["volume"][-1] * (stress[1:] + stress[:-1]) / 2 * np.diff(gamma)
    error = np.abs(np.diff(energy) - work)
    assert np.median(error / np.abs(work)) < 1e-3
    assert run["stress"][sheared, 1] == pytest.approx(stress)


def lattice(box):
    """[D, D] edges of the box of a frame, one per row."""
    edges = np.diag(box[1])
    rows, columns = np.tril_indices(len(edges), -1)
    edges[rows, columns] = box[2, :len(rows)]
    return edges


def energy_of(centres, sigma, edges):
    """Σ (1 − r/s)²/2 over all pairs that overlap, images included."""
    dim = len(edges)
    i, j = np.triu_indices(len(sigma), 1)
    images = np.stack(np.meshgrid(*[np.arange(-2, 3)] * dim), -1).reshape(-1, dim) @ edges
    r = np.linalg.norm((centres[i] - centres[j])[:, None] + images, axis=2)
    return (np.maximum(0, 1 - r / ((sigma[i] + sigma[j]) / 2)[:, None])**2).sum() / 2


@pytest.mark.parametrize("options", [{"strain": 0.03}, {"strain": 0.03, "control": "pressure"}, {"strain": 0.02, "cycles": 1},
                                     {"strain": 0.02, "dim": 3}], ids=str)
def test_energy_budget_of_shear(options, tmp_path):
    """Each step moves box and centres by Δγ y along x; then a minimisation removes the energy above the next packing, at a
    constant pressure the sum of energy and p V."""
    run = shear(tmp_path / "run", strain_step=2e-3, **options)
    s, sigma, p = run.series, run.topology["sigma"], 1e-2 if "control" in options else 0
    assert len(run.frames) == len(s["time"])
    for k, step in enumerate(np.diff(s["strain"])):
        if k == 0:  # the first packing
            continue
        box, centres = run.frames[k]["box"], run.frames[k]["centres"]
        edges, strained = lattice(box), np.eye(len(box[0]))  # strained: acts on rows
        assert energy_of(centres, sigma, edges) == pytest.approx(s["energy"][k], rel=1e-9)
        strained[1, 0] = step
        affine = energy_of(box[0] + (centres - box[0]) @ strained, sigma, edges @ strained)
        relaxed = affine - s["energy"][k + 1] - p * (s["volume"][k + 1] - s["volume"][k])
        assert s["relaxed"][k + 1] - s["relaxed"][k] == pytest.approx(relaxed, rel=1e-6, abs=1e-13) and relaxed > 0
    torque = s["volume"] * s["stress"][:, 1]
    work = (torque[1:] + torque[:-1]) / 2 * np.diff(s["strain"]) - (s["pressure"][1:] + s["pressure"][:-1]) / 2 * np.diff(s["volume"])
    assert np.diff(s["work"])[1:] == pytest.approx(work[1:], rel=1e-9, abs=1e-14)
    assert s["work"] - s["dissipated"] == pytest.approx(s["energy"] - s["energy"][0], rel=1e-12)
    assert run.summary["dissipated"] == s["dissipated"][-1] and run.summary["work"] == s["work"][-1]
    assert run.summary["relaxed"] == s["relaxed"][-1]


def test_first_packing_of_a_decompression(tmp_path):
    """The first minimisation has no work; after it the box has a constant pressure."""
    s = pack(tmp_path / "run", pressure=1e-3).series
    assert s["work"][0] == s["dissipated"][0] == s["relaxed"][0] == 0
    assert s["work"][1] == pytest.approx(-1e-2 * (s["volume"][1] - s["volume"][0]), rel=1e-4)
    assert s["dissipated"][1] == pytest.approx(s["relaxed"][1], rel=1e-5) and s["relaxed"][1] > 1
    still = pack(tmp_path / "still", path="quench", fraction=0.9).series
    assert still["work"][1] == 0 and still["dissipated"][1] == still["relaxed"][1] == still["energy"][0] - still["energy"][1]


@pytest.mark.parametrize("options", [{"path": "compress", "fraction": 0.8, "fraction_step": 2e-3, "pressure": 1e-2},
                                     {"pressure": 1e-4, "steps_per_decade": 8}], ids=str)
def test_energy_budget_of_changes_of_volume(options, tmp_path):
    """Centres follow the box of a compression before the minimisation. The energy that packings lose is the work less the
    change of the energy. Minimisations remove at least this energy."""
    run = pack(tmp_path / "run", **options)
    s, sigma, compresses = run.series, run.topology["sigma"], "path" in options
    for k in range(1, len(run.frames) - 1):
        before, after = run.frames[k]["box"], run.frames[k + 1]["box"]
        factor = (after[1] / before[1])[0]
        constant = not compresses or k == len(run.frames) - 2  # the last step of a compression has a constant pressure
        affine = before[0] + (run.frames[k]["centres"] - before[0]) * (1 if constant else factor)
        edges = lattice(before if constant else after)
        relaxed = energy_of(affine, sigma, edges) - s["energy"][k + 1]
        if constant:
            relaxed -= s["pressure"][k + 1] * (s["volume"][k + 1] - s["volume"][k])
        assert s["relaxed"][k + 1] - s["relaxed"][k] == pytest.approx(relaxed, rel=1e-4, abs=1e-12) and relaxed > -1e-15
    work = -(s["pressure"][1:] + s["pressure"][:-1]) / 2 * np.diff(s["volume"])
    assert np.diff(s["work"])[1:] == pytest.approx(work[1:], rel=1e-9)
    assert s["work"] - s["dissipated"] == pytest.approx(s["energy"] - s["energy"][0], rel=1e-12)
    assert (np.diff(s["dissipated"]) <= np.diff(s["relaxed"]) * (1 + 1e-9)).all()


def test_dissipation_does_not_depend_on_the_strain_step(tmp_path):
    """Rearrangements dissipate the same energy in steps of any size, up to the error of the trapezoidal rule: in a step below V Δσ Δγ
    with the largest Δσ of all steps. With shorter steps the energy that minimisations remove decreases to the same value."""
    coarse, fine = (shear(tmp_path / str(step), n=64, strain=0.2, strain_step=step).series for step in (1e-3, 2e-4))
    lost = [s["dissipated"][-1] - s["dissipated"][1] for s in (coarse, fine)]
    relaxed = [s["relaxed"][-1] - s["relaxed"][1] for s in (coarse, fine)]
    assert coarse["energy"][-1] == pytest.approx(fine["energy"][-1], rel=1e-6)  # the same packing
    assert lost[0] == pytest.approx(lost[1], rel=0.03) and lost[1] > 2e-3
    assert relaxed[0] > 1.5 * lost[0] and lost[1] < relaxed[1] < 1.2 * lost[1]
    for s in (coarse, fine):
        error = s["volume"][1:-1] * np.abs(np.diff(s["shear_stress"][1:]) * np.diff(s["strain"][1:]))
        assert np.diff(s["dissipated"][1:]).min() > -error.max()
        assert (np.diff(s["relaxed"]) > 0).all()


def test_a_small_cycle_of_shear_dissipates_nothing(tmp_path):
    """In a strain of 4e-5 no contact changes: the work of a cycle returns, and its error falls with the square of the step."""
    errors = []
    for step in (2e-5, 1e-5):
        s = shear(tmp_path / str(step), strain=4e-5, strain_step=step, cycles=1).series
        lost = s["dissipated"][1:] - s["dissipated"][1]
        assert s["energy"][-1] == pytest.approx(s["energy"][1], rel=1e-9)
        errors.append(np.abs(lost).max() / np.ptp(s["work"][1:]))
    assert errors[0] < 1e-6, errors


def test_modulus_from_small_strains_is_that_of_linear_response(tmp_path):
    """Stress against strain over a window of 4e-6, in which no contact changes."""
    run = shear(tmp_path / "run", strain=4e-6, strain_step=2e-6, moduli="yes").series
    slope = (run["shear_stress"][3] - run["shear_stress"][1]) / 4e-6
    assert slope == pytest.approx(run["shear_modulus_xy"][2], rel=1e-5) and slope > 0.01


def test_shear_at_constant_pressure_and_beyond_the_box(tmp_path):
    run = shear(tmp_path / "run", n=16, control="pressure", strain=1.3, strain_step=0.02)
    assert run.series["pressure"][1:] == pytest.approx(1e-2, rel=1e-3)
    assert run.frames[-1]["box"][2, 0] / run.frames[-1]["box"][1, 1] == pytest.approx(1.3)
    assert run.summary["strain"] == pytest.approx(1.3) and run.summary["ended_by"] == "strain"


def test_restart_of_shear_to_a_larger_strain(tmp_path):
    whole = shear(tmp_path / "whole", strain=0.02, strain_step=2e-3)
    shear(tmp_path / "part", strain=0.01, strain_step=2e-3)
    result = pliant("shear", restart=tmp_path / "part", strain=0.02)
    assert result.returncode == 0, result.stderr
    assert_same_runs(whole, Results(tmp_path / "part"))


@pytest.mark.ranks
def test_ranks_are_refused(tmp_path):
    result = subprocess.run(["mpiexec", "--oversubscribe", "-n", "2", PROGRAM, "pack", "-output", tmp_path / "run"],
                            encoding="utf-8", capture_output=True, env=mpi_environment())
    assert result.returncode != 0 and "start the program without mpiexec" in result.stderr
