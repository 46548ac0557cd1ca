"""Synthetic runs, written once per session."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from synthetic import write_run  # noqa: E402

from matplotlib.figure import Figure  # noqa: E402

from pliant import beverloo, plotting  # noqa: E402


@pytest.fixture(autouse=True)
def figures_fit_a_page(monkeypatch):
    """Figures saved by tests must not be wider than a page, because their text would be too small, and legends must not
    be right of the axes, which would narrow the curves."""
    save = Figure.savefig

    def checked(figure, *arguments, **options):
        assert figure.get_figwidth() <= plotting.PAGE + 0.01, f"the figure is {figure.get_figwidth():.3g} in wide"
        for axes in figure.axes:
            legend = axes.get_legend()
            assert legend is None or legend.get_window_extent().x0 < axes.bbox.x1, "the legend stands beside its axes"
        return save(figure, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", checked)


@pytest.fixture(scope="session")
def root(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="session")
def soft(root):
    """(path, truth) of a run of soft particles."""
    return write_run(root / "soft", "sp", angle=60)


@pytest.fixture(scope="session")
def rough(root):
    return write_run(root / "rough", "rough")


@pytest.fixture(scope="session")
def smooth(root):
    return write_run(root / "smooth", "smooth")


@pytest.fixture(scope="session")
def soft3d(root):
    return write_run(root / "soft3d", "sp", dim=3, n=600, W=9.0)


@pytest.fixture(scope="session")
def sweep(root):
    """Folder of a sweep in two groups: friction only, C = 0.15, k = 1.6, beta = 3/2, and drag only, 0.42, 3.4, 1/2; the
    narrowest orifice of the second is clogged."""
    folder = root / "sweep"
    for name, mu, zeta, law in (("friction", 31.6, 0.0, (0.15, 1.6, 1.5)), ("drag", 0.0, 0.316, (0.42, 3.4, 0.5))):
        for w in (3.0, 4.0, 5.0, 6.5, 8.0, 10.0):
            Q = float(beverloo.beverloo(w, *law))
            write_run(folder / f"{name}-{w:g}", mu=mu, zeta=zeta, w=w, Q=Q, Q_error=0.02 * Q or None, n=20, frames=1,
                      samples=60, status="done" if Q else "clogged", seed=int(10 * w))
    return folder
