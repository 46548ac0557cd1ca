"""Run folders of simulations that Python builds, and runs that start from their frames."""

import warnings

import numpy as np
import pytest

import pliant
from pliant import Run, Simulation, Walls


def bouncing(output=None, **options):
    """Disks that fall on a floor and a moving segment."""
    walls = Walls()
    walls.half_space((0, 0), (0, 1))
    walls.segment((-4, 1), (-3, 1), velocity=(0.1, 0))
    x = np.array([[-1.5, 1], [0, 0.8], [1.5, 1.2]])
    return Simulation(x, [1, 0.8, 1.2], walls=walls, gravity=(0, -1), velocities=[[0.1, 0], [0, 0], [-0.1, 0.2]],
                      e_sp=100, zeta=0.1, dt=1e-3, output=output, **options)


def test_another_working_directory(tmp_path, monkeypatch):
    """The run stays in its folder when the program changes its directory."""
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path)
    with bouncing("run", frame_interval=0.1) as sim:
        monkeypatch.chdir(tmp_path / "elsewhere")
        sim.run(0.2)
    assert not list((tmp_path / "elsewhere").iterdir()) and len(Run(tmp_path / "run").frames) == 3
    monkeypatch.chdir(tmp_path)
    with Simulation.restart("run") as sim:
        monkeypatch.chdir(tmp_path / "elsewhere")
        sim.run(0.2)
    assert not list((tmp_path / "elsewhere").iterdir()) and len(Run(tmp_path / "run").frames) == 5


def test_a_folder_that_run_reads(tmp_path):
    sim = bouncing(tmp_path / "run", frame_interval=0.5, sample_interval=0.1)
    assert sim.output == str(tmp_path / "run")
    first = sim.positions.copy()
    sim.run(1.25)
    last, velocities, energies, contacts = sim.positions.copy(), sim.velocities.copy(), sim.energies, len(sim.contacts)
    sim.close()
    run = Run(tmp_path / "run")
    assert run.summary["status"] == "done" and run.summary["steps"] == 1250 and run.scenario == "simulation"
    assert [frame.time for frame in run.frames] == pytest.approx([0, 0.5, 1, 1.25])
    np.testing.assert_array_equal(run.frames[0].positions, first)
    np.testing.assert_array_equal(run.frames[-1].positions, last)
    np.testing.assert_array_equal(run.frames[-1].velocities, velocities)
    np.testing.assert_array_equal(run.topology.sigma, [1, 0.8, 1.2])
    assert len(run.frames[-1].contacts) == contacts
    assert len(run.series) == 14 and run.series["time"].iloc[-1] == pytest.approx(1.25)
    assert run.series["kinetic_energy"].iloc[-1] == pytest.approx(energies["kinetic"])
    assert run.series["energy"].iloc[-1] == pytest.approx(sum(energies.values()))
    assert (tmp_path / "run" / "run.xdmf").exists()


def test_output_does_not_change_the_motion(tmp_path):
    a, b = bouncing(), bouncing(tmp_path / "run", frame_interval=0.01, sample_interval=1e-9)
    for sim in (a, b):
        sim.run(1)
    np.testing.assert_array_equal(a.positions, b.positions)
    np.testing.assert_array_equal(a.velocities, b.velocities)


@pytest.mark.parametrize("dim, model", [(3, "sp"), (3, "disk"), (2, "disk"), (2, "smooth"), (2, "rough")])
def test_every_kind_of_particles(dim, model, tmp_path):
    centres = 1 + 1.5 * np.stack(np.meshgrid(*[np.arange(2.0)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    particles = ({"polygons": pliant.regular_polygons(centres, 1, 8)} if model in ("smooth", "rough")
                 else {"positions": centres, "diameters": 1})
    walls = Walls(dim)
    walls.half_space([0] * (dim - 1) + [-2], [0] * (dim - 1) + [1])
    with Simulation(**particles, walls=walls, model=model, box=[10] + [None] * (dim - 1), output=tmp_path / "run") as sim:
        sim.step(3)
        sim.write_frame()
        places = sim.positions.copy()
    run = Run(tmp_path / "run")
    assert len(run.frames) == 2 and run.dim == dim and run.model == model
    np.testing.assert_allclose(run.frames[1].positions, places, atol=1e-12)


def test_callbacks_write(tmp_path):
    with bouncing(tmp_path / "run") as sim:
        sim.run(0.1, callback=lambda sim: (sim.write_frame(), sim.write_sample()), every=0.05)
    run = Run(tmp_path / "run")
    assert [frame.time for frame in run.frames] == pytest.approx([0, 0.05, 0.1])
    assert len(run.series) == 3


def test_a_hopper_starts_from_a_frame_of_a_simulation(tmp_path):
    """The nearest thing to a restart from the command line."""
    container = pliant.Container(3, 8)
    sizes = pliant.diameters(20)
    with Simulation(container.pack(sizes), sizes, walls=container, gravity=(0, -1), e_sp=1000, zeta=0.3,
                    output=tmp_path / "sim") as sim:
        sim.run(0.2)
        last, speeds = sim.positions.copy(), sim.velocities.copy()
    run = pliant.hopper(start=tmp_path / "sim" / "run.h5", hopper_width=3, hopper_wall_distance=8, zeta=0.3, t_end=0.1,
                        output=tmp_path / "hopper", quiet=True)
    np.testing.assert_array_equal(run.frames[0].positions, last)
    np.testing.assert_array_equal(run.frames[0].velocities, speeds)
    assert run.manifest["start"]["frame"] == 1 and run.parameters["n"] == 20


def test_bad_requests(tmp_path):
    with bouncing(tmp_path / "run") as sim:
        with pytest.raises(pliant.InputError, match="particles of a simulation with an output folder .* are fixed"):
            sim.add([[9, 9]], 1)
        with pytest.raises(pliant.InputError, match="are fixed"):
            sim.remove(0)
        with pytest.raises(pliant.FolderInUseError, match="in use by"):
            bouncing(tmp_path / "run")
        sim.run(0.01)
    with pytest.raises(pliant.InputError, match="holds a run already"):
        bouncing(tmp_path / "run")
    assert Run(tmp_path / "run").summary["status"] == "done"
    for name in ("frame_interval", "sample_interval"):
        with pytest.raises(pliant.InputError, match=name):
            bouncing(**{name: 1})
        for value in (0, -1, np.nan, np.inf, "1"):
            with pytest.raises(pliant.InputError, match=name):
                bouncing(tmp_path / "bad", **{name: value})
    assert not (tmp_path / "bad").exists()
    with pytest.raises(pliant.InputError, match="output is empty"):
        bouncing("")
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(pliant.OutputError):
        bouncing(tmp_path / "file" / "run")
    sim = bouncing()
    assert sim.output is None
    with pytest.raises(pliant.UsageError, match="no output folder"):
        sim.write_frame()
    sim.close()
    for call in (sim.write_frame, sim.write_sample):
        with pytest.raises(pliant.UsageError, match="closed"):
            call()


def test_a_run_that_fails_says_so(tmp_path):
    def fail(sim):
        raise KeyError("mine")

    sim = bouncing(tmp_path / "callback")
    with pytest.raises(KeyError):
        sim.run(1, callback=fail)
    sim.close()
    assert Run(tmp_path / "callback").summary["status"] == "stopped"  # the state is intact
    sim = bouncing(tmp_path / "unstable", allow_unstable_dt=True)
    sim.set(dt=50)
    with warnings.catch_warnings(), pytest.raises(pliant.NumericalError) as error:
        warnings.simplefilter("ignore")
        for _ in range(200):
            sim.run(1e4)
    sim.close()
    summary = Run(tmp_path / "unstable").summary
    assert summary["status"] == "failed" and summary["message"].replace("(-", "(") == str(error.value)  # with the names of options


@pytest.mark.parametrize("end", ["", "os.kill(os.getpid(), 9)"])
def test_the_end_of_the_process(end, tmp_path, script):
    """The end of the interpreter completes the folder; a kill leaves the frames written before."""
    text = f"""
import os, pliant
sim = pliant.Simulation([[0, 1]], 1, gravity=(0, -1), dt=1e-3, output={str(tmp_path / "run")!r}, frame_interval=0.1)
sim.run(0.25)
{end}
"""
    script(text, code=-9 if end else 0)
    run = Run(tmp_path / "run")
    assert [frame.time for frame in run.frames] == pytest.approx([0, 0.1, 0.2] + ([] if end else [0.25]))
    assert bool(run.summary) != bool(end)


def test_reports_draw_it(tmp_path):
    with bouncing(tmp_path / "run", frame_interval=0.1, sample_interval=0.01) as sim:
        sim.run(0.5)
    Run(tmp_path / "run").report(tmp_path / "report.html")
    assert (tmp_path / "report.html").stat().st_size > 1000


def test_a_fork_leaves_the_folder_alone(tmp_path, script):
    script(f"""
import os, sys, pliant
sim = pliant.Simulation([[0, 1]], 1, gravity=(0, -1), dt=1e-3, output={str(tmp_path / "run")!r})
if os.fork() == 0:
    sys.exit(0)
os.wait()
assert not os.path.exists({str(tmp_path / "run" / "summary.json")!r})
try:
    pliant.Simulation([[0, 1]], 1, output={str(tmp_path / "run")!r})
except pliant.FolderInUseError:
    sim.run(0.1)
    sim.close()
""")
    assert len(Run(tmp_path / "run").frames) == 2
