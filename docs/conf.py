"""Settings of Sphinx for the documentation site, which docs/build_site.py builds."""

import os
import sys
from pathlib import Path
from typing import Any

import latex2mathml.converter

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "post"))
from ricochet import __version__  # noqa: E402

project = "Ricochet"
author = project_copyright = "Ricochet contributors"
version = release = __version__
root_doc = "index"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx_design",
]
html_theme = "furo"
html_title = f"Ricochet {__version__}"
html_static_path = [str(ROOT / "docs" / "theme")]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
pygments_style = "default"
highlight_language = "none"
smartquotes = False  # would turn the two hyphens of an option into a dash

myst_enable_extensions = ["colon_fence", "dollarmath", "attrs_block"]
myst_heading_anchors = 4
html_math_renderer = "mathml"

nb_execution_mode = "cache"
nb_execution_cache_path = os.environ.get("RICOCHET_SITE_CACHE", "")
nb_execution_timeout = 300
nb_execution_raise_on_error = True

autodoc_member_order = "bysource"
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_xref_param_type = False


def mathml(self: Any, node: Any, display: str) -> None:
    """Write a formula as MathML, which browsers display without a script or a network."""
    self.body.append(latex2mathml.converter.convert(node.astext(), display=display))
    if display == "block":
        self.body.append("\n")
    from docutils.nodes import SkipNode

    raise SkipNode


def without_aliases(app: Any, kind: str, name: str, *rest: Any) -> None:
    """Remove the generated text "Alias for field number" from pages about named tuples."""
    lines = rest[-1]
    if lines and lines[0].startswith("Alias for field number"):
        lines[:] = []


def add_excerpts(app: Any, page: str, *_: Any) -> None:
    """Load the texts of all pages, written by docs/build_site.py, in the search page."""
    if page == "search":
        app.add_js_file("excerpts.js")


def setup(app: Any) -> dict[str, bool]:
    """Register the functions that Sphinx calls."""
    app.connect("autodoc-process-docstring", without_aliases)
    app.connect("html-page-context", add_excerpts)
    app.add_html_math_renderer(
        "mathml",
        (lambda self, node: mathml(self, node, "inline"), None),
        (lambda self, node: mathml(self, node, "block"), None),
    )
    return {"parallel_read_safe": True, "parallel_write_safe": True}
