"""A user program with a user-defined model in pliant's hopper: examples/own_term."""

import os
import subprocess

import numpy as np
import pytest
from conftest import HANGS, Results, arguments, assert_same_runs

PROGRAM = os.environ.get("PLIANT_OWN_TERM")
POLYGONS = {"model": "line_tension", "tension": 30, "n": 30, "n_vertices": 12, "hopper_wall_distance": 7, "hopper_width": 3,
            "pack_fraction": 0.7, "e_c": 500, "e_w": 500, "k_a": 1000, "zeta": 0.3, "t_end": 3, "frame_interval": 0.5,
            "sample_interval": 0.1}

pytestmark = pytest.mark.skipif(not PROGRAM, reason="PLIANT_OWN_TERM does not name the program")


def own(*command, **options):
    return subprocess.run([PROGRAM, *map(str, command), *arguments(options)], encoding="utf-8", capture_output=True, timeout=HANGS)


def tense_polygons(folder, **options):
    result = own("hopper", output=folder, **{**POLYGONS, **options})
    assert result.returncode == 0, result.stderr
    return Results(folder)


def test_help_lists_the_model_and_its_option():
    text = own("hopper", "-help").stdout
    assert text.startswith("usage: own_term hopper [") and "Model line_tension" in text
    assert "line_tension: polygons with a line tension" in text
    line = next(line for line in text.splitlines() if line.startswith("  -tension "))
    assert "rho g sigma_avg^2" in line or "rho g sigma_avg^2" in text[text.index(line):].split("\n  -")[0]


@pytest.mark.parametrize("options, message", (
    ({"k_l": 1}, "-k_l (command line) with -model line_tension, which does not read it; leave it out, or use -model rough or smooth"),
    ({"e_sp": 1}, "-e_sp (command line) with -model line_tension"),
    ({"contact_law": "hertz"}, "-contact_law (command line) with -model line_tension"),
    ({"model": "smooth"}, "-tension (command line) with -model smooth, which does not read it; leave it out, or use -model "
                          "line_tension"),
    ({"tension": -1}, "-tension -1"),
    ({"tensoin": 1}, "did you mean -tension?"),
    ({"model": "line"}, "line_tension"),
    ({"dim": 3}, "-model line_tension does not exist in 3D"),
))
def test_options_that_do_not_fit_are_refused(tmp_path, options, message):
    result = own("hopper", output=tmp_path / "run", **{**POLYGONS, **options})
    assert result.returncode == 2 and result.stderr.startswith("own_term: error: ") and message in result.stderr
    assert not (tmp_path / "run").exists()


def test_half_a_run_and_the_other_half_are_the_whole(tmp_path):
    whole = tense_polygons(tmp_path / "whole")
    tense_polygons(tmp_path / "halves", t_end=POLYGONS["t_end"] / 2)
    result = own("hopper", restart=tmp_path / "halves", t_end=POLYGONS["t_end"])
    assert result.returncode == 0, result.stderr
    assert_same_runs(whole, Results(tmp_path / "halves"))
    assert whole.summary["model"] == "line_tension" and whole.summary["parameters"]["tension"]["value"] == 30
    assert len(whole.frames) == 7 and whole.summary["crossed_count"] > 0
    changed = own("hopper", restart=tmp_path / "halves", t_end=4, tension=31)
    assert changed.returncode == 2 and "-tension" in changed.stderr


def test_a_polygon_that_sinks_obeys_laplace(tmp_path):
    """Drag and weight are the same for all of its points, so it is a regular polygon with the pressure γ/r."""
    tension, stiffness = 30, 1000
    run = tense_polygons(tmp_path / "run", n=1, size_distribution="mono", tension=tension, zeta=20, t_end=1)
    area, perimeter = (run.frames[-1][name][0] for name in ("area", "perimeter"))
    assert stiffness * (np.pi / 4 - area) == pytest.approx(tension * perimeter / (2 * area), rel=1e-4)
    assert perimeter**2 / (4 * area) == pytest.approx(12 * np.tan(np.pi / 12), rel=1e-6)


def test_the_term_is_checked():
    result = own("check", 2)
    assert result.returncode == 0 and result.stdout.count(" ok") == 4, result.stdout + result.stderr
    assert own("check", "two").returncode == 2
