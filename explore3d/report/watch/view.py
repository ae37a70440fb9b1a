"""watch: a session in the browser, finished or while it grows, from its log alone; whatever happens here, no run knows.

The view is another program than the run: it reads the log that the run writes anyway, costs the run nothing, and may
die at any moment. While no browser looks, nothing is read.
"""

from __future__ import annotations

import contextlib
import io
import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError, count_text, seconds_text
from explore3d.analysis import FINGER_STAGE, Progress
from explore3d.log import LOG, LogTail, Piece, digest, is_whole, need_log, newest_log, read_base
from explore3d.report.watch.asked import HOST, address, over
from explore3d.report.watch.feature_panel import feature_panel
from explore3d.report.watch.stage import LAYERS_SHOWN, Stage
from explore3d.report.watch.touched import touched
from mapping import MappingError, ObjectModel

# s between two looks at a log that grows: half of the second within which a sample is to be seen
GROWTH_PERIOD = 0.5
NO_FEATURE = "none"
WAITING = "waiting for the first sample"


class Watch:
    """A view of one session, served to browsers on this machine.

    Args:
        place: folder of a session, or a log; a model beside the log is shown with it.
        live: the run that is under way in that folder, or is about to begin, rather than the session that is there.
        port: of the server; the next free one if it is taken.
        host: address to serve on; others than this machine see the view only if it is one of the network's.
        begun: time since when a run that is `live` is under way, ns since the epoch; None: now.

    Raises:
        UserError: viser is not installed, there is neither a log nor a model, or the file is no log.
    """

    def __init__(
        self,
        place: Path | str,
        *,
        live: bool = False,
        port: int = 8080,
        host: str = HOST,
        begun: int | None = None,
    ) -> None:
        need_viewer()
        import viser

        self.place = Path(place)
        self.live = live
        self._begun = time.time_ns() if begun is None else begun
        self.model: ObjectModel | None = None
        self.tail: LogTail | None = None
        self._open_log()
        if not live and self.tail is None and not (self.place / "model.json").is_file():
            raise UserError(f"{self.place}: holds neither {LOG} nor a model; explore3d run or analyze makes them")
        self._lock = threading.RLock()
        self._pictures: list[Any] = []
        self._model_time = 0
        self._model_trouble = ""  # why the model that is there is not shown
        self._under_way = 0  # samples at the end that come again
        with contextlib.redirect_stdout(io.StringIO()):  # the library greets on stdout, where results belong
            self.server = viser.ViserServer(host=host, port=port, label="explore3d", verbose=False)
        self.url = address(host, self.server.get_port())
        self.server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        self.server.gui.main_panel.dock_right()
        self.stage = Stage(self.server, self.choose)
        self._controls()

    def look(self) -> bool:
        """Show what is new; True if there was anything."""
        with self._lock:
            grown = self._look_at_log()
            if self._look_at_model():
                grown = True
            if grown:
                self._tell()
            return grown

    def choose(self, name: str | None) -> None:
        """Mark a feature and tell of it; None marks none."""
        with self._lock:
            name = name if name in self.stage.features else None
            self.stage.choose(name)
            self._choice.value = name or NO_FEATURE
            for each in self._pictures:
                each.remove()
            self._pictures = []
            if name is None or self.model is None:
                self._words.content = "Click a feature: sizes, evidence, profile, posterior."
                return
            words, pictures = feature_panel(
                self.stage.features[name], self.model.base, self.stage.trace(), self.model.features
            )
            self._words.content = words
            self._pictures = [self.server.gui.add_html(_fitted(each)) for each in pictures]

    def scrub(self, t: float) -> None:
        """Show what had been felt until a time of the finger, s."""
        with self._lock:
            self.stage.show_until(self.stage.count_at(t))

    def close(self) -> None:
        """Let go of the port."""
        with contextlib.redirect_stdout(io.StringIO()):  # it says so
            self.server.stop()

    # the panel

    def _controls(self) -> None:
        gui = self.server.gui
        self._state = gui.add_markdown(WAITING)
        self._time = gui.add_slider("finger time, s", min=0.0, max=1.0, step=0.001, initial_value=1.0)
        self._follows = gui.add_checkbox("follow the finger", initial_value=True)
        self._choice = gui.add_dropdown("feature", options=(NO_FEATURE,), initial_value=NO_FEATURE)
        gui.add_button("show all").on_click(lambda _: self.stage.look_at(None))
        with gui.add_folder("layers", expand_by_default=False):
            for name in LAYERS_SHOWN:
                box = gui.add_checkbox(name, initial_value=True)
                box.on_update(lambda event, name=name: self.stage.show_layer(name, event.target.value))
        self._words = gui.add_markdown("")
        self._time.on_update(self._scrubbed)
        self._follows.on_update(lambda _: self._show_all())
        self._choice.on_update(self._chosen)
        self.choose(None)

    def _scrubbed(self, event: Any) -> None:
        if event.client is None:  # set by this program
            return
        with self._lock:
            self._follows.value = self._time.value >= self._time.max
            self.scrub(self._time.value)

    def _chosen(self, event: Any) -> None:
        if event.client is None:
            return
        name = None if self._choice.value == NO_FEATURE else self._choice.value
        self.choose(name)
        self.stage.look_at(name)

    def _show_all(self) -> None:
        with self._lock:
            if self._follows.value:
                self._time.value = self._time.max
                self.stage.show_until(self.stage.count)

    def _tell(self) -> None:
        count = self.stage.count
        self._time.visible = self._follows.visible = self.tail is not None or self.live
        if count:
            end = float(self.stage.t[count - 1])
            self._time.max = max(math.ceil(1e3 * end) / 1e3, 1e-3)  # the slider steps by milliseconds
            if self._follows.value:
                self._show_all()
        title = (self.tail.title if self.tail is not None else "") or self.place.name
        samples = f"{count:,} samples, {seconds_text(float(self.stage.t[count - 1]))}" if count else WAITING
        if self.tail is None:
            samples = f"the model alone: {LOG} is not in this folder"
        elif not self.tail.closed and count:
            samples = f"growing: {samples}"
        found = "" if self.model is None else f"; {count_text(len(self.model), 'feature')}"
        trouble = f"\n\nThe model is not shown: {_escaped(self._model_trouble)}" if self._model_trouble else ""
        self._state.content = f"**{_escaped(title)}**\n\n{samples}{found}{trouble}"

    # what is on the disk

    def _open_log(self) -> None:
        if self.place.is_file():
            path: Path | None = self.place
        elif self.live:
            path = newest_log(self.place) if self.place.is_dir() else None
            if path is not None and self.tail is None and path.stat().st_mtime_ns < self._begun and is_whole(path):
                path = None  # of an earlier run
        else:
            own = self.place / LOG
            path = own if own.is_file() else None if (self.place / "model.json").is_file() else newest_log(self.place)
        if path is not None and self.tail is None:
            need_log(path)
            self.tail = LogTail(path)
        elif path is not None and self.tail is not None:
            self.tail.path = path

    def _look_at_log(self) -> bool:
        if self.tail is None and self.live:
            self._open_log()
        if self.tail is None:
            return False
        try:
            pieces, events, anew = self.tail.look()
        except FileNotFoundError:  # its session took its place in the folder: the same file, elsewhere
            self._open_log()
            return False
        if anew:
            self.stage.clear()
            self._under_way = 0
        base = read_base(events)
        if base is not None:
            self.stage.show_base(base.surface)
        if pieces:
            self.stage.take_back(self._under_way)
            self._under_way = 0
        for piece in pieces:
            self._add(piece)
        return bool(pieces or events)

    def _add(self, piece: Piece) -> None:
        assert self.tail is not None and self.tail.tip_radius is not None
        radius = self.stage.tip_radius = self.tail.tip_radius
        samples = piece.samples
        centers = np.column_stack([samples["x"], samples["y"], samples["z"]])
        self.stage.add(lambda chosen: touched(piece, radius, chosen), centers, samples["t"], samples["sweep"])
        if piece.under_way:
            self._under_way = len(samples)

    def _look_at_model(self) -> bool:
        """Load the model beside the log where it is new, and, of a run that grows, the model of this very log."""
        folder = self.place if self.tail is None or not self.place.is_file() else self.place.parent
        if self.live and self.tail is not None:
            folder = self.tail.path.parent
        if self.live and (self.tail is None or not self.tail.closed):
            return False
        file = folder / "model.json"
        try:
            written = file.stat().st_mtime_ns
        except FileNotFoundError:
            return False
        if written == self._model_time:
            return False
        try:
            model = ObjectModel.load(file)
        except MappingError as error:
            # arrays and record are written one after the other: what is damaged now may be whole at the next look
            told, self._model_trouble = self._model_trouble, str(error)
            return self._model_trouble != told
        self._model_time, self._model_trouble = written, ""
        if self.live and self.tail is not None and model.provenance.get("log_sha256") != digest(self.tail.path):
            return False
        self.model = model
        self.stage.show_base(self.model.base.surface)
        self.stage.show_features(self.model.features)
        self._choice.options = (NO_FEATURE, *(each.id for each in self.model.features))
        return True


def watch(
    place: Path | str,
    *,
    live: bool = False,
    port: int = 8080,
    host: str = HOST,
    told: Callable[[Watch], None] = lambda view: None,
) -> None:
    """Serve a view until Ctrl-C, and keep it up to date while a browser looks; arguments as for Watch.

    Args:
        told: given the view as soon as it shows what there is.
    """
    view = Watch(place, live=live, port=port, host=host)
    view.look()
    told(view)
    _serve(view, lambda: False)


def watch_beside(place: Path | str, port: int, begun: int, ended: threading.Event, told: Callable[[str], None]) -> None:
    """Serve a view of a run, for the program that the run began and that a browser has asked.

    Args:
        place: folder of the session.
        port: where the browser waits.
        begun: when the run began, ns since the epoch.
        ended: set once the run is over; the view ends when nobody looks on any more.
        told: given the address if it had to change: another program took the port.
    """
    view = Watch(place, live=True, port=port, begun=begun)
    if view.url != address(HOST, port):
        told(view.url)
    _serve(view, over(ended, lambda: bool(view.server.get_clients())))


def _serve(view: Watch, is_over: Callable[[], bool]) -> None:
    try:
        while not is_over():
            time.sleep(GROWTH_PERIOD)
            if view.server.get_clients():
                view.look()
    finally:
        view.close()


class ViewBeside:
    """Progress of a run that opens a view of it, a program of its own, when the finger begins.

    Not earlier: a scene or a folder that is refused opens none. The view says on stderr where it is, outlives the run
    as long as a browser looks at it, and takes no signal of the run's.

    Args:
        out: folder that the run writes into.
        progress: told all that this one is told.

    Raises:
        UserError: viser is not installed.
    """

    def __init__(self, out: Path | str, progress: Progress) -> None:
        need_viewer()
        self._command = [sys.executable, "-m", "explore3d", "watch", str(out), "--live", "--attached"]
        self._progress = progress
        self._process: subprocess.Popen[bytes] | None = None

    def __call__(self, stage: str, share: float) -> None:
        if stage == FINGER_STAGE and self._process is None:
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.PIPE, stdout=sys.stderr, start_new_session=True
            )
        self._progress(stage, share)

    @property
    def is_there(self) -> bool:
        """True while it serves."""
        return self._process is not None and self._process.poll() is None


def need_viewer() -> None:
    """Raises UserError: viser is not installed."""
    if find_spec("viser") is None:
        raise UserError('the view needs viser: pip install "explore3d[watch]"')


def _fitted(picture: bytes) -> str:
    """An SVG as wide as the panel, on paper."""
    source = picture.decode().replace("<svg", '<svg style="width:100%;height:auto;background:#fff"', 1)
    return f'<div style="padding:0.3em 0.6em">{source}</div>'


def _escaped(text: str) -> str:
    """Text that Markdown takes as it is."""
    return "".join(f"\\{each}" if each in "\\`*_{}[]<>()#+-.!|" else each for each in text)
