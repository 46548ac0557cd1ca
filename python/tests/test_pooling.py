"""Runs are averaged and fitted together if they differ in nothing but the variables of a figure, the seed, and options without
influence on the physics."""

import h5py
import numpy as np
import pandas as pd
import pytest
from synthetic import write_run
from test_plots import assert_picture, call, drawn  # noqa: F401  (fixtures)

from pliant import Run, RunError, load_runs, pooling, sweep_table, symbols

WIDTHS = (3, 4, 5, 6)


def write_series(folder, Q=0.4, seed=1, **extra):
    """Runs of several widths, with the law Q(w - 1.5)."""
    for w in WIDTHS:
        write_run(folder / f"w{w}", zeta=0.5, mu=0, w=w, Q=Q * (w - 1.5), n=20, frames=1, samples=5, seed=seed,
                  extra={name: (value, "") for name, value in extra.items()})
    return folder


def settings(*changes, scenario="hopper", variables=(), **common):
    """{option: values} of the settings of runs with these options."""
    rows = [{"scenario": scenario, "model": "sp", **common, **change} for change in changes]
    return {name: list(column) for name, column in pooling.settings(pd.DataFrame(rows), scenario, variables).items()}


def test_options_without_influence_exist():
    known = {name for scenario in ("hopper", "raft", "clog", "channel", "pack", "shear", "vibrate") for name in symbols.options(scenario)}
    free = {*pooling.OUTPUT, *pooling.LENGTH, *pooling.DISKS, *pooling._NUMERICS}
    assert free <= known | {"options_file"}


def test_any_other_option_distinguishes_runs():
    free = {"seed", *pooling.OUTPUT, *pooling.LENGTH, *pooling._NUMERICS}
    for scenario in ("hopper", "clog", "raft", "channel", "pack"):
        for name in symbols.options(scenario):
            found = settings({name: 1.0}, {name: 2.0}, scenario=scenario, model="a model of the user's own")
            assert list(found) == ([] if name in free else [name]), (scenario, name)


def test_values_that_are_no_difference():
    assert settings({"mu_disk": 0.4}, {"mu_disk": 0.5}) == {}, "soft particles do not read it"
    assert settings({"ts_atol": "1e-7"}, {"ts_atol": "1e-8"}) == {}
    assert settings({"hopper_angle": 90}, {"hopper_angle": 90.0}) == {}
    assert settings({"tangential_stiffness": 2 / 7}, {"tangential_stiffness": np.nextafter(2 / 7, 1)}, model="disk") == {}
    assert settings({"self_contact": False}, {"self_contact": 0.0}, model="rough") == {}
    assert settings({"hopper_width": 3}, {"hopper_width": 4}, variables=("hopper_width",)) == {}


def test_runs_of_older_versions_have_the_defaults_of_new_options():
    assert settings({}, {"obstacle": ""}, {"corner_contact": "once"}) == {}
    assert settings({}, {"obstacle": "disk:0,3,1"}) == {"obstacle": ["", "disk:0,3,1"]}
    assert settings({}, {"reinsertion_lateral_speed": 0.5}) == {"reinsertion_lateral_speed": ["", 0.5]}


def test_a_table_without_scenario_does_not_know_its_other_options():
    table = pd.DataFrame({"hopper_width": [3, 3], "seed": [1, 1], "Q": [1.0, 2.0]})
    assert len(pooling.once(table, "hopper")) == 2
    assert len(pooling.once(table.assign(scenario="hopper"), "hopper")) == 1
    assert len(pooling.once(pd.concat([table, table], ignore_index=True), "hopper")) == 2


def test_a_repeated_run_counts_once(capsys):
    table = pd.DataFrame({"scenario": "hopper", "seed": [1, 1, 1, 2], "mu": [1, 1, 2, 1], "threads": [1, 2, 1, 1]})
    assert list(pooling.once(table, "hopper").index) == [0, 1, 2]
    assert "1 of 4 runs have the options and the seed of another run; each counts once" in capsys.readouterr().out


def test_names_of_series_have_all_digits():
    table = pd.DataFrame({"scenario": "clog", "hopper_angle": [25, 25.0001], "wall_friction": [True, False]})
    assert list(pooling.series(table, "clog", ())) == [r"$\theta_w = 25$, wall_friction = true", r"$\theta_w = 25.0001$, wall_friction = false"]


def test_the_longest_of_equal_runs_counts():
    table = pd.DataFrame({"scenario": "hopper", "seed": [1, 2, 1], "t_end": [100, 50, 200], "Q": [1.0, 2.0, 3.0]})
    assert list(pooling.once(table, "hopper")["Q"]) == [2.0, 3.0]


def test_check_names_the_option_and_its_values():
    table = pd.DataFrame({"scenario": "clog", "hopper_angle": [25, 60, 80, 25]})
    with pytest.raises(RunError, match=r"differ in -hopper_angle \(25, 60 and 80\)"):
        pooling.check(table, "clog")
    pooling.check(table, "clog", ("hopper_angle",))
    with pytest.raises(RunError, match=r"differ in scenario \(pack and shear\)"):
        pooling.check(pd.DataFrame({"scenario": ["pack", "shear"]}), "pack")


def test_automatic_values_are_no_difference(tmp_path):
    """The program writes the value that it has chosen, which depends on the size of a raft."""
    from test_raft import write_raft
    runs = [Run(write_raft(tmp_path / str(seed), seed, start_distance=7 + seed)) for seed in (1, 2)]
    _, table = pooling.distinct_runs(runs, "raft")
    pooling.check(table, "raft")


def test_beverloo_has_a_group_for_each_value_of_any_option(drawn, tmp_path):  # noqa: F811
    folders = [write_series(tmp_path / "plain", obstacle=""),
               write_series(tmp_path / "obstacle", Q=0.2, obstacle="disk:0,3,1"),
               write_series(tmp_path / "ratio", Q=0.3, obstacle="", size_ratio=2.0)]
    figure, text = drawn("beverloo.py", *folders)
    labels = [entry.get_text() for entry in figure.axes[0].get_legend().get_texts()][:3]
    assert sum("obstacle = disk:0,3,1" in label for label in labels) == 1
    assert sum("size_ratio = 2" in label for label in labels) == 1
    assert len(set(labels)) == 3


def test_beverloo_counts_a_run_once(call, tmp_path):  # noqa: F811
    once, twice = (call("beverloo.py", *[write_series(tmp_path / "runs")] * times, "-o", tmp_path / "a.png") for times in (1, 2))
    assert twice.split("\n", 1)[1] == once and "given several times; each counts once" in twice
    inside = call("beverloo.py", tmp_path / "runs", tmp_path / "runs/w3", "-o", tmp_path / "a.png")
    assert inside.split("\n", 1)[1] == once and "1 of 5 runs have the options" in inside


def test_beverloo_distinguishes_options_of_a_model_of_the_users_own(drawn, tmp_path):  # noqa: F811
    folders = [write_series(tmp_path / str(tension), tension=tension) for tension in (20, 30)]
    for path in tmp_path.glob("*/w*/run.h5"):
        with h5py.File(path, "r+") as file:
            file["manifest"].attrs["model"] = "foam"
    assert "tension" in sweep_table(load_runs(folders)).attrs["options"]
    _, text = drawn("beverloo.py", *folders)
    assert "foam, zeta/zeta_0 = 0.5, tension = 20" in text and "foam, zeta/zeta_0 = 0.5, tension = 30" in text


def write_modes(path, seed=1, **options):
    """A packing with all of its modes."""
    path, _ = write_run(path, n=20, frames=1, samples=1, seed=seed, summary=False, extra={name: (value, "") for name, value in options.items()})
    with h5py.File(path / "run.h5", "r+") as file:
        file["manifest"].attrs["scenario"] = "pack"
        file["series/frequencies"] = np.linspace(0.1, 1, 40)[None]
        file["series/participation"] = np.full((1, 40), 0.5)
    return path


def test_the_density_of_states_is_a_mean_over_seeds_alone(call, drawn, capsys, tmp_path):  # noqa: F811
    same = [write_modes(tmp_path / f"a{seed}", seed, pressure=1e-4) for seed in (1, 2)]
    figure, text = drawn("density_of_states.py", *same, same[0])
    assert "2 packings" in figure.axes[0].get_title() and "1 of 3 runs have the options" in text
    with pytest.raises(SystemExit):
        call("density_of_states.py", *same, write_modes(tmp_path / "b", 3, pressure=1e-2), "-o", tmp_path / "a.png")
    assert "differ in -pressure (0.0001 and 0.01)" in capsys.readouterr().err


@pytest.mark.parametrize("one, other, kept", [
    ({"t_end": np.nan}, {"t_end": 50}, 0),  # the whole run
    ({"t_end": 50}, {"t_end": np.nan}, 1),
    ({"t_end": 30}, {"t_end": 40}, 1),
    ({"t_end": 30}, {"t_end": 1e5, "status": "stopped"}, 0),  # without a result
    ({"t_end": 30, "skin": 0.22}, {"t_end": 40, "skin": 0.23}, 1)])  # the program tunes the skin
def test_the_run_that_counts_of_runs_with_equal_options(one, other, kept, capsys):
    rows = [{"scenario": "hopper", "model": "sp", "status": "done", "seed": 1, "number": k, **run} for k, run in enumerate((one, other))]
    assert list(pooling.once(pd.DataFrame(rows), "hopper")["number"]) == [kept]
    assert "1 of 2 runs" in "".join(capsys.readouterr())
