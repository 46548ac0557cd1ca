"""Names of parameters in figures and tables, in one place, and which models read them."""

import numpy as np

MODEL_NAMES = {"sp": "soft particles", "rough": "rough polygons", "smooth": "smooth polygons", "bubble": "droplets",
               "disk": "frictional disks"}

#: option → its symbol, as TeX
SYMBOLS = {"hopper_width": r"w/\sigma_{avg}", "mu": r"\mu/\mu_0", "zeta": r"\zeta/\zeta_0", "e_sp": "E_{sp}",
           "e_c": "E_c", "e_w": "E_w", "k_a": "K_a", "k_l": "K_l", "k_b": "K_b", "n": "N",
           "hopper_angle": r"\theta_w", "hopper_angle_left": r"\theta_{w,left}", "hopper_wall_distance": r"W/\sigma_{avg}",
           "dim": "d", "n_vertices": "n_v", "shape_parameter": r"\mathcal{A}_0", "edge_width": r"\delta/l_0",
           "wall_diameter": r"\delta_w/\sigma_{avg}", "reinsertion_gap": r"h_{gap}/\sigma_{avg}", "e_disk": "E_{disk}",
           "mu_disk": r"\mu_{disk}", "mu_wall": r"\mu_{wall}", "restitution": "e", "phi_c": r"\phi_c", "g": "g",
           "delta": r"\delta/\langle R\rangle"}

#: option → models that read it, where not every model of the hopper does; the others have its default value in their files
_READ_BY = {"e_sp": {"sp"}, "rough_contact": {"rough"}, "edge_width": {"smooth"}, "edge_force": {"smooth"},
            "friction_point": {"smooth"},
            **dict.fromkeys(("e_c", "k_a", "k_l", "k_b", "area_energy", "bending_edges", "n_vertices", "shape_parameter",
                             "lip_contact", "self_contact", "self_crossing"), {"rough", "smooth"}),
            **dict.fromkeys(("mu", "friction", "wall_diameter"), {"sp", "rough", "smooth"}),
            **dict.fromkeys(("e_disk", "mu_disk", "mu_disk_dynamic", "mu_wall", "mu_wall_dynamic", "restitution",
                             "tangential_stiffness", "tangential_damping"), {"disk"})}
_NUMERICS = {"dt": r"\Delta t"}  # symbols of options that tell no two systems apart
_NOTHING_AT_ZERO = ("mu", "zeta")  # how a system dissipates: 0 is not worth a word where the other is not


def reads(model, name):
    """Whether a model reads an option. A model of the user's own may read all."""
    return model not in MODEL_NAMES or model in _READ_BY.get(name, {model})


def parameter_label(name, value):
    """'$w/σ = 5$' for a parameter's value."""
    number = f"{value:.4g}" if isinstance(value, (int, float, np.number)) else str(value)
    symbol = SYMBOLS.get(name) or _NUMERICS.get(name)
    return f"${symbol} = {number}$" if symbol else f"{name} = {number}"


def group_label(row, columns):
    """Legend entry of a group: the model's name, and the names of the parameters in `columns` that it reads."""
    model = row.get("model")
    parts = [MODEL_NAMES.get(model, str(model))] if "model" in columns else []
    named = [c for c in columns if c != "model" and reads(model, c)]
    dissipation = [c for c in _NOTHING_AT_ZERO if c in named and row[c] != 0]
    named = [c for c in named if c not in _NOTHING_AT_ZERO or c in dissipation or not dissipation]
    return ", ".join(parts + [parameter_label(c, row[c]) for c in named])


def differing(rows, columns):
    """Of the columns those in which rows differ that read them; `rows`: mappings with the column model."""
    return [c for c in columns if len({row[c] for row in rows if reads(row.get("model"), c) and c in row
                                       and row[c] == row[c]}) > 1]


def plain(label):
    """A label without TeX, for tables of text."""
    for tex, text in (("$", ""), (r"_{avg}", "_avg"), (r"\langle R\rangle", "<R>"), (r"\mathcal{A}", "A"), ("\\", ""),
                      ("{", ""), ("}", "")):
        label = label.replace(tex, text)
    return label
