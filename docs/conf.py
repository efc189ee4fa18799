"""Settings of the documentation site, which `scripts/docs` builds with Sphinx."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from sphinx.application import Sphinx

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path.insert(0, str(ROOT / "src"))

import autodrive  # noqa: E402

project = "AutoDRIVE Simulator"
author = "AutoDRIVE Simulator developers"
copyright = author
version = release = autodrive.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_copybutton", "sphinx_design"]
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "AutoDRIVE Simulator"
html_show_sourcelink = False
html_static_path: list[str] = []

# -- Markdown -----------------------------------------------------------------------------------------------------

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
suppress_warnings = ["misc.highlighting_failure"]  # blocks of shell sessions and of YAML with "..."

# -- the API reference ----------------------------------------------------------------------------------------------

default_role = "code"  # docstrings write `name` for code
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_default_options = {"members": True, "undoc-members": False, "exclude-members": "model_config"}
autodoc_use_type_comments = False
python_display_short_literal_types = True

ROOT_PAGES = {name.lower(): name for name in ("CONTRIBUTING", "ARCHITECTURE", "CONVENTIONS", "CHANGELOG")}
"""Page -> the file at the root of the repository that it shows."""

_LINK = re.compile(r"\[([^\]\n]+)\]\((?!https?:)([^)#\s]+)(#[^)\s]*)?\)")


def _source(app: Sphinx, page: str, source: list[str]) -> None:
    """Read the pages of the root from their files; replace links to files that are not in the site by file names."""
    folder = DOCS
    if page in ROOT_PAGES:
        folder = ROOT
        source[0] = (ROOT / f"{ROOT_PAGES[page]}.md").read_text(encoding="utf-8")
        app.env.note_dependency(str(ROOT / f"{ROOT_PAGES[page]}.md"))
    pages = {file: name for name, file in ROOT_PAGES.items()}

    def resolved(match: re.Match[str]) -> str:
        text, target, anchor = match.groups()
        path = (folder / target).resolve()
        if path.parent == DOCS:
            return f"[{text}]({path.name}{anchor or ''})"
        if path == ROOT / "README.md":
            return f"[{text}](index.md)"
        if path.parent == ROOT and path.stem in pages:
            return f"[{text}]({pages[path.stem]}.md)"
        name = path.relative_to(ROOT).as_posix()
        return f"`{name}`" if name.endswith(text.strip("`")) else f"{text} (`{name}`)"

    source[0] = _LINK.sub(resolved, source[0])


def setup(app: Sphinx) -> None:
    """Register the hook."""
    app.connect("source-read", _source)
