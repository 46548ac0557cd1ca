"""Energy budget of a run, from the columns of its series."""

import numpy as np

from ..errors import RunError

#: Columns of /series that belong to the budget (docs/reference/file-format.md).
COLUMNS = ("kinetic_energy", "potential_energy", "elastic_energy", "energy", "contact_energy", "depletion_energy",
           "wall_repulsion_energy", "wall_depletion_energy", "gravity_energy", "work", "plunger_work", "heat", "dissipated",
           "relaxed", "withdrawn", "budget_error")


def energy_budget(run):
    """DataFrame, one row per sample: time, the columns of COLUMNS that the run has, the parts of the heat, and dissipation_rate,
    the power of `heat` or `dissipated` from differences of neighbouring samples, if the run has one of them; of packings, whose
    time is their number, the energy per packing. Energies are in the run's unit: ρ g σ_avg^(D+1), for droplets force times ⟨R⟩,
    for packings ε. RunError if all columns are missing."""
    series = run.series
    parts = [name for name in series if name.endswith(("_sliding", "_damping", "_rolling", "_twisting"))]
    names = [name for name in COLUMNS if name in series] + parts
    if not names:
        raise RunError(f"{run.path}: the run has no columns of energy; repeat it with this version of the program")
    table = series[["time", *names]].copy()
    lost = next((name for name in ("heat", "dissipated") if name in names), None)
    if lost:
        rate = np.full(len(table), np.nan)
        if len(table) > 1:
            rate = np.gradient(table[lost].to_numpy(), table["time"].to_numpy())
        table["dissipation_rate"] = rate
    return table
