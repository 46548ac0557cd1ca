"""Scenarios from Python: the runs, the checks and the messages of the program."""

import fcntl
import os
import pty
import re
import shutil
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

import pliant
from pliant import analysis
from conftest import PROGRAM, ROOT, apps


def same(a, b):
    apps.assert_same_runs(apps.Results(a), apps.Results(b))


def test_a_run_is_that_of_the_program_bit_for_bit(tmp_path, small, program):
    run = pliant.hopper(**small, output=tmp_path / "python", quiet=True)
    assert isinstance(run, pliant.Run) and run.summary["status"] == "done"
    assert program("hopper", **small, output=tmp_path / "program").returncode == 0
    same(tmp_path / "python", tmp_path / "program")


def test_the_version_is_that_of_the_program(program):
    assert program("-version").stdout.splitlines()[0] == f"pliant {pliant.__version__}"


@pytest.mark.parametrize("name, options", [
    ("raft", {"rows": 2, "columns": 2, "n": 3, "v_wall": 1e-3, "t_end": 5}),
    ("clog", {"n": 14, "g": 0.1, "hopper_width": 1.25, "phi_c": 3e-4, "t_end": 5}),
    ("vibrate", {"n": 8, "box_width": 4, "cycles": 1}),
    ("pack", {"n": 8}),
    ("shear", {"n": 16, "strain": 0.01}),
    ("channel", {"channel_width": 6, "channel_arm": 12, "stroke": 3, "distribution": "bidisperse", "area_fraction": 0.5,
                 "t_end": 0.01}),
    ("hopper", {"n": 40, "hopper_wall_distance": 8, "hopper_width": 3, "t_end": 0.5, "dim": 3}),
    ("hopper", {"n": 8, "model": "smooth", "hopper_wall_distance": 6, "hopper_width": 3, "t_end": 0.1}),
])
def test_every_scenario(name, options, tmp_path, program):
    """Both ways end alike, done or with the same message."""
    done = program(name, **options, output=tmp_path / "program")
    if done.returncode == 0:
        getattr(pliant, name)(**options, output=tmp_path / "python", quiet=True)
        same(tmp_path / "python", tmp_path / "program")
    else:
        with pytest.raises(pliant.PliantError) as error:
            getattr(pliant, name)(**options, output=tmp_path / "python", quiet=True)
        assert f"pliant: error: {error.value}\n" == done.stderr
        pytest.fail(f"{name} {options} is no run: {done.stderr}")


def test_energy_budget_of_packings(tmp_path):
    """Columns of packings with units, in the series and in the table of the analysis; the rate is per packing."""
    run = pliant.shear(n=16, strain=0.01, strain_step=2e-3, output=tmp_path / "run", quiet=True)
    table = analysis.energy_budget(run)
    assert list(table) == ["time", "energy", "work", "dissipated", "relaxed", "dissipation_rate"]
    np.testing.assert_allclose(table["work"] - table["dissipated"], table["energy"] - table["energy"][0], rtol=1e-9)
    middle = len(table) // 2
    assert table["dissipation_rate"][middle] == (table["dissipated"][middle + 1] - table["dissipated"][middle - 1]) / 2
    for name in ("work", "dissipated", "relaxed"):
        units, description = run.describe(f"series/{name}")
        assert units == "eps" and "since the start" in description


def test_figure_of_a_vibrated_container(tmp_path):
    run = pliant.vibrate(n=8, box_width=4, cycles=3, output=tmp_path / "run", quiet=True)
    done = subprocess.run([sys.executable, ROOT / "python/plots/series.py", run.path, "-o", tmp_path / "series.png"],
                          capture_output=True, encoding="utf-8")
    assert done.returncode == 0 and (tmp_path / "series.png").stat().st_size > 10_000, done.stderr


def test_a_channel_from_a_table(tmp_path):
    table = tmp_path / "disks.csv"
    table.write_text("x,y,diameter\n2,2,1\n4,3,1.5\n", encoding="utf-8")
    options = {"channel_width": 6, "channel_arm": 12, "stroke": 3, "t_end": 0.01, "quiet": True}
    run = pliant.channel(start=table, output=tmp_path / "run", **options)
    assert run.frames[0].positions.tolist() == [[2, 2], [4, 3]] and run.topology.sigma.tolist() == [1, 1.5]
    with pytest.raises(pliant.InputError, match="-area_fraction .* with -start"):
        pliant.channel(start=table, output=tmp_path / "other", area_fraction=0.3, **options)


@pytest.mark.parametrize("first, second", [("python", "program"), ("program", "python")])
def test_one_door_goes_on_with_a_run_of_the_other(first, second, tmp_path, small, program):
    def run(door, **options):
        if door == "python":
            pliant.hopper(**options, quiet=True)
        else:
            assert program("hopper", **options).returncode == 0
    run(first, **dict(small, t_end=1.5), output=tmp_path / "run")
    run(second, restart=tmp_path / "run", t_end=3)
    run("program", **dict(small, t_end=1.5), output=tmp_path / "other")
    run("program", restart=tmp_path / "other", t_end=3)
    same(tmp_path / "run", tmp_path / "other")


def test_a_stopped_run_goes_on_by_the_same_call(tmp_path, small, program, summary):
    options = dict(small, t_end=20, output=tmp_path / "run")
    stops = 0
    while pliant.hopper(**options, max_wall_time=0.02 * 2**stops, quiet=True).summary["status"] == "stopped":
        stops += 1
    assert stops > 0
    assert program("hopper", **dict(small, t_end=20), output=tmp_path / "other").returncode == 0
    same(tmp_path / "run", tmp_path / "other")


@pytest.mark.parametrize("options", [
    {"n": -5}, {"n": 2.5}, {"n": float("nan")}, {"hopper_width": float("inf")}, {"hopper_widht": 3}, {"model": "soft"},
    {"foo": 1}, {"g": 9.81}, {"hopper_width": 60}, {"mu": True}, {"output": ""}, {"ts_type": "rk"}, {"ts_typ": "rk"},
    {"restart": "no-such-folder"}, {"outline": "no-such-file"}, {"options_file": "no-such-file.yaml"},
    {"dt": 5, "t_end": 1}, {"dt": 0.1}, {"integrator": "ts", "ts_type": "foo"}, {"k_a": 3}, {"dim": 3, "model": "bubble"},
    {"obstacle": "disk:0,6"}, {"threads": 0}, {"seed": 10**30},
])
def test_bad_options_have_the_messages_of_the_program(options, tmp_path, program, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = [text for name, value in options.items()
                 for text in ([f"-{name}"] if value is True else [f"-{name}", str(value)])]
    expected = program("hopper", *arguments)
    assert expected.returncode == 2
    with pytest.raises(ValueError) as error:
        pliant.hopper(**options)
    assert isinstance(error.value, pliant.InputError)
    assert expected.stderr.splitlines()[-1] == f"pliant: error: {error.value}"


@pytest.mark.parametrize("options", [
    {"n": object()}, {"n": b"5"}, {"n": {}}, {"n": 1j}, {"output": "-help"}, {"help": True}, {"version": True},
    {"n": np.zeros((2, 2))}, {"n": ""}, {"output": "a\0b"}, {"n": "3 -m 4"}, {"n\n": 3}, {"": 3}, {"-n": 3}, {"1": 2},
    {"output": "x" * 5000}, {"n": "\udcff"},
])
def test_values_that_no_option_has(options, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((ValueError, TypeError)):
        pliant.hopper(**options)
    assert not list(tmp_path.iterdir())


def test_arguments_are_checked_before_the_engine():
    with pytest.raises(TypeError):
        pliant.hopper(60)


def test_values_of_all_kinds(tmp_path):
    run = pliant.hopper(n=np.int32(40), hopper_width=np.float32(3), hopper_wall_distance=8, allow_unstable_dt=False,
                        allow_energy_error=True, frame_fields=["velocities", "contacts"], t_end=None, dt=None,
                        max_wall_time=1e-9, output=tmp_path / "run", quiet=True)
    options = run.summary["parameters"]
    assert options["n"]["value"] == 40 and options["hopper_width"]["value"] == 3 and options["t_end"]["is_default"]
    assert options["frame_fields"]["value"] == "velocities,contacts" and options["allow_energy_error"]["value"] is True


def test_arrays_without_dimension_are_single_values(tmp_path):
    run = pliant.hopper(n=np.array(40), hopper_width=np.array(3.0), hopper_wall_distance=8, allow_energy_error=np.array(True),
                        frame_fields=np.array("velocities"), max_wall_time=1e-9, output=tmp_path / "run", quiet=True)
    options = run.summary["parameters"]
    assert options["n"]["value"] == 40 and options["hopper_width"]["value"] == 3
    assert options["frame_fields"]["value"] == "velocities" and options["allow_energy_error"]["value"] is True
    sim = pliant.Simulation([[0, 0], [0.9, 0]], 1, e_sp=np.array(3.0))
    first = sim.energies["pair"]
    sim.set(e_sp=np.array(6.0))
    assert first > 0 and sim.energies["pair"] == 2 * first


def test_help_lists_the_options_of_the_program(program):
    import json
    names = json.loads(program("hopper", "-help_json").stdout)
    text = pliant.hopper.__doc__
    for name in names:
        assert f"\n    {name}: " in text
    import inspect
    parameters = inspect.signature(pliant.hopper).parameters
    assert set(names) <= set(parameters) and parameters["hopper_width"].default == 5
    assert set(program("-scenarios").stdout.split()) <= set(dir(pliant))


def test_remarks_and_warnings_are_python_s(tmp_path, small, capsys):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        pliant.hopper(**dict(small, t_end=0.1, dt=0.004), output=tmp_path / "a")
    assert "output in" in capsys.readouterr().out
    assert [w.category for w in caught] == [pliant.PliantWarning] and "limit of stability" in str(caught[0].message)
    pliant.hopper(**dict(small, t_end=0.1), output=tmp_path / "b", quiet=True)
    assert capsys.readouterr().out == ""


def test_a_warning_that_is_an_error_stops_the_run(tmp_path, small, program):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(pliant.PliantWarning, match="limit of stability"):
            pliant.hopper(**dict(small, t_end=1e6, dt=0.004), output=tmp_path / "a", quiet=True)
    assert apps.Results(tmp_path / "a").summary["status"] == "stopped"


def test_progress_bar(tmp_path, small, capfd):
    pytest.importorskip("tqdm")
    pliant.hopper(**dict(small, t_end=40), output=tmp_path / "a", quiet=True, progress=True)
    assert "hopper:" in capfd.readouterr().err


HOPPER = {"n": 40, "hopper_wall_distance": 8, "hopper_width": 3}
BARS = {
    "hopper": HOPPER | {"t_end": 5},
    "raft": {"rows": 2, "columns": 2, "v_wall": 1e-3, "t_end": 20},
    "clog": {"n": 14, "g": 0.1, "hopper_width": 1.25, "phi_c": 3e-4, "t_end": 5},
    "channel": {"channel_width": 6, "channel_arm": 12, "stroke": 3, "distribution": "bidisperse", "area_fraction": 0.5, "t_end": 0.1},
    "pack": {"n": 16},
    "shear": {"n": 16, "strain": 0.02},
    "shear at a rate": {"n": 16, "path": "quench", "fraction": 0.9, "shear_rate": 0.05, "strain": 1},
    "vibrate": {"n": 8, "box_width": 4, "cycles": 1},
    "hopper, an ensemble": HOPPER | {"t_end": 1, "ensemble": 3},
}
BAR = """
import ast, sys, pliant
if sys.argv[3] == "without":
    sys.modules["tqdm"] = None
getattr(pliant, sys.argv[1].split(",")[0].split()[0])(**ast.literal_eval(sys.argv[2]))
"""


@pytest.mark.parametrize("tqdm", ["with", "without"])
@pytest.mark.parametrize("name", BARS)
def test_progress_bar_on_a_terminal(name, tqdm, tmp_path):
    """A bar that reaches the end of the run, also of a short one; without tqdm, remarks alone."""
    if tqdm == "with":
        pytest.importorskip("tqdm")
    terminal, other = pty.openpty()
    fcntl.ioctl(other, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 200, 0, 0))
    options = BARS[name] | {"output": str(tmp_path / "run")}
    child = subprocess.Popen([sys.executable, "-B", "-W", "ignore", "-c", BAR, name, repr(options), tqdm], stdin=other, stdout=other, stderr=other)
    os.close(other)
    output = b""
    try:
        while part := os.read(terminal, 2**16):
            output += part
    except OSError:  # the end of a terminal
        pass
    os.close(terminal)
    output = output.decode()
    assert child.wait(apps.HANGS) == 0 and "output in" in output, output
    bars = re.findall(r"(\w+): +(\d+)%\|[^\r]*?\| *([0-9.e+-]+)/([0-9.e+-]+) \[", output)
    if tqdm == "without":
        assert not bars and "%|" not in output
        return
    assert {bar[0] for bar in bars} == {name.split(",")[0].split()[0]} and bars[-1][1] == "100", output
    assert float(bars[-1][2]) == pytest.approx(float(bars[-1][3]), rel=0.01)


def test_a_bar_that_is_asked_for_needs_tqdm(script):
    script("""
import sys, pliant
sys.modules["tqdm"] = None
try:
    pliant.pack(n=8, progress=True)
except pliant.InputError as error:
    assert "progress=True needs tqdm; install python3-tqdm" in str(error)
else:
    raise SystemExit(1)
""")


INTERRUPTED = """
import pliant, sys
try:
    pliant.hopper(n=60, hopper_wall_distance=8, hopper_width=3, t_end=1e6, output=sys.argv[1], quiet=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
run = pliant.Run(sys.argv[1])
assert run.summary["status"] == "stopped", run.summary["status"]
import signal
assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
pliant.hopper(n=60, hopper_wall_distance=8, hopper_width=3, t_end=0.1, output=sys.argv[1] + "-b", quiet=True)
"""


def test_ctrl_c_leaves_a_checkpoint(tmp_path, program):
    child = subprocess.Popen([sys.executable, "-B", "-c", INTERRUPTED, str(tmp_path / "run")], encoding="utf-8",
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    apps.wait_for((tmp_path / "run" / "checkpoint-a.h5").exists, child)
    child.send_signal(signal.SIGINT)
    out, errors = child.communicate(timeout=apps.HANGS)
    assert child.returncode == 0 and out == "interrupted\n", errors
    resumed = program("hopper", "-restart", tmp_path / "run", max_wall_time=0.05)
    assert resumed.returncode == 75, resumed.stderr


def test_other_signals_end_the_process_after_the_checkpoint(tmp_path):
    child = subprocess.Popen([sys.executable, "-B", "-c", INTERRUPTED, str(tmp_path / "run")], encoding="utf-8",
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    apps.wait_for((tmp_path / "run" / "checkpoint-a.h5").exists, child)
    child.send_signal(signal.SIGTERM)
    child.communicate(timeout=apps.HANGS)
    assert child.returncode == -signal.SIGTERM
    assert apps.Results(tmp_path / "run").summary["status"] == "stopped"


def test_a_second_thread_is_refused_and_python_goes_on(tmp_path, small):
    errors, ticks = [], []
    running = threading.Event()

    class Bar:
        def begin(self, folder):
            running.set()

        def progress(self, t, end, text):
            pass

        say = warn = lambda self, text: None

    from pliant.engine import core
    from pliant.scenario_calls import arguments
    options = arguments(dict(small, t_end=1e6, max_wall_time=0.5, output=tmp_path / "a"))
    runner = threading.Thread(target=core.run_scenario, args=("hopper", options, Bar()))
    runner.start()
    running.wait()
    with pytest.raises(pliant.UsageError, match="another thread uses the engine"):
        pliant.hopper(**small, output=tmp_path / "b")
    while runner.is_alive():
        ticks.append(time.monotonic())
        time.sleep(0.001)
    runner.join()
    assert len(ticks) > 50 and not errors  # the GIL is free


def test_a_fork_is_refused(script, tmp_path):
    script(f"""
import os, pliant
pliant.hopper(n=40, hopper_wall_distance=8, hopper_width=3, t_end=0.01, output={str(tmp_path / 'a')!r}, quiet=True)
child = os.fork()
if child == 0:
    try:
        pliant.hopper(n=40, output={str(tmp_path / 'b')!r})
    except pliant.UsageError as error:
        assert "fork" in str(error)
        raise SystemExit(7)
    raise SystemExit(1)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
""")


def test_a_fork_before_the_first_run_may_run(script, tmp_path):
    script(f"""
import os, pliant
pliant.hopper
child = os.fork()
pliant.hopper(n=40, hopper_wall_distance=8, hopper_width=3, t_end=0.01, output={str(tmp_path)!r} + f"/{{child == 0}}", quiet=True)
if child:
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
""")
    same(tmp_path / "True", tmp_path / "False")


def test_numerical_failures_and_folders_in_use(tmp_path, small):
    with pytest.raises(pliant.NumericalError) as error:
        pliant.hopper(**dict(small, dt=0.3, t_end=100), allow_unstable_dt=True, output=tmp_path / "a", quiet=True)
    assert isinstance(error.value, ArithmeticError) and (tmp_path / "a" / "summary.json").exists()
    child = apps.start("hopper", **dict(small, t_end=1e6), output=tmp_path / "b")
    try:
        apps.wait_for((tmp_path / "b" / "checkpoint-a.h5").exists, child)
        with pytest.raises(pliant.FolderInUseError, match=f"process {child.pid}"):
            pliant.hopper(**small, output=tmp_path / "b")
    finally:
        apps.end(child, signal.SIGTERM)
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(pliant.PliantError):
        pliant.hopper(**small, output=tmp_path / "file" / "c")


def test_evaluate_is_that_of_the_program(program, tmp_path):
    import json
    case = {"model": "sp", "inputs": {"dim": 2, "positions": np.array([[0, 0], [0.9, 0.1]]), "sigma": [1, 1.1]}}
    result = pliant.evaluate(case)
    file = tmp_path / "case.json"
    file.write_text(json.dumps(case, default=lambda a: a.tolist()), encoding="utf-8")
    assert result == json.loads(program("evaluate", file).stdout) == pliant.evaluate(file)
    for bad in ({"model": "sp", "inputs": {"dim": 2, "positions": [[0, np.nan]], "sigma": [1]}}, {"model": {1, 2}}, {},
                {"model": "sp", "inputs": {"dim": 2, "positions": [[0, 0]], "sigma": [-1]}}, "no-such-file.json"):
        with pytest.raises(pliant.InputError):
            pliant.evaluate(bad)


def test_a_copy_without_the_engine_says_so(script, tmp_path):
    package = tmp_path / "pliant"
    shutil.copytree(ROOT / "python" / "pliant", package)
    environment = dict(os.environ, PYTHONPATH=str(tmp_path))
    script("""
import pliant
assert pliant.Run and "hopper" in dir(pliant)
try:
    pliant.hopper
except ImportError as error:
    assert "pybind11-dev" in str(error) and "build/python" in str(error), error
else:
    raise SystemExit(1)
try:
    from pliant import Simulation
except ImportError as error:
    assert "pybind11-dev" in str(error) or "cannot import" in str(error), error
try:
    pliant.nonsense
except AttributeError:
    pass
""", env=environment)


def test_types_are_up_to_date(script):
    result = subprocess.run([sys.executable, "-B", ROOT / "scripts" / "python_stubs.py", "--check"], capture_output=True,
                            encoding="utf-8")
    assert result.returncode == 0, result.stderr


def test_the_engine_next_to_petsc4py(script, tmp_path):
    pytest.importorskip("petsc4py")
    for before in (True, False):
        script(f"""
import pliant
def run(name): pliant.hopper(n=40, hopper_wall_distance=8, hopper_width=3, t_end=0.01, output={str(tmp_path / str(before))!r} + name, quiet=True)
if not {before}: run("a")
from petsc4py import PETSc
v = PETSc.Vec().createSeq(3)
run("b")
v.set(2.0)
assert v.sum() == 6
""")


def test_the_types_are_clean_for_mypy(tmp_path):
    mypy = [sys.executable, "-m", "mypy"]
    if subprocess.run([*mypy, "--version"], capture_output=True).returncode != 0:
        pytest.skip("no mypy")
    good, bad = tmp_path / "good.py", tmp_path / "bad.py"
    good.write_text("import pliant\nrun: pliant.Run = pliant.hopper(n=3, model='sp', output='x', ts_type='rk')\n"
                    "many: pliant.Ensemble = pliant.pack(n=8, ensemble=3, output='y')\n", encoding="utf-8")
    bad.write_text("import pliant\npliant.hopper(n='a')\npliant.raft(model=3)\n", encoding="utf-8")
    def check(file):
        return subprocess.run([*mypy, "--cache-dir=/dev/null", "--follow-imports=silent", str(file)], capture_output=True,
                              encoding="utf-8", env=dict(os.environ, MYPYPATH=str(ROOT / "python"))).stdout
    assert check(good).startswith("Success")
    package = subprocess.run([*mypy, "--cache-dir=/dev/null", str(ROOT / "python/pliant")], capture_output=True, encoding="utf-8",
                             cwd=ROOT)
    assert package.returncode == 0, package.stdout
    assert "Found 2 errors" in check(bad) or "Found 1 error" in check(bad)


def test_an_average_without_error_has_a_reason(small, tmp_path):
    run = pliant.hopper(**dict(small, t_end=0.5), output=tmp_path / "run", quiet=True)
    value, error = run.measured("Q")
    assert np.isnan(error) and run.measured("Q").no_error == "nothing has crossed" and "(no error: nothing" in repr(run.measured("Q"))
    assert run.measured("Q").value == value and run.measured("steady_start").no_error is None


def test_a_default_may_be_repeated(tmp_path):
    """A distribution that radii replace is refused, unless it is the default."""
    options = dict(geometry="straight", channel_width=4, channel_arm=7, radii=[0.5, 0.6], counts=[1, 1], area_fraction=0.2,
                   pushes=1, stroke=0.01, quiet=True)
    pliant.channel(**options, distribution="T4", output=tmp_path / "run")
    with pytest.raises(pliant.InputError, match="-distribution with -radii"):
        pliant.channel(**options, distribution="T1", output=tmp_path / "other")


@pytest.mark.parametrize("name, options", [
    ("raft", {"rows": 2, "columns": 3, "v_wall": 1e-3, "t_end": 20, "frame_interval": 10}),
    ("clog", {"n": 14, "g": 0.1, "hopper_width": 1.25, "phi_c": 3e-4, "t_end": 10, "frame_interval": 5}),
    ("vibrate", {"n": 8, "box_width": 4, "cycles": 1, "frames_per_cycle": 2}),
    ("vibrate", {"n": 12, "dim": 3, "box_width": 3, "cycles": 1, "frames_per_cycle": 2}),
    ("pack", {"n": 8}),
    ("pack", {"n": 12, "dim": 3}),
    ("pack", {"n": 5, "model": "rough", "n_vertices": 8, "pressure": 1e-2, "start_pressure": 1e-1}),
    ("pack", {"n": 16, "path": "compress", "fraction": 0.8, "fraction_step": 5e-3, "pressure": 1e-2}),
    ("shear", {"n": 16, "strain": 0.1, "strain_step": 0.02}),
    ("shear", {"n": 16, "strain": 0.1, "strain_step": 0.02, "control": "pressure", "pressure": 1e-3}),
    ("shear", {"n": 16, "path": "quench", "fraction": 0.9, "shear_rate": 0.05, "strain": 0.2, "frame_interval": 2}),
    ("channel", {"channel_width": 6, "channel_arm": 12, "stroke": 3, "distribution": "bidisperse", "area_fraction": 0.5,
                 "t_end": 0.2, "frame_travel": 0.05}),
    ("hopper", {"n": 12, "hopper_wall_distance": 8, "hopper_width": 3, "t_end": 4, "frame_interval": 0.5}),
    ("hopper", {"n": 12, "hopper_wall_distance": 8, "hopper_width": 3, "t_end": 9, "frame_interval": 1, "flow": "discharge"}),
], ids=lambda value: value if isinstance(value, str) else "")
def test_non_affine_motion_in_every_scenario(name, options, tmp_path):
    """Small runs: neighbours beyond half the box, boxes that change, fewer than 15 particles, particles that are reinserted or
    leave. The mean motion is that of a sum over all images."""
    run = getattr(pliant, name)(**options, output=tmp_path / "run", quiet=True)
    before, after = run.frames[-2], run.frames[-1]
    moved = after.displacements(before)
    there = np.isfinite(moved).all(1)
    least, number = analysis.d2_min(before, after)
    assert (number[~there] == 0).all() and np.isnan(least[~there]).all()
    assert np.array_equal(np.isfinite(least), there & (number > run.dim))
    found, width = analysis.non_affine_displacements(before, after, 1.0), 1.0
    assert np.array_equal(np.isfinite(found).all(1), there)
    images, shifts = np.zeros((1, run.dim)), np.zeros((1, run.dim))
    strain = np.eye(run.dim)
    if before.box is not None:
        n = np.stack(np.meshgrid(*[np.arange(-9, 10)] * run.dim), -1).reshape(-1, run.dim)
        edges, others = before.followed_lattice, after.followed_lattice
        images, shifts, strain = n @ edges, n @ (others - edges), np.linalg.solve(edges, others)
    place = before.unwrapped_centres
    for i in np.flatnonzero(there):
        apart = place[there][None] - place[i] + images[:, None]
        change = moved[there][None] - moved[i] + shifts[:, None] - apart @ (strain - np.eye(run.dim))
        r = np.linalg.norm(apart, axis=2)
        weight = np.exp(-r**2 / (2 * width**2)) * (r <= 4 * width)
        np.testing.assert_allclose(found[i], -np.einsum("kj,kjd->d", weight, change) / weight.sum(), atol=1e-10)


def test_motion_between_frames_of_a_sheared_box(tmp_path):
    """D²_min from frames before and after the lattice was described by another edge, against positions that nothing has
    wrapped; displacements are those of the velocities."""
    run = pliant.shear(n=40, path="quench", fraction=0.9, shear_rate=0.05, strain=1.6, frame_interval=0.5, quiet=True,
                       output=tmp_path / "run")
    frames = [f for f in run.frames if 0.4 < f.attribute("strain") < 0.6]
    before, after = frames[0], frames[-1]
    assert after.attribute("edge_shortened_by") - before.attribute("edge_shortened_by") == 1
    assert after.followed_lattice[1, 0] == pytest.approx(after.attribute("strain") * after.box[1, 1])
    parts = [analysis.Particles(f.unwrapped_centres, box=f.box, tilt=[f.attribute("strain") * f.box[1, 1]])
             for f in (before, after)]
    found, expected = analysis.d2_min(before, after), analysis.d2_min(*parts)
    assert found[0] == pytest.approx(expected[0], abs=1e-12) and np.array_equal(found[1], expected[1])
    assert 1e-4 < np.median(found[0]) < 5
    one, other = run.frames[10], run.frames[11]
    step = other.time - one.time
    moved = other.displacements(one)
    # A particle in another image has the velocity of that image.
    shift = one.images @ one.followed_lattice
    mean = (one.velocities + other.velocities) / 2 + 0.05 * np.stack([shift[:, 1], 0 * shift[:, 1]], 1)
    assert np.abs(moved - step * mean).max() < 0.05
