"""Loads the compiled part of the package."""

from importlib import import_module

try:
    core = import_module("._core", __package__)
except ModuleNotFoundError as error:
    if error.name != f"{__package__}._core":
        raise
    raise ImportError(
        "this copy of pliant reads runs but has no engine (pliant._core); install pybind11-dev and python3-dev, build "
        "Pliant again (scripts/build.sh), and put its folder build/python into PYTHONPATH") from None

__all__ = ["core"]
