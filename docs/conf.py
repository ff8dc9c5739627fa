"""Settings of the documentation site: `make docs` builds it into build/docs. It needs no network."""

from __future__ import annotations

import sys
from functools import partial
from importlib.metadata import version as version_of
from pathlib import Path
from types import CodeType, GenericAlias

from jinja2 import BytecodeCache
from jinja2.bccache import Bucket
from jinja2.sandbox import SandboxedEnvironment
from numpydoc import docscrape_sphinx
from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parent))  # the extension `mathml` beside this file

project = "adaptive-flot"
author = "The adaptive-flot developers"
version = release = version_of("adaptive-flot")

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_parser",
    "sphinx_design",
    "mathml",
]
exclude_patterns = ["heated_tank"]
nitpicky = False
default_role = "code"
"""Docstrings of this project put names between single backticks."""

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_use_type_comments = False  # there are none, and looking for them takes a while
numpydoc_show_class_members = False
html_math_renderer = "mathml"

templates_path = ["_templates"]
html_theme = "pydata_sphinx_theme"
html_title = "adaptive-flot"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_theme_options = {
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "header_links_before_dropdown": 7,
    "show_toc_level": 2,
    "collapse_navigation": True,
    "footer_start": ["copyright"],
    "footer_end": ["sphinx-version"],
    "secondary_sidebar_items": ["page-toc"],
}


class CompiledTemplates(BytecodeCache):
    """Compiled templates by their key, in memory."""

    def __init__(self) -> None:
        self.kept: dict[str, CodeType] = {}

    def load_bytecode(self, bucket: Bucket) -> None:
        """Give the code of a template that was compiled before."""
        bucket.code = self.kept.get(bucket.key)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep the code of a template."""
        assert bucket.code is not None
        self.kept[bucket.key] = bucket.code


# numpydoc makes an environment for each docstring, which compiled the same template again: a quarter of the whole build
docscrape_sphinx.SandboxedEnvironment = partial(SandboxedEnvironment, bytecode_cache=CompiledTemplates())


def without_type_aliases(app: Sphinx, what: str, name: str, member: object, skip: bool, options: object) -> bool | None:
    """Leave out aliases such as `Pair = tuple[A, B]`: autodoc takes them for classes."""
    return True if isinstance(member, GenericAlias) else None


def setup(app: Sphinx) -> None:
    """Connect what the settings above can not say."""
    app.connect("autodoc-skip-member", without_type_aliases)
