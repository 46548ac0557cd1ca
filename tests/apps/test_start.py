"""Runs whose particles come from a file: a frame of another run, or a table."""

import json

import h5py
import numpy as np
import pytest

from conftest import SMALL, pliant

HOPPER = {"hopper_wall_distance": 8, "hopper_width": 3, "zeta": 0.3, "mu": 0.5, "t_end": 0.5, "frame_interval": 0.25}
# Options above that a model does not read.
NOT_READ = {"sp": (), "disk": ("zeta", "mu"), "smooth": ("mu",), "rough": ("mu",)}
ROW = "x,y,diameter\n-1,2,1\n1,2,1.2\n0,3.5,0.9\n"


def of_model(model, options=HOPPER):
    return {name: value for name, value in options.items() if name not in NOT_READ[model]} | {"model": model}


@pytest.fixture(scope="module")
def earlier(tmp_path_factory):
    """Runs of the models, by name."""
    folder = tmp_path_factory.mktemp("earlier")
    runs = {}
    for model in NOT_READ:
        options = SMALL | {"n": 30 if model in ("sp", "disk") else 8, "t_end": 1}
        result = pliant("hopper", output=folder / model, **of_model(model, options))
        assert result.returncode == 0, result.stderr
        runs[model] = folder / model / "run.h5"
    return runs


def started(folder, file, **options):
    return pliant("hopper", start=file, output=folder, **{**HOPPER, **options})


def refused(folder, file, **options):
    """The message, of one line; no folder is left."""
    result = started(folder / "refused", file, **options)
    assert result.returncode == 2, result.stderr
    assert result.stderr.count("\n") == 1 and not (folder / "refused" / "run.h5").exists(), result.stderr
    return result.stderr


def table(folder, text, name="table.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("model", ["sp", "disk", "smooth", "rough"])
def test_the_particles_of_a_frame(model, tmp_path, earlier):
    """The run begins with the positions, velocities, sizes, masses and rotations of the frame, to the last bit."""
    result = pliant("hopper", start=f"{earlier[model]}:1", output=tmp_path / "run", **of_model(model))
    assert result.returncode == 0, result.stderr
    with h5py.File(earlier[model]) as old, h5py.File(tmp_path / "run" / "run.h5") as new:
        frames = old["frames/000001"], new["frames/000000"]
        for name in ("positions", "velocities", "angles", "spins"):
            assert (name in frames[0]) == (name in frames[1])
            if name in frames[0]:
                np.testing.assert_array_equal(frames[1][name][()], frames[0][name][()], name)
        assert frames[1].attrs["time"] == 0 and np.abs(frames[1]["velocities"]).max() > 0
        for name in ("offset", "sigma", "a0", "l0", "mass", "diameter"):
            np.testing.assert_allclose(new["topology"][name][()], old["topology"][name][()], rtol=1e-15, err_msg=name)
        source = json.loads(bytes(new["manifest/start"][()]))
        assert source["file"] == str(earlier[model]) and source["frame"] == 1 and source["crc32"] > 0
    assert json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))["start"] == source


@pytest.mark.parametrize("dim", [2, 3])
def test_bending_at_rest_is_no_energy_of_contacts(dim, tmp_path):
    """Undeformed smooth particles have bending energy, and touch nothing in the first frame."""
    options = {"model": "smooth", "dim": dim, "hopper_wall_distance": 5, "hopper_width": 3, "k_b": 10, "t_end": 1e-3}
    assert pliant("hopper", output=tmp_path / "first", n=4, **options).returncode == 0
    result = pliant("hopper", start=f"{tmp_path / 'first/run.h5'}:0", output=tmp_path / "run", **options)
    assert result.returncode == 0 and result.stderr == "", result.stderr
    assert float(result.stdout.split("energy of contacts could lift all particles by ")[1].split()[0]) < 1e-6


def test_the_last_frame_unless_one_is_given(tmp_path, earlier):
    assert started(tmp_path / "run", earlier["sp"]).returncode == 0
    with h5py.File(earlier["sp"]) as old, h5py.File(tmp_path / "run" / "run.h5") as new:
        last = sorted(old["frames"])[-1]
        np.testing.assert_array_equal(new["frames/000000/positions"], old["frames"][last]["positions"])


def test_a_restart_does_not_read_the_file(tmp_path, earlier):
    """Stopped, continued and branched runs have the bits of an uninterrupted run, without the file."""
    file = tmp_path / "copy.h5"
    file.write_bytes(earlier["smooth"].read_bytes())
    options = of_model("smooth") | {"t_end": 1}
    assert pliant("hopper", start=file, output=tmp_path / "whole", **options).returncode == 0
    half = options | {"t_end": 0.5}
    assert pliant("hopper", start=file, output=tmp_path / "half", **half).returncode == 0
    file.unlink()
    result = pliant("hopper", restart=tmp_path / "half", t_end=1)
    assert result.returncode == 0, result.stderr
    with h5py.File(tmp_path / "whole" / "run.h5") as a, h5py.File(tmp_path / "half" / "run.h5") as b:
        for name in a["frames"]:
            np.testing.assert_array_equal(a["frames"][name]["positions"], b["frames"][name]["positions"])
    assert json.loads((tmp_path / "half" / "summary.json").read_text(encoding="utf-8"))["start"]["frame"] == 2
    other = pliant("hopper", restart=tmp_path / "half", t_end=2, start=earlier["sp"])
    assert other.returncode == 2 and "a restart cannot change it" in other.stderr


@pytest.mark.parametrize("dim", [2, 3])
def test_a_table(dim, tmp_path):
    """In any order of ids and columns, with comments; mass and velocity are optional."""
    axes = "xyz"[:dim]
    text = f"# three particles\nid; {'; '.join(axes)}; diameter; {'; '.join('v' + a for a in axes)}\n\n"
    x = np.array([[1.5, 0.5, 3][:dim], [0, 0, 5][:dim], [-1.5, 0.25, 3][:dim]], float)
    x[:, -1] = [3, 5, 3]
    for number, position, sigma in zip((7, 3, 5), x, (1, 1.25, 0.75)):
        text += f"{number}; {'; '.join(map(str, position))}; {sigma}; {'; '.join(['0.125'] * dim)}  # at {number}\n"
    result = started(tmp_path / "run", table(tmp_path, text), dim=dim, flow="discharge")
    assert result.returncode == 0, result.stderr
    with h5py.File(tmp_path / "run" / "run.h5") as run:
        np.testing.assert_array_equal(run["frames/000000/positions"], x[[1, 2, 0]])
        np.testing.assert_array_equal(run["frames/000000/velocities"], np.full((3, dim), 0.125))
        np.testing.assert_array_equal(run["topology/sigma"], [1.25, 0.75, 1])
        volume = np.array([1.25, 0.75, 1]) ** dim * np.pi / (4 if dim == 2 else 6)
        np.testing.assert_allclose(run["topology/mass"], volume)


def test_a_table_of_polygons(tmp_path):
    corners = [(-0.5, -0.4), (0.5, -0.4), (0.5, 0.4), (-0.5, 0.4)]
    rows = [f"{m},{k},{x + 1.5 * m},{y + 3}" for m in (1, 0) for k, (x, y) in reversed(list(enumerate(corners)))]
    file = table(tmp_path, "particle,vertex,x,y\n" + "\n".join(rows) + "\n")
    options = of_model("smooth") | {"flow": "discharge", "edge_width": 0.2}
    result = pliant("hopper", start=file, output=tmp_path / "run", **options)
    assert result.returncode == 0, result.stderr
    with h5py.File(tmp_path / "run" / "run.h5") as run:
        np.testing.assert_allclose(run["frames/000000/positions"][:4], np.array(corners) + [0, 3])
        np.testing.assert_allclose(run["topology/a0"], [0.8, 0.8])
        np.testing.assert_allclose(run["topology/l0"], [0.9, 0.9])
        np.testing.assert_allclose(run["topology/diameter"][0], 0.18)
    crossed = table(tmp_path, "particle,vertex,x,y\n0,0,0,3\n0,1,1,4\n0,2,1,3\n0,3,0,4\n", "crossed.csv")
    assert "particle 0: its outline meets itself" in refused(tmp_path, crossed, model="rough", mu=0)
    square = "{0},0,-{1},{2}\n{0},1,{1},{2}\n{0},2,{1},{3}\n{0},3,-{1},{3}\n"
    inner = table(tmp_path, "particle,vertex,x,y\n" + square.format(0, 1, 2, 4) + square.format(1, 0.2, 2.8, 3.2), "in.csv")
    assert "particles 0 and 1 are inside each other" in refused(tmp_path, inner, model="rough", mu=0)
    clockwise = table(tmp_path, "particle,vertex,x,y\n0,0,0,3\n0,2,1,3\n0,1,1,4\n", "clockwise.csv")
    assert "counter-clockwise" in refused(tmp_path, clockwise, model="rough", mu=0)


@pytest.mark.parametrize("text, words", [
    ("", "is empty; write a line with the names of the columns (x,y,diameter)"),
    ("# nothing\n", "is empty"),
    ("x,y,diameter\n", "no rows"),
    ("1,2,1\n", "table.csv:1: \"1\" is not a name of a column"),
    ("x,y\n1,2\n", "column diameter is missing"),
    ("x,y,diameter,vx\n1,2,1,0\n", "column vy is missing"),
    ("x,y,z,diameter\n1,2,3,1\n", "column z is unknown"),
    ("x,y,diameter,spin\n1,2,1,0\n", "column spin is unknown"),
    ("x,x,y,diameter\n1,1,2,1\n", "two columns x"),
    ("x,y,diameter\n1,2\n", "table.csv:2: 2 values in a table of 3 columns"),
    ("x,y,diameter\n1,2,1,4\n", "table.csv:2: 4 values in a table of 3 columns"),
    ("x,y,diameter\n1,nan,1\n", "y is \"nan\", which is not a finite number"),
    ("x,y,diameter\n1,2,inf\n", "diameter is \"inf\""),
    ("x,y,diameter\n1,2,1e999\n", "diameter is \"1e999\""),
    ("x,y,diameter\n1,2,-1\n", "table.csv:2: diameter is -1, but must be positive"),
    ("x,y,diameter\n1,2,0\n", "diameter is 0"),
    ("x,y,diameter,mass\n1,2,1,0\n", "mass is 0"),
    ("id,x,y,diameter\n4,1,2,1\n4,-1,2,1\n", "table.csv:3: id 4 is also in line 2"),
    ("id,x,y,diameter\n0.5,1,2,1\n", "id is 0.5"),
    ("id,x,y,diameter\n-1,1,2,1\n", "id is -1"),
    ("x,y,diameter\n1,2,1\n9,2,1\n", "particle 1, at (9, 2), is outside the container"),
    ("x,y,diameter\n1,2,1\n0,-50,1\n", "particle 1, at (0, -50), is more than -removal_depth 2 below the orifice"),
    ("x,y,diameter\n1,2,1\n1,2,1\n", "particles 0 and 1 are inside each other"),
    ("x,y,diameter,vx,vy\n1,2,1,0,1e9\n", "has the speed 1e+09"),
    ("\0\1\2", "column \\x00\\x01\\x02 is unknown"),
])
def test_tables_that_are_refused(text, words, tmp_path):
    assert words in refused(tmp_path, table(tmp_path, text))


def test_frames_that_are_refused(tmp_path, earlier):
    sp, smooth = earlier["sp"], earlier["smooth"]
    assert "has no frame 3: the file has 3 frames, 0 to 2" in refused(tmp_path, f"{sp}:3")
    assert "\"-1\" is not the number of a frame" in refused(tmp_path, f"{sp}:-1")
    assert "\"\" is not the number of a frame" in refused(tmp_path, f"{sp}:")
    assert "a run in 2D, but this run is 3D; use two dimensions (-dim 2), or another file" in refused(tmp_path, sp, dim=3)
    assert "particle 0 has 16 points, but particles of the model sp have one point" in refused(tmp_path, smooth)
    assert "particles of the model rough are polygons" in refused(tmp_path, sp, model="rough", mu=0)
    assert "other vertices than the model rough; use the model smooth" in refused(tmp_path, smooth, model="rough", mu=0)
    assert "there is no such file" in refused(tmp_path, tmp_path / "none.h5")
    assert "none.csv: cannot be opened" in refused(tmp_path, tmp_path / "none.csv")
    assert "is a folder; give its run.h5" in refused(tmp_path, sp.parent)
    assert "outside the container" in refused(tmp_path, sp, hopper_wall_distance=5)
    checkpoint = next(sp.parent.glob("checkpoint-*.h5"))
    assert "give the run.h5 of a run, or a table" in refused(tmp_path, checkpoint)
    assert "table.csv:2: -start" not in refused(tmp_path, table(tmp_path, "x\n", "text.h5"))
    assert "a table has no frames" in refused(tmp_path, f"{table(tmp_path, ROW)}:1")


@pytest.mark.parametrize("option, value", [("n", 3), ("size_distribution", "mono"), ("size_ratio", 1.2),
                                           ("pack_fraction", 0.5), ("pack_tolerance", 1e-3)])
def test_options_that_the_file_replaces(option, value, tmp_path):
    file = table(tmp_path, ROW)
    message = refused(tmp_path, file, **{option: value})
    assert f"-{option} (command line) with -start {file}: the particles come from this file" in message


def test_relative_to_the_options_file(tmp_path):
    table(tmp_path, ROW)
    (tmp_path / "options.yaml").write_text("start: table.csv\n", encoding="utf-8")
    result = pliant("hopper", options_file=tmp_path / "options.yaml", output=tmp_path / "run", **HOPPER)
    assert result.returncode == 0, result.stderr
    assert json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))["start"]["file"] == str(tmp_path / "table.csv")


def test_a_frame_of_the_run_itself(tmp_path, earlier):
    """The folder of an earlier run stays as it is; the same command again finds the finished run."""
    before = earlier["sp"].read_bytes()
    result = pliant("hopper", start=earlier["sp"], output=earlier["sp"].parent, **HOPPER)
    assert result.returncode == 2 and "holds a run that is finished" in result.stderr
    assert earlier["sp"].read_bytes() == before


def test_particles_that_have_left_are_left_out(tmp_path, earlier):
    result = started(tmp_path / "empty", earlier["sp"], flow="discharge", t_end=10, frame_interval=1, removal_depth=1)
    assert result.returncode == 0, result.stderr
    with h5py.File(tmp_path / "empty" / "run.h5") as run:
        active = [int(run["frames"][name]["active"][()].sum()) for name in sorted(run["frames"])]
    some = next(k for k, count in enumerate(active) if 0 < count < 25)
    file = tmp_path / "empty" / "run.h5"
    result = started(tmp_path / "rest", f"{file}:{some}", flow="discharge", removal_depth=1)
    assert result.returncode == 0, result.stderr
    with h5py.File(tmp_path / "rest" / "run.h5") as run:
        assert len(run["topology/sigma"]) == active[some]


def test_droplets_of_an_earlier_clog(tmp_path, earlier):
    """The run begins with the radii and positions of the droplets in the frame. The exit is closed at the start."""
    options = {"g": 0.1, "hopper_width": 1.25, "phi_c": 3e-4, "t_end": 4, "frame_interval": 2}
    assert pliant("clog", output=tmp_path / "first", n=14, delta=0.2, **options).returncode == 0
    file = tmp_path / "first" / "run.h5"
    result = pliant("clog", start=f"{file}:1", output=tmp_path / "second", **options)
    assert result.returncode == 0, result.stderr
    with h5py.File(file) as old, h5py.File(tmp_path / "second" / "run.h5") as new:
        np.testing.assert_array_equal(new["frames/000000/positions"], old["frames/000001/positions"])
        np.testing.assert_array_equal(new["topology/sigma"], old["topology/sigma"])
        np.testing.assert_allclose(new["topology/mass"], old["topology/mass"], rtol=1e-15)
    file.unlink()
    result = pliant("clog", restart=tmp_path / "second", t_end=6)
    assert result.returncode == 0, result.stderr

    def clog_refused(file, **more):
        result = pliant("clog", start=file, output=tmp_path / "refused", **options, **more)
        assert result.returncode == 2 and result.stderr.count("\n") == 1 and not (tmp_path / "refused").exists()
        return result.stderr

    second = tmp_path / "second" / "run.h5"
    for option in ("n", "delta", "fill_fraction"):
        assert f"-{option} (command line) with -start" in clog_refused(second, **{option: 0.1 if option != "n" else 3})
    assert "lengths in sigma_avg, but this run has lengths in R" in clog_refused(earlier["sp"])
    below = table(tmp_path, "x,y,diameter\n0,-3,2\n0,3,2\n", "below.csv")
    assert "particle 0, at (0, -3), is in a wall or below the exit" in clog_refused(below)
    inside = table(tmp_path, "x,y,diameter\n0,3,2\n0,3.01,2\n", "inside.csv")
    assert "particles 0 and 1 are inside each other" in clog_refused(inside)
    assert "lengths in R, but this run has lengths in sigma_avg" in refused(tmp_path, second)


# A channel with room for few particles, and less than a push.
CHANNEL = {"channel_width": 8, "channel_arm": 15, "stroke": 4, "plunger_speed": 10, "jam_overlap": 0.1, "jam_force": 1000,
           "t_end": 0.03, "frame_travel": 0.04, "sample_travel": 0.02}


@pytest.fixture(scope="module")
def channels(tmp_path_factory):
    """Channels of disks and of rough polygons, by name."""
    folder = tmp_path_factory.mktemp("channels")
    options = {"disk": {"area_fraction": 0.6}, "rough": {"model": "rough", "aspect": 2, "n_vertices": 8, "stiffness": 1e6,
                                                         "area_fraction": 0.2}}
    for name, more in options.items():
        result = pliant("channel", output=folder / name, **CHANNEL, distribution="bidisperse", **more)
        assert result.returncode == 0, result.stderr
    return {name: folder / name / "run.h5" for name in options}


def channel(folder, file, **options):
    return pliant("channel", start=file, output=folder, **{**CHANNEL, **options})


def channel_refused(folder, file, **options):
    """The message, of one line; no folder is left."""
    result = channel(folder / "refused", file, **options)
    assert result.returncode == 2 and result.stderr.count("\n") == 1, result.stderr
    assert not (folder / "refused" / "run.h5").exists()
    return result.stderr


@pytest.mark.parametrize("model, options", [("disk", {}), ("rough", {"model": "rough", "aspect": 2, "stiffness": 1e6})])
def test_a_channel_from_a_frame(model, options, tmp_path, channels):
    """The run starts with the positions, velocities, spins, sizes and masses of the frame; a restart does not need the file."""
    file = tmp_path / "copy.h5"
    file.write_bytes(channels[model].read_bytes())
    for name, more in {"whole": {}, "half": {"t_end": 0.015}}.items():
        result = channel(tmp_path / name, f"{file}:5", **options, **more)
        assert result.returncode == 0, result.stderr
    file.unlink()
    result = pliant("channel", restart=tmp_path / "half", t_end=CHANNEL["t_end"])
    assert result.returncode == 0, result.stderr
    with h5py.File(channels[model]) as old, h5py.File(tmp_path / "whole" / "run.h5") as new:
        frames = old["frames/000005"], new["frames/000000"]
        for name in ("positions", "velocities", "angles", "spins"):
            assert (name in frames[0]) == (name in frames[1])
            if name in frames[0]:
                np.testing.assert_array_equal(frames[1][name][()], frames[0][name][()], name)
        assert frames[1].attrs["time"] == 0 and np.abs(frames[1]["velocities"]).max() > 0
        for name in ("offset", "sigma", "l0", "mass", "diameter"):
            np.testing.assert_allclose(new["topology"][name][()], old["topology"][name][()], rtol=1e-15, err_msg=name)
        with h5py.File(tmp_path / "half" / "run.h5") as continued:
            assert len(new["frames"]) == len(continued["frames"]) > 3
            for name in new["frames"]:
                np.testing.assert_array_equal(new["frames"][name]["positions"], continued["frames"][name]["positions"])
    before, after = (json.loads((folder / "summary.json").read_text(encoding="utf-8"))
                     for folder in (channels[model].parent, tmp_path / "whole"))
    assert after["start"]["frame"] == 5 and after["disks"] == before["disks"] and after["weight"] == before["weight"]
    assert after["area_fraction"] == pytest.approx(before["area_fraction"])


def test_a_channel_from_a_table(tmp_path):
    """Without masses in the table, the mass follows from -density and -thickness."""
    file = table(tmp_path, "x,y,diameter\n2,2,1\n5,3,1.5\n3,6,1\n")
    result = channel(tmp_path / "run", file, density=2, thickness=0.5)
    assert result.returncode == 0, result.stderr
    with h5py.File(tmp_path / "run" / "run.h5") as run:
        np.testing.assert_array_equal(run["frames/000000/positions"], [[2, 2], [5, 3], [3, 6]])
        np.testing.assert_allclose(run["topology/mass"], np.pi / 4 * np.array([1, 2.25, 1]))
    disks = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))["disks"]
    assert disks == [{"radius": 0.75, "count": 1}, {"radius": 0.5, "count": 2}]
    heavy = table(tmp_path, "x,y,diameter,mass\n2,2,1,3\n", "heavy.csv")
    assert channel(tmp_path / "heavy", heavy).returncode == 0
    with h5py.File(tmp_path / "heavy" / "run.h5") as run:
        assert run["topology/mass"][()] == pytest.approx([3])


@pytest.mark.parametrize("text, words", [
    ("x,y,diameter\n2,2,1\n12,12,1\n", "particle 1, at (12, 12), is outside the channel or in a wall"),
    ("x,y,diameter\n2,2,1\n2.02,2,1\n", "particles 0 and 1 are inside each other"),
    ("x,y,diameter\n4,4,9\n", "radius of 4.5 cm"),
    ("x,y,diameter,vx,vy\n2,2,1,1e9,0\n", "has the speed 1e+09"),
    ("x,y,diameter\n2,2,-1\n", "diameter is -1"),
    ("x,y,diameter\n2,nan,1\n", "not a finite number"),
    ("x,y,diameter\n", "no rows"),
])
def test_tables_that_a_channel_refuses(text, words, tmp_path):
    assert words in channel_refused(tmp_path, table(tmp_path, text))


def test_frames_and_options_that_a_channel_refuses(tmp_path, channels, earlier):
    disks, rough = channels["disk"], channels["rough"]
    for option, value in {"area_fraction": 0.5, "distribution": "T1", "radii": 0.5, "seed": 2, "density": 1,
                          "thickness": 0.3, "start_overlap": 1e-3}.items():
        assert f"-{option} (command line) with -start {disks}" in channel_refused(tmp_path, disks, **{option: value})
    assert "have one point" in channel_refused(tmp_path, rough)
    assert "are polygons" in channel_refused(tmp_path, disks, model="rough")
    assert "lengths in sigma_avg, but this run has lengths in cm" in channel_refused(tmp_path, earlier["disk"])
    assert "lengths in cm, but this run has lengths in sigma_avg" in refused(tmp_path, disks, **of_model("disk", {}))
