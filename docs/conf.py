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

_INCLUDE = re.compile(r"```\{include\} (\S+)\n```\n")
_LINK = re.compile(r"\[([^\]\n]+)\]\((?!https?:)([^)#\s]+)(#[^)\s]*)?\)")


def _shown() -> dict[Path, str]:
    """Pages that show a file of the root of the repository, by this file."""
    texts = {page: _INCLUDE.fullmatch(page.read_text(encoding="utf-8")) for page in DOCS.glob("*.md")}
    return {(DOCS / include[1]).resolve(): page.name for page, include in texts.items() if include}


SHOWN = _shown() | {ROOT / "README.md": "index.md"}


def _in_site(text: str, folder: Path) -> str:
    """The text of a file in that folder, with links to pages; links to files that are not in the site become names."""

    def resolved(match: re.Match[str]) -> str:
        words, target, anchor = match.groups()
        path = (folder / target).resolve()
        if path in SHOWN:
            return f"[{words}]({SHOWN[path]}{anchor or '' if path.stem != 'README' else ''})"
        if path.parent == DOCS:
            return f"[{words}]({path.name}{anchor or ''})"
        name = path.relative_to(ROOT).as_posix()
        return f"`{name}`" if name.endswith(words.strip("`")) else f"{words} (`{name}`)"

    return _LINK.sub(resolved, text)


def _read(app: Sphinx, page: str, source: list[str]) -> None:
    source[0] = _in_site(source[0], DOCS)


def _include(app: Sphinx, path: Path, page: str, source: list[str]) -> None:
    source[0] = _in_site(source[0], (DOCS / path).resolve().parent)


def setup(app: Sphinx) -> None:
    """Register the hooks."""
    app.connect("source-read", _read)
    app.connect("include-read", _include)
