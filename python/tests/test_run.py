"""The reader returns the written data, from whole, unfinished and broken runs."""

import json
import os
import re
import shutil
import subprocess
import sys
import warnings
import zlib
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from synthetic import VERTICES, write_run

from pliant import PliantWarning, Run, RunError, analysis, load_runs, load_table, plotting, sweep, sweep_jobs, sweep_rows, sweep_table
from pliant.run import FRAME_FIELDS, ModeEnergies
from pliant.symbols import model_name

HERE = Path(__file__).resolve().parent


@pytest.mark.parametrize("model", ["soft", "rough", "smooth", "soft3d"])
def test_round_trip(model, request):
    path, truth = request.getfixturevalue(model)
    with Run(path) as run:
        assert run.model == {"soft": "sp", "soft3d": "sp"}.get(model, model)
        assert run.dim == (3 if model == "soft3d" else 2)
        assert run.manifest["scenario"] == "hopper"
        assert run.options["mu"] == 1.0 and run.manifest["options"]["hopper_width"]["unit"] == "sigma_avg"
        assert_array_equal(run.topology.sigma, truth["sigma"])
        assert run.topology.particles == len(truth["sigma"])
        assert run.topology.deformable == (model in ("rough", "smooth"))
        assert run.geometry.w == 4.0 and run.geometry.orifice_height == 0.0
        assert len(run.frames) == 3
        assert_allclose(run.frames.times, truth["frame_time"])
        for i, frame in enumerate(run.frames):
            assert frame.time == truth["frame_time"][i] and frame.step == 500 * i
            assert_array_equal(frame.centres, truth["centres"][i])
            assert_array_equal(np.concatenate(frame.polygons), truth["positions"][i])
            assert len(frame.polygons) == run.topology.particles
            assert frame.active[0] == (i == 0) and frame.active[1:].all()
            assert_array_equal(frame.contacts[["particle_1", "particle_2"]], truth["contacts"][i]["particles"])
            assert_array_equal(frame.contacts["wall"], truth["contacts"][i]["wall"])
            assert_array_equal(frame.wall_contacts, frame.contacts.query("wall >= 0"))
            assert_array_equal(frame.contacts[["nx", "ny"]], truth["contacts"][i]["normal"][:, :2])
            assert_allclose(frame.contacts["force"], np.linalg.norm(truth["contacts"][i]["force"], axis=1))
            assert_array_equal(frame.contacts[["friction_x", "friction_y"]], truth["contacts"][i]["friction"][:, :2])
            assert not frame.elastic_contacts
        for name, values in truth["series"].items():
            if values.ndim == 1:
                assert_array_equal(run.series[name], values)
        assert "profile_weight" not in run.series
        assert_array_equal(run.profile.momentum, truth["series"]["profile_momentum"])
        assert_array_equal(run.profile.height, truth["heights"])
        assert run.measured("Q") == (3.0, 0.1) and run.steady_start == 20.0
        assert np.isnan(run.measured("ns_per_vertex_step")).all()
        assert np.isnan(run.measured("c0")).all()  # only discharges have c0
        for name, words in (("q", "did you mean Q?"), ("q_corected", "did you mean Q_corrected?"), ("xyz", "it has ")):
            with pytest.raises(RunError, match=re.escape(words)):
                run.measured(name)
        with pytest.raises(RunError, match="'status' in summary.json is not a number"):
            run.measured("status")


def test_frames_are_a_sequence(soft):
    run = Run(soft[0])
    assert [f.step for f in run.frames[1:]] == [500, 1000]
    assert run.frames[-1].step == run.frames[2].step == 1000
    assert [f.step for f in reversed(run.frames)] == [1000, 500, 0]
    with pytest.raises(IndexError):
        run.frames[3]
    with pytest.raises(RunError, match="no frame 3, the run has 3"):
        run.frame(3)


def test_polygons(rough):
    run = Run(rough[0])
    frame = run.frames[0]
    assert all(p.shape == (VERTICES, 2) for p in frame.polygons)
    assert_allclose([p.mean(0) for p in frame.polygons], frame.centres, atol=1e-12)
    # The area from the vertices read, by another formula than the writer's: a fan of triangles about the centre.
    fan = [sum(np.cross(p[i - 1] - c, p[i] - c) for i in range(VERTICES)) / 2
           for p, c in zip(frame.polygons, frame.centres)]
    assert_allclose(frame.area, fan)
    assert_allclose(run.topology.particle_diameter, run.topology.l0)
    expected = frame.velocities.reshape(-1, VERTICES, 2).mean(1)
    assert_allclose(frame.particle_velocities, expected)
    assert_allclose(frame.speeds, np.hypot(*expected.T))


def test_an_open_box_has_no_images(soft):
    run = Run(soft[0])
    frame = run.frames[0]
    assert run.geometry.box is None
    assert not frame.images.any() and frame.images.shape == frame.centres.shape
    assert_array_equal(frame.unwrapped_centres, frame.centres)
    assert_array_equal(run.geometry.nearest_image([[30.0, -50.0]]), [[30.0, -50.0]])


def test_a_periodic_box(tmp_path):
    write_run(tmp_path / "run", n=20)
    with h5py.File(tmp_path / "run" / "run.h5", "a") as file:
        file["geometry/box"] = [[-7.0, 0.0], [14.0, np.inf]]
        file["frames/000000/images"] = np.tile([[2, 0]], (20, 1))
    run = Run(tmp_path / "run")
    assert_allclose(run.geometry.nearest_image([[9.0, 50.0], [-8.0, -3.0]]), [[-5.0, 50.0], [6.0, -3.0]])
    frame = run.frames[0]
    assert_allclose(frame.unwrapped_centres, frame.centres + [28.0, 0.0])
    with pytest.raises(RunError, match="no 'images'"):
        run.frames[1].images


def test_touching_particles_count_once(rough):
    """For any number of vertices in contact; `contact_count` has the pairs of the file."""
    frame = Run(rough[0]).frames[0]
    once = frame.touching
    pairs = frame.contacts.query("particle_2 >= 0")
    assert once.sum() == 2 * len(pairs) and once[pairs["particle_1"].iloc[0]] > 0
    again = pairs.iloc[:1].copy()
    again[["particle_1", "particle_2"]] = again[["particle_2", "particle_1"]].to_numpy()
    more = Run(rough[0]).frames[0]
    more.contacts = pd.concat([frame.contacts, pairs.iloc[:1], again], ignore_index=True)
    assert_array_equal(more.touching, once)


def test_displacements_leave_out_what_jumped(tmp_path):
    path, truth = write_run(tmp_path / "run", n=20)
    run = Run(path)
    first, last = run.frames[0], run.frames[2]
    assert_array_equal(last.reinsertions, np.arange(20) % 3)
    moved = last.displacements(first)
    stayed = np.arange(20) % 3 == 0
    stayed[0] = False  # has left
    assert_allclose(moved[stayed], (truth["centres"][2] - truth["centres"][0])[stayed])
    assert np.isnan(moved[~stayed]).all()
    with h5py.File(path / "run.h5", "a") as file:
        del file["frames/000001/reinsertions"]
    with pytest.raises(RunError, match="no 'reinsertions'.*-frame_fields reinsertions"):
        Run(path).frames[1].displacements(first)
    with h5py.File(path / "run.h5", "a") as file:
        options = json.loads(file["manifest"].attrs["options"])
        options["flow"] = {"value": "discharge", "unit": "", "source": "command line"}
        file["manifest"].attrs["options"] = json.dumps(options)
    assert not Run(path).frames[1].reinsertions.any()  # a discharge has no reinsertions


@pytest.mark.parametrize("mu", (1.0, 0.0))
def test_older_frames_have_elastic_forces_only(mu, tmp_path):
    write_run(tmp_path, mu=mu, n=20)
    with h5py.File(tmp_path / "run.h5", "a") as file:
        for group in ("contacts", "wall_contacts"):
            del file[f"frames/000001/{group}/friction"]
    new, older = Run(tmp_path).frames[:2]
    assert not new.elastic_contacts and older.elastic_contacts
    assert older.contacts["force"].notna().all() and older.contacts[["friction_x", "friction_y"]].isna().all(axis=None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        analysis.particle_stress(new if mu > 0 else older)
    if mu > 0:
        with pytest.warns(PliantWarning, match="at time 0.5; forces between particles are elastic, without friction"):
            analysis.particle_stress(older)


@pytest.mark.parametrize("field", FRAME_FIELDS)
def test_a_field_that_is_missing_names_the_option(field, rough, tmp_path):
    path = tmp_path / "run"
    shutil.copytree(rough[0], path)
    with h5py.File(path / "run.h5", "a") as file:
        if field in file["frames/000001"]:
            del file[f"frames/000001/{field}"]
    frame = Run(path).frames[1]
    if field == "angles":
        assert frame.angles is None
        return
    with pytest.raises(RunError, match=f"frame 000001 has no '{field}.*; -frame_fields {field} writes it"):
        getattr(frame, field)
    frame.centres, frame.polygons, frame.active, Run(path).frames[0].contacts


def test_single_precision_is_read_as_double(tmp_path):
    path, truth = write_run(tmp_path / "run", n=20)
    with h5py.File(path / "run.h5", "a") as file:
        group = file["frames/000000"]
        for name in ("positions", "velocities", "centres", "contacts/force", "wall_contacts/overlap"):
            values = group[name][()].astype(np.float32)
            del group[name]
            group.create_dataset(name, data=values, compression=4, chunks=values.shape)
            group[name].attrs["crc32"] = np.uint32(zlib.crc32(values))
    frame = Run(path).frames[0]
    for values in (frame.positions, frame.velocities, frame.centres, frame.contacts["fx"], frame.wall_contacts["overlap"]):
        assert values.dtype == np.float64
    assert_array_equal(frame.centres, truth["centres"][0].astype(np.float32))


def test_soft_particles_have_no_area(soft):
    with pytest.raises(RunError, match="no 'area'"):
        Run(soft[0]).frames[0].area


def test_killed_run_is_read_up_to_its_last_whole_frame(tmp_path):
    # A process that flushes and dies without closing the file.
    code = f"import os, sys; sys.path.insert(0, {str(HERE)!r}); from synthetic import write_run; " \
           f"write_run({str(tmp_path / 'run')!r}, frames=2, summary=False, close=False); os._exit(9)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 9
    with Run(tmp_path / "run") as run:
        assert len(run.frames) == 2 and len(run.frames[-1].contacts) > 0
        assert run.summary == {} and run.steady_start is None and np.isnan(run.measured("Q")).all()
        assert sweep_table([run])["status"][0] == "unfinished"
    with h5py.File(tmp_path / "run/run.h5", "a") as file:
        del file["frames/000001/active"]
        time = file["series/time"][:-3]
        del file["series/time"]
        file["series/time"] = time
    with Run(tmp_path / "run") as run:
        assert len(run.frames) == 1
        assert len(run.series) == len(time) == len(run.profile.weight)


def test_run_that_another_process_writes_can_be_read(tmp_path):
    path, _ = write_run(tmp_path / "run")
    with h5py.File(path / "run.h5", "a"):
        code = f"import sys; sys.path.insert(0, {str(HERE.parent)!r}); from pliant import Run; " \
               f"print(len(Run({str(path)!r}).frames))"
        assert subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8").stdout == "3\n"


def test_an_attribute_that_is_no_number_is_damage(tmp_path):
    path, _ = write_run(tmp_path / "run", n=20)
    with h5py.File(path / "run.h5", "a") as file:
        file["frames/000001"].attrs["time"] = "soon"
        file["frames/000002/positions"].attrs["crc32"] = "soon"
        del file["frames/000000"].attrs["step"]
    run = Run(path)
    assert run.frames[0].step == -1
    with pytest.raises(RunError, match="the attribute 'time' of /frames/000001 is damaged"):
        run.frames[1]
    with pytest.raises(RunError, match="the attribute 'crc32' of /frames/000002/positions is damaged"):
        run.frames[2].positions


def test_errors(tmp_path):
    def message(path):
        with pytest.raises(RunError) as error:
            Run(path)
        assert "\n" not in str(error.value) and str(path) in str(error.value)
        return str(error.value)

    assert "no such folder" in message(tmp_path / "missing")
    assert "no run.h5" in message(tmp_path)
    (tmp_path / "run.h5").write_text("not HDF5", encoding="utf-8")
    assert "cannot be read" in message(tmp_path)
    assert "not a folder" in message(tmp_path / "run.h5")
    os.remove(tmp_path / "run.h5")
    h5py.File(tmp_path / "run.h5", "w").close()
    assert "no /manifest" in message(tmp_path)

    path, _ = write_run(tmp_path / "empty", frames=0)
    run = Run(path)
    assert len(run.frames) == 0 and list(run.frames) == []
    with pytest.raises(RunError, match="no frames"):
        run.frame(-1)
    (path / "summary.json").write_text("{", encoding="utf-8")
    with pytest.raises(RunError, match="not JSON"):
        Run(path).summary


def test_sweep_table(sweep):
    runs = load_runs([sweep])
    table = sweep_table(runs)
    assert len(table) == len(runs) == 12
    assert table.equals(sweep_table([sweep]))
    for one in (sweep, str(sweep)):
        assert [run.path for run in load_runs(one)] == [run.path for run in runs] and table.equals(sweep_table(one))
    assert sweep_table(runs[3]).equals(sweep_table(runs[3:4]))
    with pytest.raises(RunError, match=f"{sweep}/none"):
        load_runs(f"{sweep}/none")
    drag = table[table["zeta"] > 0].sort_values("hopper_width")
    assert list(drag["status"]) == ["clogged"] + 5 * ["done"]
    assert_allclose(drag["Q"], 0.42 * np.sqrt(np.maximum(drag["hopper_width"] - 3.4, 0)))
    assert_allclose(drag["Q_error"][1:], 0.02 * drag["Q"][1:])
    assert np.isnan(drag["Q_error"].iloc[0])
    assert set(table["model"]) == {"sp"} and set(table["dim"]) == {2}


def test_results_with_the_name_of_an_option(tmp_path):
    path, _ = write_run(tmp_path / "run", frames=1, extra={"pressure": (1e-3, "eps/sigma_avg^2"), "travel": (0.1, "cm"), "dt": (None, "t0")})
    summary = json.loads((path / "summary.json").read_text(encoding="utf-8"))
    summary |= {"pressure": 0.00099, "travel": {"value": 0.11, "error": 0.02, "unit": "cm"}, "dt": 5e-4}
    (path / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    row = sweep_table([path]).iloc[0]
    assert (row["pressure"], row["pressure_result"]) == (1e-3, 0.00099)
    assert (row["travel"], row["travel_result"], row["travel_result_error"]) == (0.1, 0.11, 0.02)
    assert row["dt"] == 5e-4 and not {"dt_result", "travel_error"} & set(row.index)
    state = sweep_jobs.State("done", "done")
    _, units = sweep.results_tables([(sweep_rows.Row(1, 2, "hopper", {}, "a"), path, state)])
    units = dict(zip(units["column"], units["unit"], strict=True))
    assert units["pressure"] == units["pressure_result"] == "eps/sigma_avg^2" and units["travel_result_error"] == "cm"


def test_table_from_csv(tmp_path):
    (tmp_path / "a.csv").write_text("w,Q\n3,1\n4,2\n", encoding="utf-8")
    table = load_table(tmp_path / "a.csv")
    assert list(table["hopper_width"]) == [3, 4] and table["Q_error"].isna().all()
    (tmp_path / "b.csv").write_text("w,rate\n3,1\n", encoding="utf-8")
    with pytest.raises(RunError, match="no column 'Q'"):
        load_table(tmp_path / "b.csv")
    (tmp_path / "c.csv").write_text("w,Q\n3,x\n", encoding="utf-8")
    with pytest.raises(RunError, match="'Q' holds something"):
        load_table(tmp_path / "c.csv")
    (tmp_path / "d.csv").write_text("", encoding="utf-8")
    with pytest.raises(RunError, match="cannot be read"):
        load_table(tmp_path / "d.csv")


@pytest.mark.parametrize("part", ["frames/000000", "frames/000001", "frames/000002", "series/time", "series/kinetic_energy"])
def test_a_part_that_is_missing_is_an_error(part, tmp_path):
    """The program counts frames and columns; a file from which one has vanished is damaged."""
    path, _ = write_run(tmp_path / "run")
    with h5py.File(path / "run.h5", "r+") as file:
        for group in ("frames", "series"):
            file[group].attrs["members"] = len(file[group])
        del file[part]
    with pytest.raises(RunError, match="members|frames are missing"):
        run = Run(path)
        assert len(run.frames) == 3 and "time" in run.series


def test_datasets_have_units_and_descriptions(tmp_path, soft):
    path, _ = write_run(tmp_path / "run", n=20)
    with Run(path) as run, pytest.raises(RunError, match="run.h5 does not describe series/heat"):
        run.describe("series/heat")
    table = {"frames/*/spins": {"units": "1/t0", "description": "angular velocity"},
             "series/energy": {"units": "E", "description": "total"}, "series/*_energy": {"units": "E", "description": "part"}}
    with h5py.File(path / "run.h5", "r+") as file:
        file["manifest/datasets"] = np.bytes_(json.dumps(table))
    with Run(path) as run:
        assert run.describe("frames/000002/spins") == ("1/t0", "angular velocity")
        assert run.describe("/series/energy") == ("E", "total") and run.describe("series/kinetic_energy") == ("E", "part")
        with pytest.raises(RunError, match="does not describe series/dt"):
            run.describe("series/dt")


def test_names_of_particles_in_space(tmp_path):
    for model in ("rough", "smooth"):
        write_run(tmp_path / model, model, dim=3, n=30, W=9.0)
        with Run(tmp_path / model) as run:
            assert model_name(run) == f"{model} surfaces"


def test_closed_surfaces_have_faces_volumes_and_areas(tmp_path):
    write_run(tmp_path / "run", "rough", dim=3, n=30, W=9.0)
    with Run(tmp_path / "run") as run:
        topology, frame = run.topology, run.frame(-1)
        assert topology.faces.shape == (600, 3) and topology.face_offset[-1] == 600 and topology.deformable
        radius = topology.sigma / 2
        assert_allclose(frame.content, 2.53615 * radius**3, rtol=1e-5)  # icosahedron in a sphere of this radius
        assert_allclose(frame.surface_area, 9.57454 * radius**2, rtol=1e-5)
        assert_allclose(frame.shape_parameter, 1.09844, rtol=1e-4)
        with pytest.raises(RunError, match="'area'"):
            frame.area


def test_a_picture_of_surfaces_shows_shaded_triangles_that_face_the_viewer(tmp_path):
    write_run(tmp_path / "run", "rough", dim=3, n=30, W=9.0)
    with Run(tmp_path / "run") as run:
        axes = plotting.draw_frame(run, -1, "area")
        triangles = max(axes.collections, key=lambda one: len(one.get_paths()))
        behind = (run.frame(-1).active & (run.frame(-1).centres[:, 1] >= 0)).sum()  # the run is cut open along its axis
        assert behind > 3 and 8 * behind <= len(triangles.get_paths()) <= 12 * behind
        assert len(np.unique(triangles.get_facecolors(), axis=0)) > 5


def test_exponents_along_modes():
    """Between the crossover and the first contact that closes the energy is quartic; a stiff mode has no crossover."""
    a = 10.0 ** np.arange(-4, 0, 0.125)
    closed = 10 * np.fmax(a - 0.03, 0) ** 2
    contacts = np.array([1e-12 / (1 + (1e3 * a) ** 2) + closed, 1e-12 + a**2])
    along = ModeEnergies(a, np.array([[1e-7 * a**2 + a**4 + closed, 3 * a**2]]), contacts[None])
    assert along.quadratic[0] == pytest.approx([1e-7 + 1e-8, 3])
    where = along.above_crossover[0]
    assert (a[where[0]] > 3e-3).all() and a[where[0]].max() == pytest.approx(a[a < 0.03].max()) and not where[1].any()
    loose, stiff = along.exponents(along.above_crossover)[0]
    assert loose == pytest.approx(4, abs=0.02) and np.isnan(stiff)
    assert along.crossover[0] == pytest.approx([1.2e-7**0.5, np.nan], rel=0.02, nan_ok=True)
    assert along.exponents(np.ones((1, 2, len(a)), bool))[0, 1] == pytest.approx(2)
    assert np.isnan(along.exponents(along.above_crossover, least=9)).all()
