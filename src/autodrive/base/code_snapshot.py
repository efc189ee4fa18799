"""Code of the user as it was at one time, which campaigns and races run, whatever becomes of its files meanwhile."""

from __future__ import annotations

import contextlib
import hashlib
import os
import shlex
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from autodrive.base.cache import PACKAGE
from autodrive.base.errors import AutodriveError
from autodrive.base.python_files import copied, opaque, own_paths


@dataclass(frozen=True)
class Code:
    """Files of the user as they were at one time."""

    root: Path
    """Folder that contains all files, `folder` and the working directory."""
    directory: Path
    """Working directory, from the root."""
    folder: Path
    """Folder, from the root, in which the paths of the user begin, and in which scripts work."""
    files: dict[str, bytes]
    """Contents of the files by path from the root, in the order in which they were named."""
    paths: tuple[str, ...]
    """Folders of the user in `sys.path`."""

    @classmethod
    def read(cls, files: Iterable[Path], folder: Path) -> Code:
        """The code in these files as they are now; those of the package are where the package is.

        Raises `AutodriveError` if a file cannot be read, also while `files` looks for files.
        """
        directory, folder = Path.cwd(), Path(os.path.abspath(folder))
        try:
            paths = dict.fromkeys(Path(os.path.abspath(file)) for file in files)
            paths = [path for path in paths if not path.is_relative_to(PACKAGE)]
            root = Path(os.path.commonpath([*(path.parent for path in paths), folder, directory]))
            contents = {path.relative_to(root).as_posix(): path.read_bytes() for path in paths}
        except OSError as error:
            raise AutodriveError(f"cannot read: {error.strerror}  ({error.filename})") from None
        return cls(root, directory.relative_to(root), folder.relative_to(root), contents, own_paths())

    @property
    def digest(self) -> str:
        """SHA-256 of the contents of the files, in their order."""
        return hashlib.sha256(b"".join(self.files.values())).hexdigest()

    @property
    def opaque(self) -> str:
        """Places in the files that run code which no file names, so that it may not be one of them; empty without."""
        places = [place for name in self.files if name.endswith(".py") for place in opaque(name, self.files[name])]
        return "; ".join(places[:3]) + (f"; and {len(places) - 3} more" if places[3:] else "")

    def write(self, target: Path) -> None:
        """Write the files into a folder, and make the working directory and `folder` there. Raises `OSError`."""
        for name, content in self.files.items():
            path = target / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        for folder in (self.folder, self.directory):
            (target / folder).mkdir(parents=True, exist_ok=True)

    def copy_of(self, file: str, target: Path) -> str:
        """The path of a file, or of a class or function in it, in the folder `target`; another file has its own."""
        path, colon, name = file.rpartition(":") if ".py:" in file else (file, "", "")
        inside = os.path.relpath(path, self.root)
        return f"{target / inside}{colon}{name}" if Path(inside).as_posix() in self.files else file

    def command_with_copies(self, command: str, target: Path) -> str:
        """A command line in which absolute paths are those of the copies."""
        words = [self.copy_of(word, target) if Path(word).is_absolute() else word for word in shlex.split(command)]
        return shlex.join(words)


@dataclass(frozen=True)
class Workplace:
    """Where a process runs copies of code."""

    directory: Path
    """Working directory of the runs."""
    root: Path
    """Folder of the copies of the files below `original`."""
    original: Path
    paths: tuple[str, ...]
    """Folders of the user in `sys.path`, whose copies are imported."""

    @contextlib.contextmanager
    def entered(self) -> Iterator[None]:
        """Let this process and those that it starts import the copies, inside the block."""
        before, variable = [*sys.path], os.environ.get("PYTHONPATH")
        inside = [path for path in self.paths if Path(path).is_relative_to(self.original)]
        copies = {path: str(self.root / os.path.relpath(path, self.original)) for path in inside}
        copies = {path: copy for path, copy in copies.items() if os.path.isdir(copy)}
        sys.path[:] = [copies.get(os.path.abspath(path), path) for path in dict.fromkeys([*before, *self.paths])]
        if variable:
            words = variable.split(os.pathsep)
            os.environ["PYTHONPATH"] = os.pathsep.join(copies.get(os.path.abspath(word), word) for word in words)
        try:
            with copied(self.original, self.root):
                yield
        finally:
            sys.path[:] = before
            if variable:
                os.environ["PYTHONPATH"] = variable


class CodeSnapshot:
    """A folder with copies of code, from which it runs; the originals may change meanwhile.

    Each copy has the path from this folder that the original has from the root of the file system. Everything else
    beside the originals is there, too, as a link.
    """

    def __init__(self, code: Code, data: Iterable[Path] = ()) -> None:
        """`data`: files that are read, not run. Raises `AutodriveError` if the folder cannot be written."""
        self._code = code
        self._stack = contextlib.ExitStack()
        try:
            folder = tempfile.TemporaryDirectory(prefix="autodrive-code-", ignore_cleanup_errors=True)
            self._folder = Path(os.path.realpath(self._stack.enter_context(folder)))
            self.root = self._folder / code.root.relative_to(code.root.anchor)
            """The copy of the root of the code."""
            code.write(self.root)
            for name in code.files:
                with contextlib.suppress(FileNotFoundError):
                    shutil.copymode(code.root / name, self.root / name)  # a script may be a program
            self._linked = self._link()
        except OSError as error:
            self._stack.close()
            raise AutodriveError(f"the code cannot be copied: {error.strerror}") from None
        here = code.root / code.directory
        reads_here = any(Path(os.path.abspath(file)).is_relative_to(here) for file in data)
        directory = self.root / code.directory if reads_here else here
        self.workplace = Workplace(directory, self.root, code.root, code.paths)
        """The workplace of the code; the working directory is a copy if `data` are in it."""

    @property
    def folder(self) -> Path:
        """The copy of the folder in which scripts work."""
        return self.root / self._code.folder

    def named(self, text: str) -> str:
        """The text with the names of the originals."""
        return text.replace(str(self._folder) + os.sep, self._code.root.anchor)

    def close(self) -> None:
        """Move what the runs have written beside the copies to the originals, and remove the folder."""
        with contextlib.suppress(OSError):
            for copy, original in self._folders():
                for entry in [*os.scandir(copy)] if copy.is_dir() else []:
                    path, target = Path(entry.path), original / entry.name
                    is_new = not entry.is_symlink() and entry.name != "__pycache__" and path not in self._copies
                    if is_new and (path in self._linked or not os.path.lexists(target)):
                        shutil.move(path, target)
        self._stack.close()

    def _folders(self) -> list[tuple[Path, Path]]:
        """The folders of the copies that are no links, and their originals."""
        anchor = Path(self._code.root.anchor)
        folders = self._copies - {self.root / name for name in self._code.files}
        return [(copy, anchor / copy.relative_to(self._folder)) for copy in sorted(folders)]

    def _link(self) -> set[Path]:
        """Links to everything beside the originals, where the system has links."""
        self._copies = {self.root / name for name in self._code.files}
        self._copies |= {self.folder, self.root / self._code.directory}
        self._copies |= {copy for path in self._copies for copy in path.parents if copy.is_relative_to(self._folder)}
        linked = set[Path]()
        for copy, original in self._folders():
            with contextlib.suppress(OSError, NotImplementedError):
                for entry in os.scandir(original):
                    path = copy / entry.name
                    if entry.name != "__pycache__" and path not in self._copies:
                        path.symlink_to(entry.path)
                        linked.add(path)
        return linked
