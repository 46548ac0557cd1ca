"""The scenarios pack and shear with deformable particles in 3D: forces, pressure, moduli, lattice, restart, refusals."""

import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import Results, assert_same_runs, pliant

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))

#: smooth particles at the pressures of rough ones: contacts of the same stiffness
MODELS = {"rough": {}, "smooth": {"e_c": 0.05, "edge_width": 0.3}}
CUBE = "OFF\n8 12 0\n" + "".join(f"{x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1)) + "".join(
    f"3 {a} {b} {c}\n" for a, b, c in [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6),
                                       (0, 6, 4), (1, 5, 7), (1, 7, 3)])


def pack(folder, scenario="pack", **options):
    options = {"dim": 3, "n": 6, "n_vertices": 12, "pressure": 0.02, "start_pressure": 0.02, **options}
    result = pliant(scenario, output=folder, **{name: value for name, value in options.items() if value is not None})
    assert result.returncode == 0, result.stderr
    return Results(folder)


@pytest.fixture(scope="module")
def packings(tmp_path_factory):
    """A packing of each model, with moduli."""
    return {model: pack(tmp_path_factory.mktemp(model) / "run", model=model, moduli="yes", seed=3, **options)
            for model, options in MODELS.items()}


def volumes(positions, faces):
    a, b, c = (positions[faces[:, k]] for k in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).reshape(-1, 20).sum(1) / 6


@pytest.mark.parametrize("model", MODELS)
def test_a_packing_at_a_pressure(model, packings):
    run = packings[model]
    s, series = run.summary, run.series
    assert s["pressure"] == pytest.approx(0.02, rel=1e-4) and s["max_force"] <= 1.1e-12 and s["ended_by"] == "pressure"
    frame = run.frames[-1]
    assert frame["particle_stress"].sum(0) == pytest.approx(series["stress"][-1], rel=1e-9, abs=1e-12)
    length = frame["box"][1]
    assert series["volume"][-1] == pytest.approx(length.prod()) and (frame["box"][2] == 0).all()
    faces = run.topology["faces"]
    own = volumes(frame["positions"], faces)
    assert own == pytest.approx(frame["volume"], rel=1e-9)
    assert s["fraction"] == pytest.approx(own.sum() / length.prod(), rel=1e-9) and s["fraction"] < s["rim_fraction"]
    assert s["backbone"] + s["rattlers"] == 6 and s["touching_pairs"] > 8 and s["contacts"] >= 4 * s["backbone"] / 2


@pytest.mark.parametrize("model", MODELS)
def test_moduli_are_the_response_to_pressure(model, packings, tmp_path):
    """−V ∂p/∂V between two packings whose pressures differ by a part of 5e-5."""
    before = packings[model]
    after = pack(tmp_path / "run", model=model, moduli="yes", seed=3, pressure=0.019999, **MODELS[model])
    p0, p1 = (run.summary["pressure"] for run in (before, after))
    v0, v1 = (run.series["volume"][-1] for run in (before, after))
    assert before.summary["contacts"] == after.summary["contacts"]
    slope = -(v0 + v1) / 2 * (p1 - p0) / (v1 - v0)
    assert slope == pytest.approx((before.summary["bulk_modulus"] + after.summary["bulk_modulus"]) / 2, rel=2e-3)
    assert before.summary["bulk_modulus"] > before.summary["shear_modulus"]


@pytest.mark.parametrize("model", MODELS)
def test_work_of_shear(model, tmp_path):
    """dU = V σ_xy dγ at constant volume while no contacts change."""
    run = pack(tmp_path / "run", "shear", model=model, strain=2e-3, strain_step=2e-4, **MODELS[model]).series
    sheared = slice(1, None)
    stress, energy = (run[name][sheared] for name in ("shear_stress", "energy"))
    work = run["volume"][-1] * (stress[1:] + stress[:-1]) / 2 * 2e-4
    assert np.median(np.abs(np.diff(energy) - work) / np.abs(work)) < 1e-3
    assert np.ptp(run["volume"][sheared]) < 1e-9 and np.abs(stress).max() > 1e-4


def test_steady_shear_conserves_energy(tmp_path):
    s = pack(tmp_path / "run", "shear", model="rough", shear_rate=0.1, strain=0.5, drag="per_mass")
    assert s.summary["strain"] == pytest.approx(0.5, rel=1e-2) and abs(s.summary["energy_audit"]["relative_error"]) < 0.01
    assert np.abs(s.series["momentum"]).max() < 1e-6


def test_shapes_of_a_mesh(tmp_path):
    (tmp_path / "cube.off").write_text(CUBE, encoding="utf-8")
    run = pack(tmp_path / "run", model="smooth", mesh=tmp_path / "cube.off", rest_angles="yes", k_b=0.1, n=4, n_vertices=None, **MODELS["smooth"])
    assert run.summary["pressure"] == pytest.approx(0.02, rel=1e-3) and len(run.frames[-1]["positions"]) == 32


def test_modes_with_and_without_pre_stress(packings, tmp_path):
    """Without pre-stress no mode is unstable; three translations have no frequency."""
    options = {"model": "rough", "seed": 3, "modes": 12}
    kept, dropped = (np.array(pack(tmp_path / name, pre_stress=name, **options).series["frequencies"][-1]) for name in ("kept", "dropped"))
    for frequencies in (kept, dropped):
        assert (np.abs(frequencies[:3]) < 1e-5).all() and frequencies[3] > 1e-4
    assert np.abs(kept - dropped).max() > 1e-4


def test_restart_goes_on_with_the_same_bits(tmp_path):
    options = {"model": "rough", "n": 4, "start_pressure": 1e-1}
    whole = pack(tmp_path / "whole", pressure=1e-2, **options)
    pack(tmp_path / "part", pressure=1e-1, **options)
    result = pliant("pack", restart=tmp_path / "part", pressure=1e-2)
    assert result.returncode == 0, result.stderr
    assert_same_runs(whole, Results(tmp_path / "part"))


@pytest.mark.parametrize("model", MODELS)
def test_contacts_that_give_way_end_the_run(model, tmp_path):
    result = pliant("pack", output=tmp_path / "run", model=model, dim=3, n=6, n_vertices=12, e_c=1e-3, pressure=0.1, start_pressure=0.1)
    assert result.returncode == 3 and "pierces face" in result.stderr and "raise -e_c or raise the stiffness" in result.stderr, result.stderr


def test_a_loose_quench_has_only_rattlers_in_their_rest_shapes(tmp_path):
    s = pack(tmp_path / "run", model="smooth", path="quench", pressure=None, start_pressure=None, size_distribution="mono").summary
    assert s["rattlers"] == 6 and s["contacts"] == 0 and abs(s["pressure"]) < 1e-12 and s["energy"] < 1e-12
    icosahedron = 0.605461  # its volume over the volume of the sphere around it
    assert 0.45 * icosahedron < s["fraction"] < 0.55 * icosahedron


@pytest.mark.parametrize("options, message", [
    ({"n_vertices": 13}, "12, 42"), ({"fraction": 1.2}, "begin with a lower fraction"), ({"n": 1, "fraction": 0.9}, "begin with a lower fraction"),
    ({"shape_parameter": 1.0}, "shape parameter"), ({"model": "smooth", "edge_width": 0.6}, "-edge_width 0.6"), ({"mesh": "none.off"}, "none.off"),
    ({"dim": 2, "n_vertices": 8, "k_v": 1}, "-k_v"), ({"area_energy": "relative"}, "-area_energy"), ({"mu": 1}, "unknown option -mu"),
    ({"max_iterations": 3}, "has not converged")])
def test_refusals(options, message, tmp_path):
    given = {"output": tmp_path / "run", "model": "rough", "dim": 3, "n": 6, "n_vertices": 12, **options}
    result = pliant("pack", **given)
    assert result.returncode == (3 if "max_iterations" in options else 2) and message in result.stderr, result.stderr
