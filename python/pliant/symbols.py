"""Names of parameters in figures and tables, in one place, and which models read them.

The symbols of the parameters of models, and which models read them, come from the program (parameters.json, which
scripts/docs.sh writes); the symbols of other options are here.
"""

import json
from pathlib import Path

import numpy as np

MODEL_NAMES = {"sp": "soft particles", "rough": "rough polygons", "smooth": "smooth polygons", "bubble": "droplets",
               "disk": "frictional disks"}
_NAMES_IN_SPACE = {"rough": "rough surfaces", "smooth": "smooth surfaces", "disk": "frictional spheres"}

_OPTIONS = json.loads((Path(__file__).parent / "parameters.json").read_text(encoding="utf-8"))

#: option → its symbol, as TeX
SYMBOLS = {"hopper_width": r"w/\sigma_{avg}", "n": "N", "hopper_angle": r"\theta_w", "hopper_angle_left": r"\theta_{w,left}",
           "hopper_wall_distance": r"W/\sigma_{avg}", "dim": "d", "n_vertices": "n_v", "shape_parameter": r"\mathcal{A}_0",
           "edge_width": r"\delta/l_0", "reinsertion_gap": r"h_{gap}/\sigma_{avg}", "g": "g",
           "delta": r"\delta/\langle R\rangle",
           **{name: entry["symbol"] for options in _OPTIONS.values() for name, entry in options.items() if "symbol" in entry}}


def parameters(scenario):
    """Names of the parameters of the models that a scenario offers."""
    return [name for name, entry in _OPTIONS[scenario].items() if "models" in entry]


def options(scenario):
    """{option: default} of a scenario; None for automatic options."""
    return {name: entry["default"] for name, entry in _OPTIONS[scenario].items()}


def defaults(scenario):
    """{parameter: default} of the models that a scenario offers; None for automatic parameters."""
    return {name: default for name, default in options(scenario).items() if name in parameters(scenario)}


#: option → models that read it; files of other models have its default value
_READ_BY = {"edge_width": {"smooth"}, **dict.fromkeys(("n_vertices", "shape_parameter", "self_crossing"), {"rough", "smooth"})}
for _options in _OPTIONS.values():
    for _name, _entry in _options.items():
        if "models" in _entry:
            _READ_BY[_name] = _READ_BY.get(_name, set()) | set(_entry["models"])
_NUMERICS = {"dt": r"\Delta t"}  # symbols of options that do not distinguish systems
_NOTHING_AT_ZERO = ("mu", "zeta")  # how a system dissipates: 0 is not worth a word where the other is not


def model_name(run):
    """Name of the particles of a run."""
    return (_NAMES_IN_SPACE.get(run.model) if run.dim == 3 else None) or MODEL_NAMES.get(run.model, run.model)


def reads(model, name):
    """Whether a model reads an option. A model of the user's own may read all."""
    return model not in MODEL_NAMES or model in _READ_BY.get(name, {model})


def models_that_read(name):
    """Names of the models that read an option."""
    return {model for model in MODEL_NAMES if reads(model, name)}


def parameter_label(name, value):
    """'$w/σ = 5$' for a parameter's value."""
    truth = isinstance(value, (bool, np.bool_))
    number = str(value).lower() if truth else f"{value:.4g}" if isinstance(value, (int, float, np.number)) else str(value)
    symbol = SYMBOLS.get(name) or _NUMERICS.get(name)
    return f"${symbol} = {number}$" if symbol else f"{name} = {number}"


def group_label(row, columns):
    """Legend entry of a group: the model's name, and the known parameters in `columns` that it reads."""
    model = row.get("model")
    parts = [MODEL_NAMES.get(model, str(model))] if "model" in columns else []
    named = [c for c in columns if c != "model" and c in row and row[c] == row[c] and reads(model, c)]
    dissipation = [c for c in _NOTHING_AT_ZERO if c in named and row[c] != 0]
    named = [c for c in named if c not in _NOTHING_AT_ZERO or c in dissipation or not dissipation]
    return ", ".join(parts + [parameter_label(c, row[c]) for c in named])


def differing(rows, columns):
    """The columns in which rows differ whose models read the column; `rows`: mappings with the column model."""
    return [c for c in columns if len({row[c] for row in rows if reads(row.get("model"), c) and c in row
                                       and row[c] == row[c]}) > 1]


def plain(label):
    """A label without TeX, for tables of text."""
    for tex, text in (("$", ""), (r"_{avg}", "_avg"), (r"\langle R\rangle", "<R>"), (r"\mathcal{A}", "A"), ("\\", ""),
                      ("{", ""), ("}", "")):
        label = label.replace(tex, text)
    return label
