"""Sphinx: the reference, generated from the code before each build."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import generator  # noqa: E402

import lugrectl  # noqa: E402

project = "lugrectl"
author = copyright = "lugrectl contributors"
release = version = lugrectl.__version__
extensions = ["sphinx.ext.autodoc", "sphinx.ext.mathjax", "numpydoc", "myst_nb"]
exclude_patterns = ["build", "templates", "generator"]
html_theme = "alabaster"
html_theme_options = {
    "description": lugrectl.__doc__.split("\n")[0].rstrip("."),
    "fixed_sidebar": True,
    "page_width": "1180px",
    "sidebar_width": "230px",
}
html_static_path = ["static"]
html_css_files = ["reference.css"]
html_show_sourcelink = False
smartquotes = False  # two hyphens are those of an option
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say types, shapes and units
numpydoc_show_class_members = False  # the generator lists the documented ones
numpydoc_xref_param_type = False
nb_render_markdown_format = "myst"  # tables in outputs
nb_execution_mode = "off"  # the notebooks are stored as they ran
myst_enable_extensions = ["dollarmath"]
suppress_warnings = ["mystnb.unknown_mime_type"]  # outputs without a form for a web page


def plain_characters(app, what, name, thing, options, lines):
    """Bars and stars of docstrings are those of equations: |w| and zhat*, no markup."""
    lines[:] = generator.rst.prose("\n".join(lines)).split("\n")


def setup(app):
    generator.write(HERE / "generated")
    app.connect("autodoc-process-docstring", plain_characters, priority=400)
