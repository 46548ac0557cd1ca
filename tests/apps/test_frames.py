"""Content of frames: fields, precision, compression, reinsertions, contacts with walls, and their cost."""

import fnmatch
import json

import h5py
import numpy as np
import pytest
from conftest import SMALL, Results, hopper, pliant, same
from test_parallel import needs_mpi, on_ranks

OPTIONAL = {"velocities", "reinsertions", "contact_count", "contacts", "wall_contacts", "wall_force"}  # with disks
ALWAYS = {"positions", "centres", "active"}


def fields(frame):
    """Names of the datasets of a frame, a group by its name."""
    return {name.split("/")[0] for name in frame} - {"xdmf", "time", "step"}


@pytest.fixture(scope="module")
def default(tmp_path_factory):
    return hopper(tmp_path_factory.mktemp("frames") / "default")


@pytest.mark.parametrize("names", ["positions", "velocities", "contacts,reinsertions", "wall_contacts, contact_count"])
def test_fields_that_are_chosen(names, default, tmp_path):
    run = hopper(tmp_path / "run", frame_fields=names)
    chosen = {name.strip() for name in names.split(",")} - {"positions"}
    assert fields(default.frames[0]) == ALWAYS | OPTIONAL
    for frame, whole in zip(run.frames, default.frames):
        assert fields(frame) == ALWAYS | chosen
        assert all(same(frame[name], whole[name]) for name in frame if not name.startswith("xdmf"))
    # Nothing else depends on it.
    assert all(same(run.series[name], default.series[name]) for name in run.series)
    assert run.counters() == default.counters()


def test_a_restart_goes_on_with_other_frames(default, tmp_path):
    hopper(tmp_path / "run", t_end=3, frame_fields="positions", frame_precision="single", frame_deflate=3)
    result = pliant("hopper", "-restart", tmp_path / "run", t_end=6, frame_fields="velocities,reinsertions",
                    frame_precision="double", frame_deflate=0)
    assert result.returncode == 0, result.stderr
    run = Results(tmp_path / "run")
    assert len(run.frames) == len(default.frames)
    for frame, whole in zip(run.frames, default.frames):
        later = frame["time"] > 3.01
        assert fields(frame) == ALWAYS | ({"velocities", "reinsertions"} if later else set())
        assert frame["positions"].dtype == ("f8" if later else "f4")
        assert same(frame["positions"], whole["positions"].astype(frame["positions"].dtype))
    assert same(run.frames[-1]["reinsertions"], default.frames[-1]["reinsertions"])


@pytest.mark.parametrize("options, words", [
    ({"frame_fields": "velocities,speed"}, ["'speed'", "velocities, angles, spins", "wall_contacts"]),
    ({"frame_fields": "velocities,"}, ["''"]),
    ({"frame_fields": "spins"}, ["no spins", "do not rotate"]),
    ({"frame_fields": "area"}, ["no area", "not polygons"]),
    ({"frame_fields": "reinsertions", "flow": "discharge"}, ["no reinsertions", "never reinserted"]),
    ({"frame_precision": "half"}, ["half", "single"]),
    ({"frame_deflate": 10}, ["10", "9"]),
])
def test_wrong_choices(options, words, tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **{**SMALL, **options})
    assert result.returncode == 2 and not (tmp_path / "run").exists()
    line, = result.stderr.splitlines()
    assert all(word in line for word in words), line


def test_precision_and_compression(default, tmp_path):
    size = {}
    for name, options in {"double": {}, "single": {"frame_precision": "single"}, "deflate": {"frame_deflate": 6}}.items():
        run = hopper(tmp_path / name, **options)
        size[name] = (tmp_path / name / "run.h5").stat().st_size
        for frame, whole in zip(run.frames, default.frames):
            for dataset, values in frame.items():
                expected = np.asarray(whole[dataset])
                if name == "single" and np.asarray(values).dtype == np.float32:
                    expected = expected.astype(np.float32)
                assert same(values, expected), dataset
    assert size["single"] < size["double"]


@needs_mpi
def test_ranks_compress_what_they_write(tmp_path):
    runs = []
    for deflate in (0, 6):
        options = {**SMALL, "t_end": 1, "frame_deflate": deflate}
        assert on_ranks(2, "hopper", output=tmp_path / str(deflate), **options).returncode == 0
        runs.append(Results(tmp_path / str(deflate)))
    for one, other in zip(*(run.frames for run in runs)):
        assert one.keys() == other.keys() and all(same(one[name], other[name]) for name in one)
    assert runs[0].frames[-1]["reinsertions"].sum() == runs[1].frames[-1]["reinsertions"].sum()


def check_reinsertions(run):
    """A particle has jumped up between two frames exactly where its counter has grown."""
    centres, counts = run.column("centres"), run.column("reinsertions")
    assert counts.dtype == np.int32 and not counts[0].any() and (np.diff(counts, axis=0) >= 0).all()
    jumped = np.diff(centres[:, :, -1], axis=0) > 3
    assert jumped.sum() > 10 and (np.diff(counts, axis=0)[jumped] > 0).all()
    rose = (np.diff(counts, axis=0) > 0) & ~jumped
    assert rose.sum() < 0.1 * jumped.sum()  # reinserted particles that have fallen since


def test_reinsertions_are_counted(default):
    check_reinsertions(default)


@needs_mpi
def test_reinsertions_are_counted_on_ranks(tmp_path):
    """Particles migrate between ranks; a restart on another number of ranks continues the counts."""
    options = {**SMALL, "t_end": 3}
    assert on_ranks(3, "hopper", output=tmp_path / "run", **options).returncode == 0
    assert on_ranks(2, "hopper", "-restart", tmp_path / "run", t_end=12).returncode == 0
    check_reinsertions(Results(tmp_path / "run"))


KINDS = {
    "soft": {},
    "flat": {"hopper_angle": 60, "obstacle": "disk:0,5,0.8"},
    "spheres": {"dim": 3, "n": 120, "hopper_wall_distance": 5, "hopper_width": 3.5, "pack_fraction": 0.5, "t_end": 2},
    "rough": {"model": "rough", "n": 20, "hopper_wall_distance": 6, "hopper_width": 0.5, "t_end": 3},
    "disks": {"model": "disk", "seed": 2, "mu_disk_dynamic": 0.4, "mu_wall_dynamic": 0.4, "mu": None, "zeta": None, "t_end": 1},
}


@pytest.mark.parametrize("kind", KINDS)
def test_contacts_with_walls_add_up(kind, tmp_path):
    run = changed(tmp_path / "run", **KINDS[kind])
    found = 0
    for frame in run.frames:
        walls = np.zeros_like(frame["wall_force"])
        np.add.at(walls, frame["wall_contacts/wall"], frame["wall_contacts/force"])
        scale = np.abs(frame["wall_force"]).max()
        assert walls == pytest.approx(-frame["wall_force"], rel=1e-9, abs=1e-12 * max(scale, 1))
        normal, force = frame["wall_contacts/normal"], frame["wall_contacts/force"]
        assert np.linalg.norm(normal, axis=1) == pytest.approx(1)
        assert (frame["wall_contacts/overlap"] > 0).all() and ((normal * force).sum(1) > 0).all()
        particle = frame["wall_contacts/particle"]
        assert (np.diff(particle) >= 0).all() and frame["active"][particle].all()
        reach = run.topology["sigma"][particle]
        assert (np.linalg.norm(frame["wall_contacts/position"] - frame["centres"][particle], axis=1) < reach).all()
        found += len(particle)
    assert found > 4


def changed(folder, **options):
    """The small hopper with some options changed, or left out: None."""
    options = {**SMALL, **options}
    result = pliant("hopper", output=folder, **{name: value for name, value in options.items() if value is not None})
    assert result.returncode == 0, result.stderr
    return Results(folder)


@pytest.mark.parametrize("model", ({"mu": 3}, {"model": "rough", "n": 20, "hopper_wall_distance": 6, "hopper_width": 0.5, "mu": 3,
                                               "t_end": 3}, {"model": "disk", "mu": None, "zeta": None}),
                         ids=("soft", "rough", "frictional"))
def test_frames_contain_friction_and_change_nothing(model, tmp_path):
    runs = [changed(tmp_path / str(interval), **{"t_end": 1, **model, "frame_interval": interval}) for interval in (0.05, 1)]
    last = [run.frames[-1] for run in runs]
    assert all(np.array_equal(*(frame[name] for frame in last)) for name in ("positions", "velocities"))
    found = 0
    for frame in runs[0].frames:
        normal, friction = frame["contacts/normal"], frame["contacts/friction"]
        elastic = frame["contacts/force"] - friction
        along = (elastic * normal).sum(1)
        assert (along > -1e-9).all() and np.abs(elastic - along[:, None] * normal).max(initial=0) < 1e-9
        found += (np.linalg.norm(friction, axis=1) > 1e-6).sum()
    assert found > 10


def test_frames_without_friction_store_no_zeros(tmp_path):
    hopper(tmp_path / "run", t_end=0.5, mu=0)
    with h5py.File(tmp_path / "run/run.h5") as file:
        for frame in file["frames"].values():
            for group in ("contacts", "wall_contacts"):
                friction = frame[group]["friction"]
                assert friction.shape == frame[group]["force"].shape and not friction[()].any()
                assert friction.id.get_storage_size() == 0


def test_bytes_per_particle(tmp_path):
    """Size of a frame of frictional disks with few contacts: two vectors, angle, spin, and flags; nothing for
    ParaView."""
    def per_disk(**options):
        size = []
        for end in (0.02, 0.1):
            folder = tmp_path / f"{len(list(tmp_path.iterdir()))}"
            result = pliant("hopper", output=folder, model="disk", n=1600, hopper_wall_distance=30, hopper_width=6, t_end=end,
                            frame_interval=0.02, sample_interval=10, **options)
            assert result.returncode == 0, result.stderr
            size.append((folder / "run.h5").stat().st_size)
        return (size[1] - size[0]) / 4 / 1600

    assert per_disk() < 85
    assert per_disk(frame_fields="velocities,spins", frame_precision="single") < 26


SHORT = {"hopper": SMALL | {"t_end": 1}, "hopper -model disk": {name: value for name, value in SMALL.items() if name != "mu"} | {"t_end": 1},
         "hopper -model rough": SMALL | {"n": 20, "t_end": 0.5}, "raft": {"rows": 2, "columns": 3, "end_distance": 3.5},
         "clog": {"n": 20, "t_end": 5}, "channel": {"pushes": 1, "stroke": 0.1}}


@pytest.mark.parametrize("command", SHORT)
def test_every_dataset_has_units_and_a_description(command, tmp_path):
    pliant(*command.split(), output=tmp_path / "run", **SHORT[command])
    with h5py.File(tmp_path / "run/run.h5") as file:
        table = json.loads(file["manifest/datasets"][()])
        found = []
        file.visititems(lambda path, item: found.append(path) if isinstance(item, h5py.Dataset) else None)
    assert any(path.startswith("frames/") for path in found) and any(path.startswith("series/") for path in found)
    assert [path for path in found if not any(fnmatch.fnmatchcase(path, pattern) for pattern in table)] == []
    assert all(set(entry) == {"units", "description"} and entry["description"] for entry in table.values())
    assert table["series/time"]["units"] == ("s" if command == "channel" else "t0")
