"""scripts/check_cures.py: options of scenarios in the messages of lower layers are found."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

import check_cures  # noqa: E402


@pytest.mark.parametrize("path, text, names", [
    ("run/a.cpp", 'throw InputError("use a larger -e_c or -dt");', ["e_c"]),
    ("run/a.cpp", 'o.bind("output", x, {}); throw InputError("choose another -output");', []),
    ("io/a.cpp", 'throw InputError("choose another -output");', ["output"]),
    ("ts/a.cpp", 'throw InputError("lower -ts_rtol, or (-zeta)"); // -mu', ["zeta"]),
    ("model/a.h", 'throw InputError("far" "-k_l {}: too large");', ["k_l"]),
    ("model/a.h", 'say("1-2, a-b, 1e-3, well-known, - x");', []),
    ("scenarios/hopper/a.cpp", 'say("-e_c");', []),
])
def test_names(tmp_path, path, text, names):
    file = tmp_path / path
    file.parent.mkdir(parents=True)
    file.write_text(text, encoding="utf-8")
    assert [name for _, _, name in check_cures.named_options(tmp_path)] == names


def test_cures_without_message_or_option(tmp_path):
    for path, text in (("base/cure.h", "enum class Cure {\n  drag,  ///< idle\n  heat, cold\n};"),
                       ("run/a.cpp", "cures({Cure::heat}) + cures({Cure::cold})  // Cure::drag"),
                       ("scenarios/a/options.cpp", ".cures = {Cure::drag, {Cure::cold, \"1\"}}")):
        (tmp_path / path).parent.mkdir(parents=True)
        (tmp_path / path).write_text(text, encoding="utf-8")
    assert list(check_cures.idle_cures(tmp_path)) == [("drag", "no message advises it"), ("heat", "no option declares it")]
