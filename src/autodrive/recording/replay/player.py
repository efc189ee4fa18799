"""Shows a recording in the place of a Simulation: the same Frames for the same Sinks, at any time and speed."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from msgspec.structs import replace

from autodrive.base.errors import AutodriveError, CommandError
from autodrive.base.pace import MAX_LAG, MEASURING_TIME
from autodrive.protocol.commands import check_operation, is_number
from autodrive.protocol.messages import (
    Command,
    Event,
    Frame,
    Operation,
    Pause,
    Resume,
    SaveMap,
    SaveScenario,
    Seek,
    SetSpeed,
    Step,
)
from autodrive.world.simulation.paced import Execution, Paced

if TYPE_CHECKING:
    from autodrive.graphics.cameras.process_cameras import ProcessCameras
    from autodrive.protocol.native import ContactForces, Source
    from autodrive.recording.replay.tape import Tape
    from autodrive.world import World
    from autodrive.world.simulation.clock import Clock

PERIOD = 1.0 / 60.0
"""Wall time between two Frames [s]."""
LEAST_SPEED, MOST_SPEED = 1e-3, 1e3
"""Recorded seconds per wall second."""

IMAGE_POLL_PERIOD = 0.02
"""While time stands still, images that are being drawn are awaited in steps of this time [s]."""

FORCES_POLL_PERIOD = 0.1
"""Interval while time stands still at which the player checks whether somebody looks at contact forces, and whether
they are known [s]."""

log = logging.getLogger(__name__)


class Stage(NamedTuple):
    """The World of a scenario, which is never stepped, and what draws images that were not recorded."""

    world: World
    cameras: ProcessCameras | None = None


class Player(Paced):
    """Plays a recording; it has the methods and values of a `Simulation` that the server uses.

    All viewers see the same time of the recording. A Frame that is shown while time passes has all events since the one
    before. `stages(time)` makes the Stage at a time of the recording, the same object while the scenario is the same.
    `forces(time)`: the contact forces there; None: not known yet. `clock` replaces the wall clock, for tests.
    """

    def __init__(
        self,
        tape: Tape,
        stages: Callable[[float], Stage],
        *,
        speed: float = 1.0,
        is_paused: bool = False,
        forces: Callable[[float], dict[str, ContactForces] | None] | None = None,
        clock: Clock | None = None,
    ) -> None:
        super().__init__(tape.frame_at(0.0), clock=clock, is_paused=is_paused, keeps_running=True)
        self._tape = tape
        self._stages = stages
        self._forces = forces
        self._speed = _checked_speed(speed)
        self._position = 0.0
        self._recorded = self._frame
        """The Frame as it was recorded."""
        self._stage = stages(0.0)
        self.world = self._stage.world
        self.world.drawings = tape.drawings_at(0.0)
        self._real_time_factor = 0.0
        self._wants_images = False

    # -- state --------------------------------------------------------------------------------------------------

    @property
    def position(self) -> float:
        """Time of the recording that is shown [s]."""
        return self._position

    @property
    def speed(self) -> float:
        """Recorded seconds per wall second."""
        return self._speed

    @property
    def real_time_factor(self) -> float:
        """Recorded seconds per wall second, measured over about the last second."""
        return 0.0 if self._is_paused else self._real_time_factor

    @property
    def refusal(self) -> str:
        """Why commands and requests that change the world have no effect."""
        return (
            f"this is a replay of '{self._tape.name}': the recorded commands drive the vehicles, and nothing can be "
            "changed. To drive, start a simulation: autodrive run"
        )

    # -- commands and requests ----------------------------------------------------------------------------------------

    def submit(self, vehicle: str, command: Command, source: Source = "script") -> None:
        """Raises `CommandError`: the recorded commands drive."""
        raise CommandError(self.refusal)

    def request(self, request: Operation, *, here: bool = False) -> Execution:
        """Play, pause, step, seek or set the speed; the result is the Frame after it. Raises `CommandError`."""
        check_operation(request)
        match request:
            case Pause() | Resume() | SaveScenario() | SaveMap():
                pass
            case Step(ticks=ticks, commands=commands):
                if commands:
                    raise CommandError(self.refusal)
                if not -(10**6) <= ticks <= 10**6:
                    raise CommandError(f"a Step in a replay shows a Frame at most {10**6} ticks away, not {ticks}")
            case SetSpeed(factor=factor):
                _checked_speed(factor)
            case Seek(time=time):
                if not is_number(time):
                    raise CommandError(f"the time of a Seek must be a number of seconds, not {time}")
            case _:
                raise CommandError(self.refusal)
        return self._post(request, Execution())

    def want_images(self, wanted: bool) -> None:
        """Whether Frames need the images of the cameras."""
        with self._mailbox:
            self._wants_images = wanted
            self._mailbox.notify_all()

    # -- the thread ---------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Play in a thread of its own until `stop`."""
        self._start_thread(self._loop, "autodrive-replay")

    def _loop(self) -> None:
        before = self._clock.now()
        measured = before, self._position
        due = before + PERIOD
        while not self._is_stopping:
            self.execute_requests()
            self._set_images_wanted()
            now = self._clock.now()
            if self._is_paused:
                before, measured, due = now, (now, self._position), now + PERIOD
                cameras = self._stage.cameras
                is_drawing = cameras is not None and cameras.has_pending_images
                self._sleep(IMAGE_POLL_PERIOD if is_drawing else self._forces and FORCES_POLL_PERIOD)
                self._show_images()
                if self._set_forces():
                    self._publish(self._frame)
                before = self._clock.now()
                continue
            if now < due:
                self._sleep(due - now)
                continue
            due = max(due + PERIOD, now)
            # a computer that was suspended, or that is too slow, does not skip a part of the recording
            self._play(min(now - before, MAX_LAG) * self._speed)
            before = now
            if now - measured[0] >= MEASURING_TIME:
                self._real_time_factor = max(self._position - measured[1], 0.0) / (now - measured[0])
                measured = now, self._position

    def _set_images_wanted(self) -> None:
        wanted = self._wants_images
        if self._stage.cameras is not None:
            self._stage.cameras.is_wanted = wanted
        if self._tape.has_images != wanted:
            self._tape.has_images = wanted
            self._show(self._position)

    def _execute(self, request: Operation) -> None:
        match request:
            case Pause():
                self._is_paused = True
            case Resume():
                if self._position >= self._tape.duration:
                    self._show(0.0)
                self._is_paused = False
            case Step(ticks=ticks):
                if self._is_paused and ticks:
                    self._show(self._tape.time_of_frame(self._position, ticks))
            case SetSpeed(factor=factor):
                self._speed = _checked_speed(factor)
            case Seek(time=time):
                self._show(min(max(time, 0.0), self._tape.duration))
            case _:
                pass

    def _play(self, elapsed: float) -> None:
        """Go on by that time of the recording [s]; pauses at the end, and where the file cannot be read."""
        before, end = self._position, self._tape.duration
        after = min(before + elapsed, end)
        try:
            self._show(after, self._tape.events_between(before, after), is_jump=False)
        except AutodriveError as error:
            log.error("the replay is paused: %s", error)
            self._is_paused = True
        if after >= end:
            self._is_paused = True

    def _show(self, time: float, events: tuple[Event, ...] = (), *, is_jump: bool = True) -> None:
        """Show a time of the recording; `is_jump`: not the time that follows."""
        frame, stage = self._tape.frame_at(time), self._stages(time)
        self._position = time
        is_new = frame is not self._recorded or stage is not self._stage or bool(events)
        is_jump = is_jump or frame.tick < self._recorded.tick  # a recorded reset
        self._recorded, self._stage, self.world = frame, stage, stage.world
        stage.world.drawings = self._tape.drawings_at(time)
        self._set_forces()
        if not is_new:
            return
        if stage.cameras is not None:
            frame = stage.cameras.update(frame, redraw=is_jump)
        self._publish(replace(frame, events=events) if events else frame)

    def _set_forces(self) -> bool:
        """Show the contact forces of that time, if somebody looks at them; whether they are others."""
        before = self.world.contact_forces
        if self._forces is not None and self.world.watches_contacts:
            self.world.contact_forces = self._forces(self._position) or {}
        return bool(before or self.world.contact_forces) and self.world.contact_forces is not before

    def _show_images(self) -> None:
        """Show images that were drawn meanwhile."""
        if self._stage.cameras is not None:
            frame = self._stage.cameras.update(self._recorded)
            if _images(frame) != _images(self._frame):
                self._publish(frame)


def _images(frame: Frame) -> list[int]:
    """The identities of all images."""
    return [id(image) for vehicle in frame.vehicles.values() for image in vehicle.cameras.values()]


def _checked_speed(speed: float | None) -> float:
    if speed is None:
        raise CommandError("a replay has a speed: a number of recorded seconds per second, not 'as fast as possible'")
    if not (is_number(speed) and LEAST_SPEED <= speed <= MOST_SPEED):
        raise CommandError(f"the speed of a replay must be from {LEAST_SPEED:g} to {MOST_SPEED:g}, not {speed}")
    return float(speed)
