"""Mutation test, run on demand: seeded faults in six areas of the package, and which of them the tests find.

    python -m tests.mutations run --tree TREE --results FILE      tests each one; goes on where it stopped
    python -m tests.mutations table --results FILE                compares the results with those of the baseline

A mutation is a statement of a function and its changed form. It is found again by the name of the function and the
statement, whatever the file. The mutations, which were drawn at random, and their results at the baseline are in
`mutations.json`. TREE is a checkout that nobody edits, with its own .venv (scripts/setup --dev).
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import copy
import functools
import itertools
import json
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

FILE = Path(__file__).with_suffix(".json")
EACH = 12
"""Mutations in an area."""
PACKAGE = Path("src/autodrive")
AREAS = ("tick", "sensors", "bridge", "server", "recording", "campaigns")
MESSAGES = re.compile("debug|info|warning|error|exception|warn|print")
"""Functions whose calls stay: they write texts for people."""
QUICK = "not browser and not toolchain and not process and not wall_clock and not slow"
ALL = ("-n", "2", "-m", QUICK, "tests")

Function = ast.FunctionDef | ast.AsyncFunctionDef
Compound = ast.If | ast.While | ast.For | ast.AsyncFor | ast.With | ast.AsyncWith


class Mutation(NamedTuple):
    """A statement, or the head of a compound one, and its changed form."""

    area: str
    kind: str
    file: str
    """At the baseline."""
    function: str
    before: str
    after: str
    nth: int
    """Which of the equal statements of the function, from 0."""


class Statement(NamedTuple):
    """A statement, and its text, at `lines[first:last]` of a file."""

    path: Path
    text: str
    first: int
    last: int


class Result(NamedTuple):
    """The test that finds a mutation, empty if none does, None if not all are run; and the beginning of its error."""

    by: str | None = None
    error: str = ""


# -- the place in a tree --------------------------------------------------------------------------------------------


def place(mutation: Mutation, tree: Path) -> Statement | None:
    """Where the statement is now: in the function of that name, or the only equal statement; None if it is gone."""
    ranked: dict[int, list[list[Statement]]] = {}
    for path in sorted((tree / PACKAGE).rglob("*.py")):
        for function, statements in _functions(path):
            equal = [one for one in statements if one.text == mutation.before]
            if equal:
                is_named = function.rpartition(".")[2] == mutation.function.rpartition(".")[2]
                is_same = function == mutation.function
                rank = is_named + is_same + (is_same and path.name == Path(mutation.file).name)
                ranked.setdefault(rank, []).append(equal)
    best = max(ranked, default=0)
    (equal, *others) = ranked.get(best, [[]])
    is_certain = best > 0 or (len(equal) == 1 and len(mutation.before) > 20)
    return equal[mutation.nth if best else 0] if is_certain and not others and mutation.nth < len(equal) else None


@functools.cache
def _functions(path: Path) -> list[tuple[str, list[Statement]]]:
    def inside(node: ast.AST, prefix: str) -> Iterator[tuple[str, list[Statement]]]:
        for child in ast.iter_child_nodes(node):
            is_named = isinstance(child, Function | ast.ClassDef)
            if isinstance(child, Function):
                yield prefix + child.name, list(_statements(path, child.body))
            yield from inside(child, f"{prefix}{child.name}." if is_named else prefix)

    return list(inside(ast.parse(path.read_bytes()), ""))


def _statements(path: Path, body: list[ast.stmt]) -> Iterator[Statement]:
    """What is executed in a function, without messages, assertions and inner functions."""
    for one in body:
        match one:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef() | ast.Assert() | ast.Expr(ast.Constant()):
                continue
            case ast.Expr(ast.Call(function)) if MESSAGES.fullmatch(_name(function)):
                continue
            case _:
                pass
        for block in (one, *getattr(one, "handlers", []), *getattr(one, "cases", [])):
            for name in ("body", "orelse", "finalbody"):
                yield from _statements(path, getattr(block, name, []))
        if not isinstance(one, ast.Try | ast.Match):
            last = one.body[0].lineno - 1 if isinstance(one, Compound) else one.end_lineno or one.lineno
            if last >= one.lineno:
                yield Statement(path, _text(one), one.lineno - 1, last)


def _text(statement: ast.stmt) -> str:
    """One line, without comments; of a compound statement its head, with `if` for `elif`."""
    if isinstance(statement, Compound):
        statement = copy.copy(statement)
        statement.body, statement.orelse = [ast.Pass()], []  # pyright: ignore[reportAttributeAccessIssue]
    return ast.unparse(statement).removesuffix("\n    pass")


def _name(function: ast.AST) -> str:
    return getattr(function, "attr", getattr(function, "id", ""))


def mutated(mutation: Mutation, found: Statement) -> str:
    """The source file with that fault."""
    lines = found.path.read_text(encoding="utf-8").split("\n")
    indent, keyword = re.match("( *)((?:el(?=if ))?)", lines[found.first]).groups()  # pyright: ignore[reportOptionalMemberAccess]
    lines[found.first : found.last] = [indent + keyword + mutation.after]
    return "\n".join(lines)


# -- the run --------------------------------------------------------------------------------------------------------


def run(tree: Path, file: Path, limit: float) -> None:
    """Tests every mutation that has no result yet, first in the mirrored folder, and writes each result at once."""
    changes = subprocess.check_output(["git", "-C", tree, "status", "--porcelain", "src", "tests"], text=True)
    if changes or tree == Path(__file__).parents[1]:
        raise SystemExit(f"a run needs a checkout without changes that nobody edits  ({tree})\n{changes}")
    results = read(file) if file.exists() else dict.fromkeys(read(FILE))
    suite = Suite(tree, limit)

    def note(mutation: Mutation, result: Result) -> None:
        results[mutation] = result
        write(file, results)
        by = "not found by its folder" if result.by is None else result.by or "SURVIVED"
        print(f"{mutation.file}, {mutation.function}: {by}", flush=True)

    for mutation in [one for one, result in results.items() if result is None]:
        if place(mutation, tree) is None:
            print(f"NO PLACE: {mutation.file}, {mutation.function}: {mutation.before}")
        else:
            note(mutation, suite.in_folder(mutation))
    remaining = [one for one, result in results.items() if result and result.by is None]
    for at in range(0, len(remaining), EACH):
        for mutation, result in suite.among_all(remaining[at : at + EACH]):
            note(mutation, result)


class Suite:
    """The tests of a checkout, with caches and temporary files that no mutation passes on to the next."""

    def __init__(self, tree: Path, limit: float) -> None:
        self._tree, self._limit = tree, limit
        self._work = tree / ".venv" / "mutations"
        self._cache = self._work / "cache"
        shutil.rmtree(self._work, ignore_errors=True)
        status, output = self._pytest(self._cache, *ALL)  # also fills the cache
        assert status in (0, 1), output
        self._failing = [name for name, _ in failures(output)]

    def in_folder(self, mutation: Mutation) -> Result:
        """Whether the quick tests of the mirrored folder find it."""
        files = mirrored(self._tree, mutation)
        return self._first(mutation, ["-m", QUICK, *files]) if files else Result()

    def among_all(self, mutations: list[Mutation]) -> Iterator[tuple[Mutation, Result]]:
        """All quick tests once, with all these faults; then each fault alone with the tests that failed."""
        with self._faults(mutations) as cache:
            status, output = self._pytest(cache, *ALL)
        failed = [name for name, _ in failures(output) if name not in self._failing]
        if status in (0, 1):
            for mutation in mutations:
                found = self._first(mutation, failed) if failed else Result()
                yield mutation, found if found.by else Result("")
        elif len(mutations) > 1:  # one of them ends or stops the tests
            for half in (mutations[::2], mutations[1::2]):
                yield from self.among_all(half)
        else:
            yield mutations[0], Result("time-out" if status is None else "tests", output[-200:])

    def _first(self, mutation: Mutation, tests: list[str]) -> Result:
        """The first failed test; it also fails alone, whatever the load of the machine."""
        excluded = [*self._failing]
        with self._faults([mutation]) as cache:
            while True:
                status, output = self._pytest(cache, "-x", *tests, *(f"--deselect={name}" for name in excluded))
                if status in (0, 5):  # 5: there are none
                    return Result()
                if status is None:
                    return Result("time-out")
                if not failures(output):  # for example a memory fault, which ends the process
                    return Result("tests", output[-200:])
                name, error = failures(output)[0]
                if self._pytest(cache, name)[0] != 0:
                    return Result(name, error[:200])
                excluded.append(name)

    @contextlib.contextmanager
    def _faults(self, mutations: list[Mutation]) -> Iterator[Path]:
        """The source with these faults, and a folder for caches."""
        own = self._work / "mutant"
        shutil.rmtree(own, ignore_errors=True)
        shutil.copytree(self._cache, own, copy_function=os.link)  # caches replace files, and never change them
        places = [(one, place(one, self._tree)) for one in mutations]
        known = [(found.first, one, found) for one, found in places if found]
        files = {found.path: (found.path.read_bytes(), found.path.stat()) for _, _, found in known}
        try:
            for _, one, found in sorted(known, reverse=True):  # a fault may have fewer lines
                found.path.write_text(mutated(one, found), encoding="utf-8")
            yield own
        finally:
            for path, (content, status) in files.items():
                path.write_bytes(content)
                os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))  # caches depend on it

    def _pytest(self, cache: Path, *arguments: str) -> tuple[int | None, str]:
        """Exit status, None after the time limit, and output."""
        temporary = self._work / "tmp"
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir(parents=True)
        own = {"XDG_CACHE_HOME": str(cache), "TMPDIR": str(temporary), "COLUMNS": "240"}
        environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"} | own
        options = ["-q", "--tb=line", "-p", "no:cacheprovider", "--hypothesis-profile=ci", "--no-loadscope-reorder"]
        command = [self._tree / ".venv" / "bin" / "pytest", *options, *arguments]
        file = self._work / "output"
        with file.open("w", encoding="utf-8") as output:
            process = subprocess.Popen(
                command, cwd=self._tree, env=environment, stdout=output, stderr=output, start_new_session=True
            )
            try:
                status = process.wait(self._limit)
            except subprocess.TimeoutExpired:
                status = None
            finally:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)  # and what a failed test has left
                process.wait()
        return status, file.read_text(encoding="utf-8", errors="replace")


def failures(output: str) -> list[tuple[str, str]]:
    """Name and error of each failed test."""
    return re.findall(r"^(?:FAILED|ERROR) (tests/[^ \[]+(?:\[.*?\](?= - |$))?)(?: - (.*))?$", output, re.MULTILINE)


def mirrored(tree: Path, mutation: Mutation) -> list[str]:
    """Test files of the folder of the source file, with those first that are most likely to find the fault."""
    found = place(mutation, tree)
    assert found
    *folders, module = found.path.relative_to(tree / PACKAGE).with_suffix("").parts
    files: list[Path] = []
    for folder in itertools.accumulate(folders or [module], Path.joinpath, initial=tree / "tests"):
        if folder != tree / "tests":
            files = [*folder.rglob("test_*.py"), *folder.parent.glob(f"test_{folder.name}.py")] or files
    words = [module, *mutation.function.split(".")]

    def likelihood(file: Path) -> tuple[bool, int, str]:
        text = file.read_text(encoding="utf-8")
        return file.stem != f"test_{module}", -sum(text.count(word) for word in words), file.name

    return [file.relative_to(tree).as_posix() for file in sorted(files, key=likelihood)]


# -- results --------------------------------------------------------------------------------------------------------


def read(file: Path) -> dict[Mutation, Result | None]:
    """Each mutation with its result, if it was tested."""
    entries = json.loads(file.read_text(encoding="utf-8"))
    return {
        Mutation(**entry): Result(**result) if result else None for entry in entries for result in [entry.pop("result")]
    }


def write(file: Path, results: Mapping[Mutation, Result | None]) -> None:
    """The whole file: a run that is interrupted goes on from there."""
    entries = [{**key._asdict(), "result": result and result._asdict()} for key, result in results.items()]
    file.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")


def print_table(file: Path) -> None:
    """How many mutations are found in each area, at the baseline and here, and which are not found here."""
    baseline, results = read(FILE), read(file)
    print(f"{'area':12}{'baseline':>9}{'here':>9}")
    for area in AREAS:
        of_area = [
            [one for key, one in both.items() if one and one.by is not None and key.area == area]
            for both in (baseline, results)
        ]
        print(f"{area:12}" + "".join(f"{sum(bool(one.by) for one in ones):>3} of {len(ones):>2}" for ones in of_area))
    for one, result in results.items():
        before = baseline.get(one)
        if result and result.by == "":
            lost = f"LOST, was found by {before.by}" if before and before.by else "survived"
            print(f"{lost}: {one.area}, {one.file}, {one.function}:\n    {one.before}\n    {one.after}")


def main() -> None:
    """The commands in the first lines of this file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=["run", "table"])
    parser.add_argument("--tree", type=Path, default=Path())
    parser.add_argument("--results", type=Path, default=FILE)
    parser.add_argument("--limit", type=float, default=900.0, help="time for one run of the tests [s]")
    given = parser.parse_args()
    tree, file = given.tree.resolve(), given.results.resolve()
    if given.command == "run":
        run(tree, file, given.limit)
    else:
        print_table(file)


if __name__ == "__main__":
    main()
