"""What can go wrong that a user can mend: every such error of this package is an `AutodriveError`."""


class AutodriveError(Exception):
    """Base of all errors that a user can mend; the text says what is wrong, where, and what would be right."""


class SpecError(AutodriveError):
    """A description (vehicle, module, map, scenario) is wrong. Holds every fault of the file at once.

    `faults` is the list of texts; the error's own text shows them all, the file's path last.
    """

    def __init__(self, faults: list[str], path: str = "") -> None:
        self.faults = faults
        self.path = path
        lines = faults if len(faults) == 1 else [f"{len(faults)} faults:", *(f"  - {fault}" for fault in faults)]
        super().__init__("\n".join(lines) + (f"  ({path})" if path else ""))


class CommandError(AutodriveError):
    """A `Command` cannot be obeyed: unknown vehicle, or a value that is not a finite number."""


class EngineError(AutodriveError):
    """The physics engine cannot go on, for example because the state became non-finite."""
