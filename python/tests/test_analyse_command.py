"""pliant-analyse as a user starts it, and its files."""

import argparse
import json
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import h5py
import pytest
from synthetic_channel import channel_tracks, tracks_table, write_channel_run

from pliant import OutputError, RunError, analyse_command, channel_analysis as channel

COMMAND = Path(__file__).resolve().parents[1] / "pliant-analyse"
QUICK = ["--interval", "1", "--skip-pushes", "1", "--intervals", "0.2", "1.4", "4", "--clock-intervals", "4"]

# Names that scripts and papers rely on.
FIXED = ("dr_na", "d2_min_sum", "d2_min_per_neighbour", "exponent_dr_na", "exponent_d2_min", "rotation")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with the run `run` and its table `tracks.csv`."""
    folder = tmp_path_factory.mktemp("channel")
    tracks = channel_tracks()
    write_channel_run(folder / "run", tracks)
    tracks_table(tracks).to_csv(folder / "tracks.csv", index=False, float_format="%.17g")
    return folder


def headline(path):
    result = analyse_command.load_result(path)
    return [result[name][region][part] for name in FIXED for region in ("all", "centre") for part in ("value", "error")]


def test_it_writes_the_fixed_names(made):
    result = subprocess.run([sys.executable, COMMAND, "channel", made / "run", *QUICK], capture_output=True, encoding="utf-8")
    assert result.returncode == 0, result.stderr
    assert f"wrote {made / 'run/analysis.json'}" in result.stdout and "| dr_na " in result.stdout
    written = json.loads((made / "run/analysis.json").read_text(encoding="utf-8"))
    for name in FIXED:
        assert written[name].keys() == {"all", "centre"}
        for entry in written[name].values():
            assert entry.keys() == {"value", "error"} and entry["value"] > 0 and entry["error"] > 0, name
    assert written["d2_min_sum"]["all"]["value"] == pytest.approx(15 * written["d2_min_per_neighbour"]["all"]["value"])
    assert {f.name for f in fields(channel.Choices)} == written["choices"].keys()
    assert written["choices"]["interval"] == 1 and written["choices"]["skip_pushes"] == 1
    assert written["units"]["length"] == "cm" and written["pushes"] == 3
    assert written["interval"] == {"travel": pytest.approx(1), "time": pytest.approx(1 / 0.22)}


def test_a_table_gives_the_same_as_its_run(made, capsys):
    analyse_command.main(["channel", str(made / "run"), str(made / "tracks.csv"), *QUICK])
    assert f"wrote {made / 'tracks.analysis.json'}" in capsys.readouterr().out
    assert headline(made / "tracks.csv") == pytest.approx(headline(made / "run"), rel=1e-9)
    assert analyse_command.load_result(made / "tracks.csv")["choices"]["table"]["fps"] == 6


def test_pixels(made, tmp_path):
    """Another scale, origin and direction of y, angles in degrees: the same numbers."""
    tracks = tracks_table(channel_tracks())
    pixels = tracks.assign(x=100 + 40 * tracks["x"], y=1600 - 40 * tracks["y"], r=40 * tracks["r"],
                           angle=-57.29577951308232 * tracks["angle"])
    pixels.to_csv(tmp_path / "pixels.csv", index=False, float_format="%.17g")
    for path, more in ((made / "tracks.csv", []), (tmp_path / "pixels.csv", [
            "--scale", "0.025", "--origin", "100", "1600", "--flip-y", "--angle-unit", "degrees"])):
        analyse_command.main(["channel", str(path), *QUICK, "-o", str(tmp_path / f"{path.stem}.json"), *more])
    assert headline(tmp_path / "pixels.json") == pytest.approx(headline(tmp_path / "tracks.json"), rel=1e-6)


def test_without_pushes_to_compare_there_is_no_error_bar(made, tmp_path):
    analyse_command.main(["channel", str(made / "run"), *QUICK, "--skip-pushes", "3", "-o", str(tmp_path / "one.json")])
    written = json.loads((tmp_path / "one.json").read_text(encoding="utf-8"))
    assert written["dr_na"]["all"]["value"] > 0 and written["dr_na"]["all"]["error"] is None


def test_errors(made, tmp_path):
    def failure(*arguments, error=RunError):
        with pytest.raises(error) as caught:
            analyse_command.main(["channel", *map(str, arguments)])
        assert "\n" not in str(caught.value)
        return str(caught.value)

    run = made / "run"
    assert "no such folder" in failure(tmp_path / "nothing")
    assert "is not a multiple" in failure(run)
    assert "--fps 0: must be more than 0" in failure(run, "--fps", 0)
    assert "--df0 -1" in failure(run, "--df0", -1)
    assert "names one file" in failure(run, run, "-o", "x.json")
    assert "does not exist" in failure(run, "-o", tmp_path / "no/x.json", error=OutputError)
    assert "is a folder" in failure(run, "-o", tmp_path, error=OutputError)
    (tmp_path / "a.csv").write_text("", encoding="utf-8")
    assert "cannot be read as a table" in failure(tmp_path / "a.csv")
    (tmp_path / "b.csv").write_text("frame,x,y,r\n1,2,3,4\n", encoding="utf-8")
    assert "no column 'particle'" in failure(tmp_path / "b.csv")
    with pytest.raises(SystemExit) as stop:
        analyse_command.main(["channel", str(run), "--average", "mean"])
    assert stop.value.code == 2
    result = subprocess.run([sys.executable, COMMAND, "channel", tmp_path], capture_output=True, encoding="utf-8")
    assert result.returncode == 2 and result.stderr.startswith("pliant-analyse: error: ") and "run.h5" in result.stderr


def test_the_page_has_every_option():
    page = (COMMAND.parents[1] / "docs/scenarios/channel-analysis.md").read_text(encoding="utf-8")
    parser = argparse.ArgumentParser(add_help=False)
    analyse_command.channel_options(parser)
    options = [action.option_strings[-1] for action in parser._actions if action.option_strings]
    assert len(options) > 30
    assert [name for name in options if f"`{name}" not in page] == []


def continued(run):
    """Adds a frame to a run."""
    with h5py.File(run / "run.h5", "a") as file:
        file.copy(file["frames/000047"], file["frames"], "000048")
        file["frames/000048"].attrs.update({"time": 100.0, "push": 4, "plunger_travel": 0.0})


def created(run):
    """Another run in the same folder."""
    with h5py.File(run / "run.h5", "a") as file:
        file["manifest"].attrs["created"] = "2026-01-01T00:00:00Z"


def begun_again(run):
    """Another run in the same folder, without frames so far."""
    with h5py.File(run / "run.h5", "a") as file:
        del file["frames"]


def of_an_older_version(run):
    result = json.loads((run / "analysis.json").read_text(encoding="utf-8"))
    del result["run"], result["format"], result["crc32"]
    (run / "analysis.json").write_text(json.dumps(result), encoding="utf-8")


@pytest.mark.parametrize("change", (continued, created, begun_again, of_an_older_version))
def test_an_analysis_of_an_earlier_state_of_the_run_is_refused(tmp_path, change):
    run = write_channel_run(tmp_path / "run", channel_tracks())
    analyse_command.main(["channel", str(run), *QUICK])
    for path in (run, run / "analysis.json"):
        assert analyse_command.load_result(path)["pushes"] == 3
    change(run)
    for path in (run, run / "analysis.json"):
        with pytest.raises(RunError, match=f"the run has changed since .* repeat it by pliant-analyse channel {run}"):
            analyse_command.load_result(path)
    if change is continued:
        analyse_command.main(["channel", str(run), *QUICK])
        assert analyse_command.load_result(run)["pushes"] == 4


def test_results_that_are_not_there(tmp_path, made):
    with pytest.raises(RunError, match="pliant-analyse channel"):
        analyse_command.load_result(tmp_path)
    (tmp_path / "x.json").write_text("{}", encoding="utf-8")
    with pytest.raises(RunError, match="not an analysis"):
        analyse_command.load_result(tmp_path / "x.json")
    (tmp_path / "x.json").write_text("{", encoding="utf-8")
    with pytest.raises(RunError, match="JSON"):
        analyse_command.load_result(tmp_path / "x.json")
