"""How Sphinx makes the site; `python -m scripts.docs` gathers what it reads and calls it."""

from __future__ import annotations

import re
from importlib.metadata import version as installed
from typing import Any

project = "Virtual shake robot"
author = "The virtual shake robot developers"
project_copyright = author
release = version = installed("vsr")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
]
templates_path = ["_templates"]
exclude_patterns = ["extra", "data"]
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]
suppress_warnings = ["ref.python"]
"""Types in docstrings are words, and those in signatures belong to libraries elsewhere."""

myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_timeout = 600
nb_execution_raise_on_error = True
nb_merge_streams = True

if tags.has("quick"):  # type: ignore[name-defined]  # noqa: F821 (Sphinx brings it)
    exclude_patterns.append("api.md")
    suppress_warnings.append("toc.not_readable")
    nb_execution_mode = "off"

autodoc_default_options = {"members": True, "member-order": "bysource"}
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_ivar = True
napoleon_use_rtype = False

linkcheck_timeout, linkcheck_retries = 15, 1

html_theme = "pydata_sphinx_theme"
html_title = "Virtual shake robot"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_extra_path = ["extra"]
html_sidebars = {
    page: []
    for page in (
        *(
            "index",
            "quick_start",
            "tasks",
            "concepts",
            "gallery",
            "faq",
            "error",
            "uncertainty",
            "limits",
            "validation",
        ),
        *("claims", "reliability", "options", "results", "conventions", "structure"),
        *("CONTRIBUTING", "CHANGELOG"),
    )
}
"""Pages without pages below them have no menu at their side."""
html_context = {"default_mode": "auto"}
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
    "show_nav_level": 1,
    "header_links_before_dropdown": 6,
}

_BAR = re.compile(r"``.*?``|\|")


def bars(app: Any, what: str, name: str, entity: Any, options: Any, lines: list[str]) -> None:
    """Let |x| in a docstring be an absolute value, which reStructuredText takes for a name."""
    for number, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...")):
            lines[number] = _BAR.sub(lambda m: r"\|" if m[0] == "|" else m[0], line)


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", bars)
