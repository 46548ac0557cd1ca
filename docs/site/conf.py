"""Settings of the site, which scripts/site.sh builds from a copy of the pages: documentation, gallery, references of Python and C++."""

import os
import re
from pathlib import Path

project, author, copyright = "Pliant", "the Pliant authors", "the Pliant authors"  # noqa: A001
version = release = os.environ["PLIANT_VERSION"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx_gallery.gen_gallery", "breathe"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
root_doc = "docs/README"
exclude_patterns = ["examples"]
html_theme = "alabaster"
html_theme_options = {"page_width": "1450px", "sidebar_width": "230px", "description": "soft and deformable particles"}

# --- Pages

myst_heading_anchors = 6
suppress_warnings = ["myst.header", "config.cache"]
CONTENTS = """

```{{toctree}}
:hidden:
:glob:
:caption: Contents
{}
```
"""
PAGES = "tutorial limitations performance how-to/* scenarios/* models/* reference/* validation/* design/* /gallery/index /python /cpp /src/*/README /src/*/*/README /README /[A-Z]*".split()
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s:#]*)#([^()\s]+)\)")
GALLERY = re.compile(r"\]\(((?:\.\./)*)examples/gallery\)")
ANCHOR = re.compile(r'<a id="([^"]+)"></a>')


def adapt(app, name, source):
    """Adds the table of contents to the start page, and makes links to anchors that HTML tags define."""
    page = Path(app.srcdir) / f"{name}.md"
    if name == root_doc:
        source[0] += CONTENTS.format("\n".join(PAGES))
    if not page.exists():
        return

    def change(found):
        target = page.parent / found[3] if found[3] else page
        if target.suffix == ".md" and target.exists() and found[4] in ANCHOR.findall(target.read_text(encoding="utf-8")):
            return f'<a href="{re.sub("md$", "html", found[3])}#{found[4]}">{found[2]}</a>'
        return found[0]
    source[0] = GALLERY.sub(r"](\1gallery/index.rst)", LINK.sub(change, source[0]))


# --- Python

autosummary_generate = True
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the aliases of numpy fill a page
autodoc_default_options = {"members": True}


def as_text(app, what, name, obj, options, lines):
    """Docstrings of the package are plain text: their lines are shown as they are."""
    if not name.startswith("sphinx"):
        lines[:] = ["", "::", "", *(f"    {line}" for line in lines), ""] if any(line.strip() for line in lines) else []


# --- Gallery

sphinx_gallery_conf = {
    "examples_dirs": ["examples/gallery"],  # in the copy of the sources
    "gallery_dirs": ["gallery"],
    "filename_pattern": "/plot_",
    "within_subsection_order": __import__("sphinx_gallery.sorting", fromlist=["FileNameSortKey"]).FileNameSortKey,
    "download_all_examples": False,
    "abort_on_example_error": True,
    "plot_gallery": os.environ.get("PLIANT_GALLERY") != "skip",
    "reset_modules": (),
}

# --- C++

breathe_projects = {"pliant": os.environ["PLIANT_DOXYGEN_XML"]}
breathe_default_project = "pliant"
cpp_id_attributes = ["PLIANT_INLINE"]


def setup(app):
    app.connect("source-read", adapt)
    app.connect("autodoc-process-docstring", as_text)
