"""GrblFinger: a three-axis machine of the Grbl family with a round tip, as a Finger."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any

import numpy as np

from hw import (
    THROUGH_SPACE,
    FingerError,
    LinkError,
    Move,
    Patience,
    StopOnSignal,
    StoppedError,
    UntrueForceError,
    Workspace,
)
from hw.grbl import ExpectedSurface, GrblController, GuardedStage, StageFrame
from hw.probing.lag import measured_delay
from hw.probing.peck import Peck, Touched
from hw.probing.slide import Slide
from mapping import FloatArray, Surface, Trace

# How long to wait for a sensor to come back, s
RECONNECT = 5.0
# A dead sensor may let the tip press so much of the force limit behind the surface of the model: the force that was
# held before and the rounding of the steps are the rest
DEAD_SHARE = 0.8
# How long the user has to touch the probe, s
TOUCH_BY_HAND = 60.0
# A machine that does not answer for so long when the tip is to be lifted is left as it is, s: ten askings
LAST_LOOK = 0.5
# The probe is looked at so often meanwhile, s: a hand's touch lasts longer
LOOK = 0.02


@dataclass(kw_only=True)
class GrblFinger:
    """Peck tracing with a touch probe, or sliding under a force sensor. Entering connects and moves nothing.

    Args:
        port: serial port of the controller.
        tip_radius: m.
        frame: where the object stands on the machine.
        peck: how to peck, or None.
        slide: how to slide, with its sensor, or None; one of the two.
        armed: without it every move is refused: a dry run on the real machine.
        travel_speed: through free space, m/s.
        over_travel: how far the tip may run on after contact, m.
        max_force: largest force that a move may ask for, N.
        limits: (2, 3) machine coordinates within the controller's own that the tip may take, m; None: all.
        position_known: you vouch that the machine was homed since it was switched on. Holds until it restarts; without
            it, `home` or `unlock`, nothing moves.
        surface: model of the body where it stands: beyond it the tip must have felt something.
        beyond: how far beyond, m; None: DEAD_SHARE of max_force over the stiffness, or over_travel for a touch probe.
        ask: told to ask the user for a touch of the probe, which is then awaited; None: the probe is not checked.
        unlock: send $X if the machine is locked on connecting (its position must be right). Moves nothing.
        home: send $H on connecting. MOVES the machine; needs `armed`.
        baudrate: of the port.
        notice: told of what was touched within a second of it: so that a log has it before the sweep ends.
        waiting: told in words when the machine waits for somebody, as while it is held.
        beside: a context that lives as long as the connection (an emulator).
    """

    port: str
    tip_radius: float
    frame: StageFrame = field(default_factory=StageFrame.of)
    peck: Peck | None = None
    slide: Slide | None = None
    armed: bool = False
    travel_speed: float = 0.03
    over_travel: float = 5e-4
    max_force: float = 5.0
    limits: FloatArray | None = None
    unlock: bool = False
    home: bool = False
    position_known: bool = False
    surface: Surface | None = None
    beyond: float | None = None
    ask: Callable[[str], None] | None = None
    baudrate: int = 115200
    notice: Callable[[Trace], None] | None = None
    waiting: Callable[[str], None] | None = None
    beside: AbstractContextManager[Any] = field(default_factory=nullcontext)
    _stage: GuardedStage | None = field(init=False, default=None, repr=False)
    _open: ExitStack = field(init=False, repr=False, default_factory=ExitStack)
    _away: FloatArray | None = field(init=False, default=None)
    _sweeps: int = field(init=False, default=0)
    _begun: float = field(init=False, default=0.0)
    _lost: str | None = field(init=False, default=None)
    _left: bool = field(init=False, default=False)
    _free: bool = field(init=False, default=False)
    _cut_short: list[str] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        if (self.peck is None) == (self.slide is None):
            raise FingerError("a Grbl finger either pecks or slides; give one of peck and slide")
        for name in ("tip_radius", "travel_speed", "over_travel", "max_force"):
            if not 0 < getattr(self, name) < np.inf:
                raise FingerError(f"grbl finger: {name} must be positive; found {getattr(self, name)}")

    # connection

    def __enter__(self) -> GrblFinger:
        with ExitStack() as undo:
            undo.enter_context(self.beside)
            controller = GrblController(self.port, baudrate=self.baudrate)
            controller.waiting = lambda text: self.waiting(text) if self.waiting is not None else None
            self._signals = undo.enter_context(StopOnSignal(controller.halt))
            undo.callback(controller.close)
            controller.open()
            if self.armed:
                undo.enter_context(controller.stop_if_killed())
            if self.slide is not None:
                undo.enter_context(self.slide.sensor)
                self.slide.sensor.guard(self.max_force, controller.halt)
            self._prepare(controller)
            self._open = undo.pop_all()
        self._begun = time.monotonic()
        return self

    def _prepare(self, controller: GrblController) -> None:
        if self.home:
            if not self.armed:
                raise FingerError("homing moves the machine; it needs --arm")
            controller.home()
        elif controller.alarm is not None:
            if not self.unlock:
                raise FingerError(
                    f"{self.port}: {controller.alarm}; home it ($H), or set unlock if its position is right"
                )
            controller.unlock()
        if self.armed and not self.home:
            if not (self.position_known or self.unlock):
                raise FingerError(
                    f"{self.port}: nobody knows where the machine stands: home it (home = true), or set position_known "
                    "if it was homed since it was switched on and has not been moved by hand"
                )
            controller.vouch()
        bounds = controller.settings.bounds
        if self.limits is not None:
            low, high = self.limits
            bounds = np.stack([np.fmax(bounds[0], low), np.fmin(bounds[1], high)])
        if not np.isfinite(bounds).all():
            raise FingerError(
                f"{self.port}: {controller.firmware} does not state its travel ($130 to $132; FluidNC keeps it in its "
                "configuration file); give low and high in [finger.machine]"
            )
        sensor = None if self.slide is None else self.slide.sensor
        speed = self._speed_of(controller)
        over_travel = self.over_travel
        if self.slide is not None:  # running on must not reach the force limit
            over_travel = min(over_travel, 0.5 * self.max_force / self.slide.stiffness)
        expected = None
        if self.surface is not None:
            beyond = self.over_travel if self.slide is None else DEAD_SHARE * self.max_force / self.slide.stiffness
            expected = ExpectedSurface(self.surface, self.tip_radius, self.beyond or beyond)
        self._stage = GuardedStage(
            controller,
            self.frame,
            bounds,
            speed,
            over_travel,
            sensor,
            expected=expected,
            stiffness=0.0 if self.slide is None else self.slide.stiffness,
            max_force=np.inf if self.slide is None else self.max_force,
        )

    def _speed_of(self, controller: GrblController) -> float:
        return float(np.nanmin(np.append(controller.settings.max_rate, self.travel_speed)))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._stage is None:
            return
        self._signals.ignore()
        try:
            self._retreat(self._stage)
            if self._lost is not None:
                self._stage.controller.run_out()
        finally:
            self._stage = None
            self._open.close()

    def _retreat(self, stage: GuardedStage) -> None:
        """Stop what moves and leave the body; on a machine that is lost or locked nothing can be done.

        A machine that was halted before its first motion is let go of, too: it would refuse the next program.
        """
        controller = stage.controller
        if not self.armed or self._left or not controller.link.is_open:
            return
        self._left = True
        try:
            state = controller.status(within=LAST_LOOK).state
        except LinkError as error:
            controller.halt("leaving")  # all that can be done for a machine that does not answer
            self._lost = f"{self._lost or error}; it does not answer, so that the tip could not be lifted off"
            return
        try:
            if controller.stop_reason is not None or state not in ("Idle", "Alarm"):
                controller.halt("leaving")
                if not controller.clear():
                    return  # the position is lost: any motion could do harm
            if controller.alarm is None and self._away is not None:
                self._lift(stage, 2.0 * self.tip_radius)
        except FingerError as error:
            self._lost = (
                f"{self._lost}; and could not retreat: {error}" if self._lost else f"could not retreat: {error}"
            )

    # what a Finger offers

    @property
    def stage(self) -> GuardedStage:
        """The connected stage. Raises FingerError."""
        if self._stage is None:
            raise FingerError(f"{self.port}: not connected; use the finger as a context manager")
        return self._stage

    @property
    def workspace(self) -> Workspace:
        """The box in the object frame that holds all that the machine can reach; the driver checks exactly."""
        low, high = self.stage.bounds
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        reach = self.frame.to_object(corners)
        return Workspace(reach.min(axis=0), reach.max(axis=0), self.stage.speed, self.max_force)

    @property
    def info(self) -> dict[str, Any]:
        """What is connected, and what the connection has counted so far."""
        controller = self.stage.controller
        sensor = {}
        if self.slide is not None:
            zeros = {"moved": self.slide.zeros.moved, "doubt": self.slide.zeros.doubt}
            sensor = {"sensor": self.slide.sensor.info, "lag": self.slide.lag.seconds, "zero": zeros}
        return {
            "kind": "grbl",
            "touch": "peck" if self.slide is None else "slide",
            "port": self.port,
            "tip_radius": self.tip_radius,
            "resolution": controller.settings.resolution,
            "firmware": controller.version,
            "doubts": controller.doubts,
            "cut_short": list(self._cut_short),
            "settings": {f"${code}": value for code, value in controller.settings.values.items()},
            "origin": self.frame.origin.tolist(),
            "rotation": self.frame.rotation.tolist(),
            "link": controller.link.counters,
        } | sensor

    @property
    def lost(self) -> str | None:
        """Why no move can be made any more, None if they can."""
        return self._lost

    def execute(self, move: Move) -> Trace:
        """Carry out one move; the contacts of a sweep, nothing for any other purpose.

        Raises:
            FingerError: not armed, beyond a limit, or the machine is lost.
        """
        stage = self.stage
        if not self.armed:
            raise FingerError("dry run: nothing is moved on a real port without --arm")
        if self._lost is not None and not self._regained(stage):
            raise FingerError(self._lost)
        self._refuse_what_exceeds(move, stage)
        touched: list[Touched] = []
        self._left = False
        try:
            self._carry_out(move, stage, touched)
        except (LinkError, StoppedError) as error:
            stage.controller.halt(str(error))
            self._lost = str(error)
            self._retreat(stage)  # now, and not when the last samples are thought over: the tip may be pressed hard
            if not any(len(batch.times) for batch in touched):
                raise
            if isinstance(error, UntrueForceError):
                touched.clear()  # nothing is returned in place of what `notice` was told
        except FingerError as error:
            self._cut_short.append(str(error))
            if not any(len(batch.times) for batch in touched):  # what was felt before a line that was refused stays
                raise
        touched = self._settled(stage, touched)
        return Trace.concatenate([self._trace(batch) for batch in touched or [_nothing_felt()]])

    def _settled(self, stage: GuardedStage, touched: list[Touched]) -> list[Touched]:
        """What was felt, put right by what the sensor says in free air; as it is where that cannot be asked."""
        slide = self.slide
        if slide is None or not touched or slide.sensor.fault is not None or not slide.sensor.link.is_open:
            return touched
        try:
            if self._lost is None:
                self._lift(stage, 0.5 * self.tip_radius)
            return slide.settled(stage, touched) if self._free else touched
        except (LinkError, StoppedError) as error:
            if self._lost is None:
                stage.controller.halt(str(error))
                self._lost = str(error)
                self._retreat(stage)
            return [] if isinstance(error, StoppedError) else touched

    def _lift(self, stage: GuardedStage, distance: float) -> None:
        assert self._away is not None
        stage.lift(self._away, distance)
        self._free = True

    def _regained(self, stage: GuardedStage) -> bool:
        """True if all that was lost was the sensor, and it is back: the machine stood still and knows where it is."""
        controller = stage.controller
        if self.slide is None or self.slide.sensor.link.is_open or not controller.link.is_open or controller.alarm:
            return False
        if not self.slide.sensor.reconnect(RECONNECT) or not controller.clear():
            return False
        self._lost = None
        return True

    def forecast(self, move: Move) -> float:
        """About how long a move will take, s: a sweep's pecks, or its path at its speed."""
        stage = self.stage
        if self.peck is None or move.purpose != "sweep":
            return move.duration
        return self.peck.seconds(stage, move)

    def measured_delay(self) -> tuple[float, float]:
        """Delay of the force sensor behind the stage and its standard error, s, where the last sweep ended.

        Raises:
            FingerError: there is no sensor, not armed, or nothing was touched yet.
        """
        if self.slide is None or self._away is None or not self.armed:
            raise FingerError("the delay is measured with a force sensor, armed, after a first sweep")
        return measured_delay(self.stage, self.slide.sensor, -self._away, self.slide.stiffness)

    def _refuse_what_exceeds(self, move: Move, stage: GuardedStage) -> None:
        stage.check(move.path, move.purpose)
        if move.force > self.max_force:
            raise FingerError(f"the {move.purpose} asks for {move.force} N; at most {self.max_force} N are possible")
        if move.speed > stage.speed * (1 + 1e-9):
            raise FingerError(f"the {move.purpose} asks for {move.speed} m/s; at most {stage.speed} m/s is possible")

    def _carry_out(self, move: Move, stage: GuardedStage, touched: list[Touched]) -> None:
        away = -move.approach[0]
        lift = 0.5 * self.tip_radius
        if self._away is None:
            self._begin(stage, away)
        elif not self._free:
            self._lift(stage, lift)
        self._away, self._free = away, False
        if move.purpose in THROUGH_SPACE:
            for point, inwards in zip(move.path, move.approach, strict=True):
                self._away = -inwards
                stage.go(point, -inwards, lift)
            self._free = True  # it stands in free space: there is nothing to back off from
            return
        self._sweeps += 1
        stage.go(move.path[0] + lift * away, away, lift)
        touch = self.peck if self.slide is None else self.slide
        assert touch is not None
        for batch in touch.trace(stage, move):
            touched.append(batch)
            if self.notice is not None and len(batch.times):
                self.notice(self._trace(batch))
        self._away = -move.approach[-1]

    def _begin(self, stage: GuardedStage, away: FloatArray) -> None:
        """Before the first motion: the probe answers to the user's touch, and the tip stands free."""
        stage.free(away)
        if self.slide is not None:
            self.slide.sensor.tare()
            self.slide.sensor.watch.steepest = self.slide.stiffness * stage.speed
        elif self.ask is not None:
            for closed, what in ((True, "touch the tip by hand"), (False, "let go of the tip")):
                self.ask(f"{self.port}: {what}, within {TOUCH_BY_HAND:.0f} s")
                patience = Patience(TOUCH_BY_HAND)
                while stage.closed() != closed:
                    if patience.over():
                        raise StoppedError(
                            f"the probe did not {'close' if closed else 'open'}: check its cable, and its sense ($6)"
                        )
                    time.sleep(LOOK)

    def _trace(self, batch: Touched) -> Trace:
        force = batch.forces
        if force is None and self.slide is not None:
            force = np.zeros((0, 3))
        normals = None if force is None else force / np.linalg.norm(force, axis=1, keepdims=True)
        return Trace.of_readings(
            batch.times - self._begun,
            batch.centers,
            np.full(len(batch.times), self._sweeps),
            self.tip_radius,
            normals=normals,
            force=force,
            resolution=self.stage.controller.settings.resolution,
        )


def _nothing_felt() -> Touched:
    return Touched(np.zeros(0), np.zeros((0, 3)))
