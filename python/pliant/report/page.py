"""The HTML file of a report: the template, its style and scripts (web/), and data, in one file without links to others."""

import base64
import html
import json
from pathlib import Path

from ..files import finite

_WEB = Path(__file__).parent / "web"
#: In the order in which they run.
_SCRIPTS = ("text", "data", "colour", "frames", "scene", "player", "chart", "sweep", "ensemble", "page")


def page(title, data, frames=b""):
    """The bytes of the HTML file. `data`: a dict for web/page.js; `frames`: the bytes that data["player"] describes. No text in
    them can end an element of the page."""
    text = json.dumps(finite(data), separators=(",", ":")).replace("<", "\\u003c")
    scripts = "\n".join(f"<script>\n{_read(f'{name}.js')}</script>" for name in _SCRIPTS)
    parts = {"@TITLE@": html.escape(title), "@STYLE@": _read("page.css"), "@DATA@": text, "@FRAMES@": base64.b64encode(frames).decode(),
             "@SCRIPTS@": scripts}
    result = _read("page.html")
    for name, part in parts.items():
        before, after = result.split(name, 1)
        result = before + part + after
    return result.encode("utf-8", "backslashreplace")  # names of folders may be no UTF-8


def overhead():
    """Bytes of the page without data."""
    return len(page("", {}))


def _read(name):
    return (_WEB / name).read_text(encoding="utf-8")
