"""Packages that the scripts next to this package need."""

import sys
from importlib.util import find_spec
from pathlib import Path

_SWEEP = ("numpy", "pandas", "h5py", "uncertainties")
_PLOTS = (*_SWEEP, "scipy", "matplotlib", "lmfit")
_SYSTEM = "/usr/bin/python3"


def check():
    """If one of our scripts runs under a Python without the packages that it needs (the first in the PATH, say): prints
    one line and exits with 2. User programs that import pliant get Python's error."""
    script = Path(getattr(sys.modules["__main__"], "__file__", "")).resolve()
    if Path(__file__).resolve().parents[1] not in script.parents[:2]:
        return
    draws = script.parent.name == "plots" or script.name in ("pliant-reproduce", "pliant-report")
    missing = [name for name in (_PLOTS if draws else _SWEEP) if find_spec(name) is None]
    if not missing:
        return
    packages = " ".join(f"python3-{name}" for name in missing)
    other = f"run it with {_SYSTEM}, or " if sys.prefix != "/usr" else ""
    print(f"{script.name}: error: {sys.executable or 'this Python'} has no {', '.join(missing)}; {other}install Debian's "
          f"{packages} (scripts/setup.sh)", file=sys.stderr)
    sys.exit(2)
