"""scripts/check_includes.py: forbidden includes are found."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

import check_includes  # noqa: E402

GOOD = {
    "src/base/types.h": "#include <vector>\n",
    "src/base/errors.h": "#include <pliant/base/types.h>\n",
    "src/geometry/walls.h": "#include <pliant/base/errors.h>\n#include <pliant/base/types.h>\n",
    "src/geometry/walls.cpp": "#include <pliant/geometry/walls.h>\n",
    "src/ts/integrator.cpp": "#include <pliant/base/types.h>\n#include <pliant/geometry/walls.h>\n",
    "src/ts/sundials/cvode.cpp": "#include <pliant/base/types.h>\n",
}


@pytest.mark.parametrize("changed, expected", [
    ({}, None),
    ({"src/base/types.h": "\n#include <pliant/geometry/walls.h>\n"},
     "src/base/types.h:2: base may not include geometry (<pliant/geometry/walls.h>)"),
    ({"src/ts/sundials/cvode.cpp": "#include <pliant/geometry/walls.h>\n"},
     "src/ts/sundials/cvode.cpp:1: ts/sundials may not include geometry (<pliant/geometry/walls.h>)"),
    ({"src/base/types.h": "#include <pliant/base/errors.h>\n"}, "headers include each other: base/"),
    ({"src/misc/all.h": ""}, "src/misc/all.h: folder misc is not in the table"),
    ({"src/geometry/walls.cpp": '#include "walls.h"\n'}, "src/geometry/walls.cpp:1: own headers are included as <pliant/"),
], ids=["good", "upwards", "subfolder", "circle", "folder", "quotes"])
def test_includes(changed, expected, tmp_path):
    for name, text in (GOOD | changed).items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    violations = check_includes.check(tmp_path)
    if expected is None:
        assert violations == []
    else:
        assert violations and violations[0].startswith(expected)


def test_a_folder_without_sources_is_none(tmp_path):
    assert "no sources" in check_includes.check(tmp_path)[0]
