"""Figures of the analysis of a channel."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from synthetic_channel import channel_tracks, tracks_table, write_channel_run
from test_plots import DPI, assert_picture, call, drawn  # noqa: F401  (fixtures)

from pliant import RunError, analyse_command, channel_analysis as channel, tracks
from pliant import channel_figures as figures

ONE = ("field", "snapshot", "distance", "clock", "rotation")
MANY = ("sizes", "peaks", "polydispersity", "interval", "histogram")


@pytest.fixture(scope="module")
def analysed(tmp_path_factory):
    """A run and two tables, of other disks, with their analyses."""
    folder = tmp_path_factory.mktemp("figures")
    write_channel_run(folder / "run", channel_tracks())
    for name, disks in (("a", 120), ("b", 60)):
        table = tracks_table(channel_tracks(disks=disks, seed=disks))
        if name == "b":
            table = table.drop(columns="angle")
        table.to_csv(folder / f"{name}.csv", index=False, float_format="%.17g")
    analyse_command.main(["channel", *(str(folder / name) for name in ("run", "a.csv", "b.csv")), "--interval", "1",
                          "--skip-pushes", "0", "--intervals", "0.2", "1.4", "4", "--clock-intervals", "4",
                          "--min-count", "3"])
    return folder


@pytest.mark.parametrize("name", ONE)
def test_figures_of_one_run(name, analysed, call, tmp_path):  # noqa: F811
    call(f"channel_{name}.py", analysed / "run", "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")


@pytest.mark.parametrize("name", MANY)
def test_figures_of_many_runs(name, analysed, call, tmp_path):  # noqa: F811
    call(f"channel_{name}.py", analysed / "run", analysed / "a.csv", analysed / "b.csv", "-o", tmp_path / "a.png")
    assert_picture(tmp_path / "a.png")


def test_axes_have_units(analysed, drawn):  # noqa: F811
    for name in ("field", "snapshot", "clock"):
        figure, _ = drawn(f"channel_{name}.py", analysed / "run")
        maps = [axes for axes in figure.axes if axes.get_aspect() == 1]
        assert len(maps) >= 2
        for axes in maps:
            assert axes.get_xlabel() == "$x$  [cm]" and axes.get_ylabel() == "$y$  [cm]"
    figure, _ = drawn("channel_rotation.py", analysed / "run")
    assert "[rad]" in figure.axes[0].get_ylabel()


def test_the_map_shows_the_cells_where_they_are(analysed, drawn):  # noqa: F811
    figure, _ = drawn("channel_field.py", analysed / "run")
    mesh = figure.axes[1].collections[0]
    cells = figures.load_result(analysed / "run")["cells"]
    values = mesh.get_array().reshape(mesh.get_coordinates().shape[0] - 1, -1)
    corners = mesh.get_coordinates()
    k = int(np.nanargmax(cells["strain"]))
    row, column = np.argwhere(values == cells["strain"][k])[0]
    assert_allclose(corners[row, column] + 0.8, [cells["x"][k], cells["y"][k]])


def test_polydispersity_joins_runs_of_one_distribution(analysed, drawn):  # noqa: F811
    paths = [analysed / name for name in ("run", "a.csv", "b.csv")]
    named = figures.results(paths)
    delta, value, error, runs = figures.by_polydispersity(named, lambda result: result["dr_na"]["all"])
    assert len(delta) == 2 and sorted(runs) == [1, 2]
    two = [result["dr_na"]["all"]["value"] for _, result in named[:2]]
    at = int(np.argmax(runs))
    assert_allclose([value[at], error[at]], [np.mean(two), abs(two[0] - two[1]) / 2])
    _, text = drawn("channel_polydispersity.py", *paths, "--clock", "--sum")
    assert "d2_min_sum (all): slope" in text
    figure, _ = drawn("channel_polydispersity.py", *paths, "--region", "centre")
    assert len(figure.axes) == 3


def test_a_snapshot_has_the_samples_of_the_analysis(analysed):
    run = tracks.load(analysed / "run")
    choices = figures.choices_of(figures.load_result(analysed / "run"))
    shot = channel.snapshot(run, choices, number=1, travel=0.4)
    push = run.oriented("odd").pushes[1]
    assert shot["push"] == 1 and shot["travel"] == pytest.approx(0.4)
    assert_allclose(shot["position"], push.position[2])
    assert_allclose(shot["shift"], push.position[7] - push.position[2])
    assert all(len(near) == 15 and i not in near for i, near in enumerate(shot["neighbours"]))
    known = np.isfinite(shot["dr_na"])
    assert known.sum() > 60
    assert_allclose(shot["dr_na"][known], np.hypot(*(shot["shift"] - shot["mean"]).T)[known])


def test_errors(analysed, call, capsys, tmp_path):  # noqa: F811
    for arguments, text in ((["channel_field.py", tmp_path], "pliant-analyse channel"),
                            (["channel_rotation.py", analysed / "b.csv"], "no angles"),
                            (["channel_snapshot.py", analysed / "run", "--push", 9],
                             "no push 9 (there are 0, 1, 2, 3)")):
        with pytest.raises(SystemExit) as stop:
            call(*arguments, "-o", tmp_path / "a.png")
        said = capsys.readouterr().err
        assert stop.value.code == 2 and text in said and len(said.splitlines()) == 1


def test_one_size_distribution_is_one_system(call, capsys, tmp_path):  # noqa: F811
    """Runs that are averaged differ in their disks alone, and are analysed in the same way."""
    runs = [write_channel_run(tmp_path / f"{mu_disk}-{seed}", channel_tracks(seed=seed), mu_disk=mu_disk, seed=seed)
            for mu_disk, seed in ((0.4, 1), (0.4, 2), (0.9, 3))]
    quick = ("--interval", "1", "--skip-pushes", "0", "--intervals", "0.2", "1.4", "4", "--clock-intervals", "4", "--min-count", "3")
    analyse_command.main(["channel", *map(str, runs), *quick])
    with pytest.raises(SystemExit):
        call("channel_polydispersity.py", *runs, "-o", tmp_path / "a.png")
    assert "differ in -mu_disk (0.4 and 0.9)" in capsys.readouterr().err
    assert figures.distinct([runs[0], runs[1], runs[0]]) == runs[:2]
    analyse_command.main(["channel", str(runs[1]), *quick, "--neighbours", "12"])
    with pytest.raises(RunError, match=r"their analyses differ in --neighbours \(15 and 12\)"):
        figures.distinct(runs[:2])
    for paths, text in ((runs, "differ in -mu_disk"), ([runs[0], runs[0]], "given several times")):
        with pytest.raises(RunError, match=text):
            analyse_command.main(["channel", *map(str, paths), *quick, "--field", "pooled"])
