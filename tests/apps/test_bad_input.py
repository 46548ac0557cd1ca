"""Every error in the input gives a message of one line and exit code 2 (4 for the output); nothing is written."""

import json
import subprocess
from pathlib import Path

import pytest
from conftest import HANGS, PROGRAM, SMALL, Results, arguments, hopper, pliant


def assert_refused(result, *words, code=2):
    assert result.returncode == code, result.stderr
    lines = result.stderr.splitlines()
    assert len(lines) == 1 and lines[0].startswith("pliant: error: "), result.stderr
    assert "internal" not in lines[0]
    for word in words:
        assert word in lines[0]


def run_program(*command):
    """As `pliant`, of texts, bytes and paths."""
    return subprocess.run([PROGRAM, *command], encoding="utf-8", errors="surrogateescape", capture_output=True, timeout=HANGS)


OVERDAMPED = ["-dynamics", "overdamped", "-integrator", "ts", "-mu", "0", "-zeta", "1"]
OPTIONS = {
    "unknown": (["-frobnicate", "3"], ["-frobnicate", "-help"]),
    "misspelt": (["-hopper_widht", "3"], ["-hopper_widht", "did you mean -hopper_width?"]),
    "misspelt_choice": (["-model", "rouhg"], ["-model rouhg", "did you mean rough?"]),
    "misspelt_ts": (["-integrator", "ts", "-ts_rtoll", "1e-3"], ["-ts_rtoll", "-ts_rtol"]),
    "unused_ts": (["-integrator", "verlet", "-ts_rtol", "1e-3"], ["-ts_rtol"]),
    "ts_without_ts": (["-ts_type", "cvode"], ["-ts_type cvode", "-integrator ts"]),
    "area_of_soft_particles": (["-model", "sp", "-k_a", "5"], ["-k_a", "-model sp", "-model rough or smooth"]),
    "contact_of_rough_particles": (["-model", "rough", "-e_sp", "100"], ["-e_sp", "-model rough", "use -model sp"]),
    "width_of_rough_edges": (["-model", "rough", "-edge_width", "0.2"], ["-edge_width", "-model rough", "smooth"]),
    "spread_of_two_sizes": (["-size_deviation", "0.1"], ["-size_deviation", "-size_distribution bidisperse", "normal"]),
    "jacobian_of_verlet": (["-jacobian", "matrix_free"], ["-jacobian", "-integrator verlet", "-integrator ts"]),
    "step_too_long": (["-dt", "7e-3"], ["-dt 0.007 is 1.65 times", "0.00424", "-allow_unstable_dt"]),
    "step_too_long_for_friction": (["-mu", "1e3", "-dt", "1e-3"], ["-dt 0.001 is 22 times", "-allow_unstable_dt"]),
    "step_too_long_for_ts": (["-integrator", "ts", "-ts_type", "euler", "-dt", "7e-3"], ["-dt 0.007 is 5.27e+03 times"]),
    "step_longer_than_the_run": (["-dt", "1e300"], ["-dt 1e+300 is longer than the run, -t_end 6"]),
    "first_step_longer_than_the_run": (["-integrator", "ts", "-dt", "7"], ["-dt 7 is longer than the run"]),
    "run_shorter_than_the_step": (["-t_end", "1e-4"], ["the step 0.001 is longer than the run, -t_end 0.0001; give a shorter -dt"]),
    "unknown_ts_type": (["-integrator", "ts", "-ts_type", "rkk"], ["-ts_type rkk"]),
    "other_ts_type": (["-integrator", "ts", "-ts_type", "pseudo"], ["-ts_type pseudo"]),
    "overdamped_verlet": (["-dynamics", "overdamped"], ["-dynamics overdamped", "-integrator ts"]),
    "overdamped_friction": (["-dynamics", "overdamped", "-integrator", "ts"], ["-mu 0.5"]),
    "overdamped_ts_verlet": ([*OVERDAMPED, "-ts_type", "verlet"], ["-ts_type verlet", "motion with inertia"]),
    "overdamped_implicit": ([*OVERDAMPED, "-ts_type", "bdf"], ["ts:bdf needs derivatives", "-ts_type"]),
    "negative": (["-hopper_width", "-1"], ["-hopper_width -1", "greater than 0"]),
    "zero": (["-hopper_width", "0"], ["-hopper_width 0", "greater than 0"]),
    "w_not_below_W": (["-hopper_width", "8"], ["8", "-hopper_wall_distance"]),
    "nan": (["-hopper_width", "nan"], ["-hopper_width nan", "not a finite number"]),
    "infinite": (["-t_end", "inf"], ["-t_end inf", "not a finite number"]),
    "no_number": (["-zeta", "much"], ["-zeta much"]),
    "no_value": (["-zeta"], ["-zeta", "needs a value"]),
    "fraction_of_a_particle": (["-n", "10.5"], ["-n 10.5", "not an integer"]),
    "negative_count": (["-n", "-1"], ["-n -1", "at least 0"]),
    "wide edges of surfaces": (["-dim", "3", "-model", "smooth", "-edge_width", "0.6"], ["-edge_width 0.6", "-dim 3", "0.5"]),
    "steep": (["-hopper_angle", "91"], ["-hopper_angle 91", "degrees"]),
    "flat on one side": (["-hopper_angle_left", "0"], ["angles 0 of the left wall and 90", "-outline"]),
    "a cone with two angles": (["-dim", "3", "-hopper_angle_left", "0"], ["-hopper_angle_left", "-dim 3", "-dim 2"]),
    "wide_sizes": (["-size_distribution", "normal", "-size_deviation", "0.4"], ["-size_deviation 0.4"]),
    "rounder_than_regular": (["-model", "rough", "-shape_parameter", "1"], ["-shape_parameter 1", "1.013"]),
    "wider_than_hopper": (["-hopper_wall_distance", "1.1", "-hopper_width", "0.5"], ["1.17", "-hopper_wall_distance"]),
    "missing_file": (["-options_file", "absent.yaml"], ["absent.yaml"]),
    "folder_as_file": (["-options_file", "/"], ["/", "folder"]),
    "restart_from_nothing": (["-restart", "absent"], ["absent", "checkpoint"]),
    "width_by_a_letter": (["-w", "3"], ["unknown option -w", "did you mean -hopper_width?"]),
    "not_text": (["-output", b"caf\xe9"], ["-output caf\\xe9", "UTF-8"]),
    "newline": (["-options_file", "a\nb"], ["-options_file a\\x0ab"]),
    "long_value": (["-output", "x" * 5000], ["too long", "(5000 bytes)"]),
    "endless_file": (["-options_file", "/dev/zero"], ["/dev/zero", "is a device, not a file"]),
    "stray_word": (["surprise"], ["surprise"]),
}


@pytest.mark.parametrize("name", OPTIONS)
def test_bad_option(name, tmp_path):
    extra, words = OPTIONS[name]
    output = [] if "-restart" in extra else ["-output", tmp_path / "run"]
    assert_refused(run_program("hopper", *arguments(SMALL), *output, *extra), *words)
    assert list(tmp_path.iterdir()) == []


RAFT = ["raft", "-rows", "3", "-columns", "3", "-t_end", "5"]
PETSC = {
    "mobility_type": (["-mobility_ksp_type", "x"], ["PETSc", "KSP type x"]),
    "mobility_preconditioner": (["-mobility_pc_type", "x"], ["PETSc", "PC type x"]),
    "mobility_view": (["-mobility_ksp_view", "nonsense"], ["PETSc", "viewer nonsense"]),
    "mobility_package": (["-mobility_pc_factor_mat_solver_type", "x"], ["PETSc", "solver type x"]),
    "mobility_ordering": (["-mobility_pc_factor_mat_ordering_type", "x"], ["PETSc", "type: x"]),
    "memory_view": (["-memory_view", "1e-3"], ["-memory_view 1e-3", "takes no value"]),
    "options_view": (["-options_view", "x"], ["-options_view x", "takes no value"]),
    "options_left": (["-options_left", "x"], ["-options_left x", "takes no value"]),
    "citations": (["-citations", "/nonexistent/x"], ["-citations /nonexistent/x", "takes no value"]),
    "info": (["-info", "1"], ["-info 1", "takes no value"]),
    "log_view": (["-log_view", "1e-3"], ["-log_view 1e-3", "viewer 1e-3"]),
    "log_view_format": (["-log_view", ":/dev/null:nonsense"], ["-log_view :/dev/null:nonsense"]),
    "log_view_file": (["-log_view", ":/nonexistent/x"], ["-log_view :/nonexistent/x"]),
    "windows": (["-ts_monitor_lg_timestep"], ["unknown option -ts_monitor_lg_timestep"]),
    "windows of spectra": (["-ts_monitor_sp_eig"], ["unknown option -ts_monitor_sp_eig"]),
    "windows of eigenvalues": (["-ksp_plot_eigenvalues"], ["unknown option -ksp_plot_eigenvalues"]),
    "tests without a matrix": (["-ts_rhs_jacobian_test_mult"], ["unknown option -ts_rhs_jacobian_test_mult"]),
    "swarms": (["-ts_dmswarm_monitor_moments"], ["unknown option -ts_dmswarm_monitor_moments"]),
    "formats of PETSc's log": (["-log_view", "::ascii_xml"], ["-log_view ::ascii_xml", "crashes"]),
    "drawing": (["-ts_monitor", "draw"], ["-ts_monitor draw", "windows"]),
    "trajectory": (["-ts_save_trajectory"], ["-ts_save_trajectory"]),
    "dump": (["-objects_dump"], ["unknown option -objects_dump"]),
    "debugger": (["-start_in_debugger"], ["unknown option -start_in_debugger"]),
    "abort": (["-on_error_abort"], ["unknown option -on_error_abort"]),
    "rk_type": (["-ts_rk_type", "x"], ["PETSc", "'x'"]),
    "number": (["-ts_rtol", "1e-3x"], ["PETSc", "1e-3x"]),
    "without_number": (["-ts_atol"], ["-ts_atol", "needs a value"]),
    "without_type": (["-ts_type", "-ts_monitor"], ["-ts_type", "needs a value"]),
}


@pytest.mark.parametrize("name", PETSC)
def test_bad_petsc_option(name, tmp_path):
    extra, words = PETSC[name]
    assert_refused(run_program(*RAFT, "-output", tmp_path / "run", *extra), *words)


@pytest.mark.parametrize("scenario, end", [("raft", {}), ("clog", {"t_end": 10})])
def test_droplets_step_longer_than_the_run(scenario, end, tmp_path):
    result = pliant(scenario, output=tmp_path / "run", dt=1e300, **end)
    assert_refused(result, "-dt 1e+300 is longer than the run")
    assert list(tmp_path.iterdir()) == []


def warnings(**options):
    result = pliant("hopper", **{**SMALL, "t_end": 0.1, **options})
    return result.returncode, result.stderr


def test_long_steps_are_warned_of(tmp_path):
    code, text = warnings(dt=3.5e-3, mu=0, output=tmp_path / "long")
    assert code == 0 and "warning: -dt 0.0035 is 0.81 of the limit of stability" in text and len(text.splitlines()) == 1
    assert warnings(dt=3e-3, mu=0, output=tmp_path / "shorter") == (0, "")
    code, text = warnings(dt=7e-3, mu=0, output=tmp_path / "allowed", allow_unstable_dt="true")
    assert code == 0 and "is 1.61 of the limit" in text


@pytest.mark.parametrize("options", [{}, {"mu": 1e3}, {"mu": 0, "zeta": 1e3}, {"mu": 0, "zeta": 0, "flow": "discharge"}, {"e_w": 1e7}, {"model": "rough", "n": 20},
                                     {"mu": 0, "flow": "discharge"}, {"integrator": "ts"}, {"integrator": "ts", "dt": 0.05}])
def test_the_standard_step_is_not_warned_of(options, tmp_path):
    assert warnings(output=tmp_path / "run", **{"t_end": 0.1, **options}) == (0, "")


def test_particles_that_pass_through_each_other_are_warned_of(tmp_path):
    code, text = warnings(mu=0, e_sp=1e-3, t_end=4, output=tmp_path / "run")
    assert code == 0 and "they pass through each other; raise -e_sp, now 0.001" in text
    measured = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))
    assert measured["passing_overlap"] > 0.95 and measured["Q"]["value"] > 0 and measured["Q"]["error"] is None
    assert warnings(mu=0, e_sp=20, t_end=4, output=tmp_path / "soft") == (0, "")


def test_a_flow_that_has_ended_without_a_clog_is_warned_of(tmp_path):
    """Without drag a sphere on the floor bounces for ever."""
    code, text = warnings(n=1, hopper_width=0.1, mu=0, zeta=0, flow="discharge", t_end=20, output=tmp_path / "run")
    assert code == 0 and "warning: no particle has crossed the orifice since t = 0 t0" in text and "neither as clogged nor as at rest" in text
    assert warnings(n=1, hopper_width=0.1, mu=0, zeta=1, flow="discharge", t_end=100, output=tmp_path / "drag") == (0, "")


def test_advice_of_a_failure_names_a_long_step_first(tmp_path):
    result = pliant("hopper", output=tmp_path / "run", **{**SMALL, "mu": 0, "dt": 0.02, "t_end": 100}, allow_unstable_dt="true")
    assert result.returncode == 3
    error = result.stderr.splitlines()[-1]
    assert error.startswith("pliant: error: -dt 0.02 is 4.6 times the limit of stability: shorten it first; "), error


YAML = {
    "broken": ("hopper:\n  width: [3\n", ["bad.yaml"]),
    "tab": ("hopper:\n\twidth: 3\n", ["bad.yaml"]),
    "unknown": ("hopper:\n  widht: 3\n", ["hopper_widht", "did you mean -hopper_width?", "bad.yaml:2"]),
    "value": ("t_end: soon\n", ["t_end", "bad.yaml"]),
    "large": ("n: 5 #" + "x" * 70000, ["bad.yaml", "too large"]),
    "alias_bomb": ("a0: &a0 {x: 1, y: 1}\n" + "".join(
        f"a{i + 1}: &a{i + 1} {{{', '.join(f'k{k}: *a{i}' for k in range(9))}}}\n" for i in range(12)),
        ["bad.yaml", "aliases"]),
    "empty_alias_bomb": ("a0: &a0 {}\n" + "".join(
        f"a{i + 1}: &a{i + 1} {{{', '.join(f'k{k}: *a{i}' for k in range(9))}}}\n" for i in range(12)),
        ["bad.yaml", "aliases"]),
    "deep": ("".join(f"{' ' * i}a:\n" for i in range(100)), ["bad.yaml", "deeper"]),
    "deep_list": ("a: " + "[" * 30000, ["bad.yaml"]),
    "newline_in_value": ("output: |\n  a\n  b\n", ["bad.yaml:1", "control characters"]),
}


@pytest.mark.parametrize("name", YAML)
def test_bad_options_file(name, tmp_path):
    text, words = YAML[name]
    (tmp_path / "bad.yaml").write_text(text, encoding="utf-8")
    assert_refused(pliant("hopper", options_file=tmp_path / "bad.yaml", output=tmp_path / "run"), *words)
    assert not (tmp_path / "run").exists()


def test_options_file_and_command_line(tmp_path):
    (tmp_path / "run.yaml").write_text("hopper:\n  width: 2.5\n  wall_distance: 6\nn: 20\nt_end: 0.1\n", encoding="utf-8")
    result = pliant("hopper", options_file=tmp_path / "run.yaml", n=30, output=tmp_path / "run")
    assert result.returncode == 0, result.stderr
    parameters = json.loads((tmp_path / "run/summary.json").read_text(encoding="utf-8"))["parameters"]
    assert parameters["hopper_width"]["value"] == 2.5 and parameters["n"]["value"] == 30


def test_no_scenario():
    assert_refused(pliant(), "no scenario", "-help")


def test_unknown_scenario():
    assert_refused(pliant("hoper"), "unknown scenario 'hoper'", "did you mean 'hopper'?")


def test_output_folder_that_is_a_file(tmp_path):
    (tmp_path / "run").write_text("mine", encoding="utf-8")
    assert_refused(pliant("hopper", output=tmp_path / "run", **SMALL), str(tmp_path / "run"), code=4)
    assert (tmp_path / "run").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("folder", ["file/run", "/proc/pliant-run"])
def test_output_folder_that_cannot_be_made(folder, tmp_path):
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    assert_refused(pliant("hopper", output=tmp_path / folder, **SMALL), folder, "-output", code=4)


def test_output_folder_that_holds_a_run(tmp_path):
    hopper(tmp_path / "run", t_end=0.1)
    before = {path.name: path.read_bytes() for path in (tmp_path / "run").iterdir()}
    assert_refused(pliant("hopper", output=tmp_path / "run", **SMALL), "holds a run that is finished (done)", "-restart", "-output")
    assert {path.name: path.read_bytes() for path in (tmp_path / "run").iterdir()} == before


def test_restart_from_a_folder_without_checkpoint(tmp_path):
    (tmp_path / "run").mkdir()
    assert_refused(pliant("hopper", restart=tmp_path / "run"), str(tmp_path / "run"), "checkpoint")
    assert list((tmp_path / "run").iterdir()) == []


SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
CASES = {
    "missing": (None, ["case.json", "No such file"]),
    "broken": ("{\"model\": \"DP\", \"inputs\": {", ["case.json"]),
    "no_model": ({"inputs": {}}, ["model"]),
    "self_intersecting": ({"vertices": [[[0, 0], [1, 1], [1, 0], [0, 1]]]}, ["inputs.vertices[0]", "crosses or touches itself"]),
    "concave_that_touches_itself": ({"vertices": [[[0, 0], [2, 0], [2, 2], [1, 0], [0, 2]]]},
                                    ["inputs.vertices[0]", "crosses or touches itself"]),
    "clockwise": ({"vertices": [SQUARE[::-1]]}, ["inputs.vertices[0]", "counter-clockwise"]),
    "two_vertices": ({"vertices": [SQUARE[:2]]}, ["inputs.vertices[0]", "at least 3"]),
    "edge_without_length": ({"vertices": [[SQUARE[0], *SQUARE]]}, ["inputs.vertices[0][0]", "length"]),
    "deep": ("[" * 100000, ["case.json", "nested deeper"]),
    "deep_and_closed": ("{\"model\":" + "[" * 100000 + "]" * 100000 + "}", ["case.json", "nested deeper"]),
    "deep_unknown": ("{\"note\":" + "[" * 70 + "]" * 70 + "}", ["case.json", "nested deeper"]),
    "key_twice": ("{\"model\": \"SP\", \"inputs\": {\"dim\": 2, \"mu\": 1, \"mu\": 2}}", ["case.json", "\"mu\"", "twice"]),
    "not_json": ("\u2028\x1b[31m" * 1000, ["case.json"]),
    "misspelt_key": ({"vertices": [SQUARE], "k_a": 1}, ["k_a", "ka"]),
}


@pytest.mark.parametrize("name", CASES)
def test_bad_case(name, tmp_path):
    case, words = CASES[name]
    file = tmp_path / "case.json"
    if isinstance(case, dict) and "vertices" in case:
        case = {"model": "DP", "inputs": {"a0": [1], "l0": [1], "ka": 1, "kl": 1, "kb": 1, **case}}
    if case is not None:
        file.write_text(case if isinstance(case, str) else json.dumps(case), encoding="utf-8")
    assert_refused(pliant("evaluate", file), *words)


def test_endless_case():
    assert_refused(pliant("evaluate", "/dev/zero"), "/dev/zero", "is a device, not a file")


def test_case_without_faults(tmp_path):
    file = tmp_path / "case.json"
    file.write_text(json.dumps({"model": "DP", "inputs": {"vertices": [SQUARE], "a0": [1], "l0": [1], "ka": 1, "kl": 1,
                                                          "kb": 0}}), encoding="utf-8")
    result = pliant("evaluate", file)
    assert result.returncode == 0 and json.loads(result.stdout)["area"] == pytest.approx(1)


def test_evaluate_needs_one_file():
    assert_refused(pliant("evaluate"), "usage: pliant evaluate")


def run_into(path, *command, stream="stdout"):
    """The program with one stream redirected to a file; returns the exit code and the other stream."""
    other = {"stdout": "stderr", "stderr": "stdout"}[stream]
    with open(path, "w", encoding="utf-8") as file:
        result = subprocess.run([PROGRAM, *map(str, command)], encoding="utf-8", timeout=HANGS,
                                **{stream: file, other: subprocess.PIPE})
    return result.returncode, getattr(result, other)


CASE = Path(__file__).resolve().parents[1] / "data/evaluate/sp2d_01_pair.json"


@pytest.mark.parametrize("command", [["evaluate", CASE], ["-help"], ["-version"], ["hopper", "-help"],
                                     ["raft", "-version"], ["evaluate", "-help"]], ids=lambda c: " ".join(map(str, c)))
def test_a_result_that_cannot_be_written(command):
    code, errors = run_into("/dev/full", *command)
    assert code == 4 and errors == "pliant: error: standard output cannot be written: No space left on device\n"


@pytest.mark.parametrize("redirection", [">/dev/full", ">&-"])
def test_a_run_goes_on_without_its_output(redirection, tmp_path):
    options = " ".join(arguments({**SMALL, "t_end": 0.2}))
    result = subprocess.run(f"{PROGRAM} hopper {options} -output {tmp_path}/run {redirection}", shell=True, encoding="utf-8",
                            stderr=subprocess.PIPE, timeout=HANGS)
    assert result.returncode == 0 and len(result.stderr.splitlines()) == 1, result.stderr
    assert result.stderr.startswith("pliant: warning: standard output cannot be written: ")
    assert Results(tmp_path / "run").summary["status"] == "done"


def test_errors_that_cannot_be_written():
    assert run_into("/dev/full", "hopper", "-n", "x", stream="stderr") == (2, "")


def test_evaluate_tells_its_usage():
    assert pliant("evaluate", "-help").stdout.startswith("usage: pliant evaluate CASE.json")
    assert pliant("evaluate", "-h").stdout == pliant("evaluate", "-help").stdout
    assert_refused(pliant("evaluate", "-x"), "unknown option -x", "usage: pliant evaluate CASE.json")
