"""Files of the user that clients open and save: the folder of `--folder`, and texts that clients send."""

from __future__ import annotations

import itertools
import os
import re
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from autodrive.base.cache import make_folder, write_file
from autodrive.base.errors import AutodriveError
from autodrive.base.readable import readable
from autodrive.base.specs import is_yaml
from autodrive.base.suggest import suggest
from autodrive.base.texts import encodable
from autodrive.base.yaml_files import MAX_BYTES, Source, checked_source, source
from autodrive.connect.server.served import NO_FOLDER, OwnFiles
from autodrive.protocol.messages import MAX_MODULES, LoadScenario, UseMap
from autodrive.protocol.own_files import OpenFile, OwnFile
from autodrive.scenario.files import check_names
from autodrive.scenario.scenario import ScenarioSpec

if TYPE_CHECKING:
    from autodrive.world import World

MAX_FILES = 1000
"""Most files of a folder."""
NAME = re.compile(r"[^\W_][\w -]{0,59}")
"""Name of a file, without its ending."""
RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)
"""Names of devices of Windows."""
KEY = re.compile(r"^(\w+)\s*:[ \t]*(.*)$", re.MULTILINE)
"""A key of a file, at the beginning of its line, and its value."""


class UserFiles(OwnFiles):
    """The files of a folder, which is made if it is not there, and of texts; None: texts only."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._texts: tempfile.TemporaryDirectory[str] | None = None
        if folder is not None:
            make_folder(folder)
            self.folder = folder.resolve().name or str(folder)

    def listed(self) -> dict[str, OwnFile]:
        """The YAML files of the folder by name; what their keys say that they are."""
        return {name: _described(path) for name, path in self._paths().items()}

    def opened(self, operation: OpenFile, world: World) -> LoadScenario | UseMap:
        """A scenario is loaded from its file; one that a client sends has a file of its own until the next one."""
        name, text = operation.name, operation.text
        if text:
            opened = Source(text, f"the text of '{name}'")
            if not _is_scenario(opened.tree):
                return UseMap(text=text)
            check_names(checked_source(opened, ScenarioSpec), world.specs)
            return LoadScenario(str(self._written(name, text)))
        paths = self._paths()
        if name not in paths:
            assert self._folder is not None
            is_link = Path(name).name == name and os.path.islink(self._folder / name)
            problem = "is a link to a place outside" if is_link else "is not in"
            raise AutodriveError(f"'{name}' {problem} the folder '{self.folder}'. {suggest(name, list(paths))}")
        opened = source(paths[name])
        if _is_scenario(opened.tree):
            return LoadScenario(str(paths[name]))
        return UseMap(text=opened.text, modules=self._modules(opened.tree))

    def _modules(self, map_: Any) -> dict[str, str]:
        """Texts of the own modules of a map by their names; no file outside of the folder is read."""
        assert self._folder is not None
        folder, size, texts = self._folder.resolve(), 0, dict[str, str]()
        for name in _own_modules(map_):
            path = (folder / name).resolve()
            if not path.is_relative_to(folder):
                raise AutodriveError(f"module '{name}' is not in the folder '{self.folder}': copy it there")
            texts[name] = source(path).text
            size += len(texts[name])
            if size > MAX_BYTES or len(texts) > MAX_MODULES:
                raise AutodriveError(f"the map has too many own modules: at most {MAX_MODULES}, {MAX_BYTES} bytes")
        return texts

    def save(self, name: str, text: str, *, replaces: bool) -> str:
        """Write NAME.yaml into the folder, never elsewhere."""
        paths = self._paths()
        if not NAME.fullmatch(name) or RESERVED.fullmatch(name):
            raise AutodriveError(
                f"'{name}' cannot be the name of a file: it must have at most 60 letters, digits, spaces, '_' and '-', "
                "and begin with a letter or digit"
            )
        assert self._folder is not None
        path = self._folder / f"{name}.yaml"
        if path.is_symlink():
            raise AutodriveError(f"'{path.name}' is a link to another place: choose another name")
        if os.path.lexists(path):
            if not path.is_file():
                raise AutodriveError(f"'{path.name}' is not a regular file: choose another name")
            if not replaces:
                raise AutodriveError(f"'{path.name}' is in the folder already: choose another name, or replace it")
        elif len(paths) >= MAX_FILES:
            raise AutodriveError(f"the folder '{self.folder}' has {len(paths)} files; at most {MAX_FILES} are possible")
        if len(data := text.encode()) > MAX_BYTES:
            raise AutodriveError(f"the file would have {len(data)} bytes; at most {MAX_BYTES} are possible")
        write_file(path, data)
        return path.name

    def _paths(self) -> dict[str, Path]:
        """The YAML files of the folder by name, sorted, without links to other places. Raises `AutodriveError`."""
        if self._folder is None:
            raise AutodriveError(NO_FOLDER)
        folder = self._folder.resolve()
        try:
            files = (path for path in self._folder.iterdir() if is_yaml(path) and path.is_file())
            own = (path for path in files if path.resolve().is_relative_to(folder))
            return {encodable(path.name): path for path in sorted(itertools.islice(own, MAX_FILES))}
        except OSError as error:
            raise AutodriveError(f"the folder '{self.folder}' cannot be read: {error.strerror or error}") from None

    def _written(self, name: str, text: str) -> Path:
        """A file with that text, which replaces the one before."""
        self._texts = self._texts or tempfile.TemporaryDirectory(prefix="autodrive_")
        folder = Path(self._texts.name)
        for before in folder.iterdir():
            before.unlink()
        stem = re.sub(r"[^\w-]+", "_", Path(name).stem)[:60] or "scenario"
        write_file(folder / f"{stem}.yaml", text)
        return folder / f"{stem}.yaml"


def _described(path: Path) -> OwnFile:
    """The description of a file, without parsing it, so that many large files are listed quickly."""
    try:
        with readable(path).open(encoding="utf-8", errors="replace") as file:
            keys = dict(KEY.findall(file.read(MAX_BYTES)))
    except OSError:
        keys = {}
    kind = "scenario" if _is_scenario(keys) else "track" if {"centre_line", "points"} & keys.keys() else "map"
    return OwnFile(kind, keys.get("title", "").strip().strip("\"'")[:200])


def _own_modules(map_: Any) -> list[str]:
    """Names of files of modules in the values of a map's file, which may be anything."""
    placements = map_.get("placements") if isinstance(map_, dict) else None
    entries = placements if isinstance(placements, list) else []
    names = [entry.get("module") for entry in entries if isinstance(entry, dict)]
    return [*dict.fromkeys(name for name in names if isinstance(name, str) and is_yaml(name))]


def _is_scenario(tree: Any) -> bool:
    return isinstance(tree, dict) and bool({"map", "vehicles"} & tree.keys())
