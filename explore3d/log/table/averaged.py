"""averaged: a table of any length, piece by piece, as the means of runs of consecutive rows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from explore3d import UserError
from explore3d.log.own import (
    SAMPLE_GAP,
    about_averaging,
    averaging_words,
    lone_steps,
    must_fit_analysis,
    step_lengths,
    unit_vectors,
    usual_step,
)
from explore3d.log.table.columns import VECTORS, find_columns, length_factors, time_factor
from explore3d.log.table.order import JUMP, Order
from explore3d.log.table.rows import (
    Columns,
    Samples,
    blocks_of,
    doubts,
    good_rows,
    is_moved,
    nothing_left,
    order_of,
    with_texts,
)
from explore3d.log.table.settings import TableSettings
from explore3d.log.text import TableText
from mapping import FloatArray, IntArray
from mapping.instrument import RunMeans


def averaged(pieces: Iterable[TableText], settings: TableSettings, share: float = 1.0) -> Samples:
    """The samples of a table, each the mean of a run of its rows, in memory that does not grow with the file.

    No run goes over the end of a sweep, a jump, a gap, a step back of the clock, or a turn of the path
    (mapping.instrument.averaging). What is usual (steps, columns, units) is taken from the first piece.

    Args:
        pieces: of the table, in order.
        settings: how to read it; `average` rows make a sample.
        share: of the file that the first piece is, about.

    Raises:
        UserError: as read_table; rows in no order; more samples than the memory takes.
    """
    assert settings.average is not None
    taking: _Taking | None = None
    for text in pieces:
        if taking is None:
            taking = _Taking(text, settings)
            must_fit_analysis(text.path, len(text.rows) / share / settings.average, settings.average)
        taking.take(text)
    assert taking is not None  # a table without rows was refused while it was read
    return taking.samples()


class _Taking:
    """One table on its way through its means."""

    def __init__(self, first: TableText, settings: TableSettings) -> None:
        assert settings.average is not None
        self.first, self.settings = first, settings
        self.roles = find_columns(first, settings.columns)
        self.factors = length_factors(first, self.roles, settings.units)
        self.said: list[str] = []
        if self.roles.get("t") in first.texts:
            self.said.append("times in words are not used while rows are averaged")
            del self.roles["t"]
        self.means = RunMeans(settings.average)
        self.found: list[FloatArray] = []
        self.numbers: dict[str, int] = {}
        self.last: FloatArray | None = None
        self.step = self.tick = self.seconds = 0.0
        self.rows = self.kept = self.cuts = self.part = self.block = 0
        self.reasons: dict[str, None] = {}
        self.cut_short = False

    def take(self, text: TableText) -> None:
        """Take in a piece."""
        if text.names != self.first.names or text.units != self.first.units:
            raise UserError(
                f"{text.path}: field units: the cells of line {text.first_line} and below state other units than those "
                "at its beginning"
            )
        self.said += [each for each in text.said if each not in self.said]
        self.cut_short |= text.cut
        rows = with_texts(text, self.roles, self.said if text is self.first else [], self.numbers)
        good, dropped = good_rows(text, rows, self.roles)
        self.rows += len(rows)
        self.reasons |= {short.partition("left out: ")[2]: None for _, short in dropped}
        blocks = np.zeros(len(rows)) if text.blocks is None else text.blocks - text.blocks[0] + float(self.block)
        self.block = int(blocks[-1])
        if not good.any():
            return
        values = {
            role: np.asarray(rows[good, index]) * self.factors.get(role, 1.0) for role, index in self.roles.items()
        }
        if self.last is None:
            self._know(values, blocks_of(text, good))
        if "t" in values:
            values["t"] = values["t"] * self.seconds
        self._add(values, blocks[good])

    def _know(self, values: Columns, blocks: IntArray | None) -> None:
        """What is usual, from the first piece with a usable row."""
        if "t" in values:
            self.seconds, assumed = time_factor(self.first, self.roles, values["t"])
            self.said += [assumed] * bool(assumed)
            self.tick = self.seconds * usual_step(np.diff(values["t"]))
        if is_moved(order_of(values, self.settings.jump, self.first, blocks)):
            raise self._in_no_order()
        self.said += doubts(self.first, self.roles, values, self.settings)
        self.step = usual_step(step_lengths(_points(values)))

    def _in_no_order(self) -> UserError:
        return UserError(
            f"{self.first.path}: field average: the rows are in no order in which a finger moved, and the mean of "
            "neighbours is the mean of places that are far apart; sort the rows first"
        )

    def _add(self, values: Columns, blocks: FloatArray) -> None:
        points = _points(values)
        others = [values[role] for role in self._others()]
        table = np.column_stack([points, *others, np.zeros(len(points)), blocks])
        joined = table if self.last is None else np.concatenate([self.last[None], table])
        steps = step_lengths(joined)
        cut = lone_steps(steps, SAMPLE_GAP * self.step) | (np.diff(joined[:, -1]) != 0)
        jump = JUMP * self.step if self.settings.jump is None else self.settings.jump
        jumps = steps > jump if self.settings.jump is not None else lone_steps(steps, jump)
        columns = ["x", "y", "z", *self._others()]
        if "sweep" in columns:
            cut |= np.diff(joined[:, columns.index("sweep")]) != 0
        if "t" in columns:
            ticks = np.diff(joined[:, columns.index("t")])
            cut |= (ticks < 0) | (ticks > SAMPLE_GAP * self.tick)
        cut |= jumps
        if self.last is None:
            cut, jumps = np.append(False, cut), np.append(False, jumps)
        table[:, -2] = self.part + np.cumsum(jumps)
        self.part, self.last = int(table[-1, -2]), table[-1].copy()
        self.cuts += int(cut.sum())
        self.kept += len(table)
        self.found.append(self.means.add(table, cut).values)

    def _others(self) -> list[str]:
        return [role for role in self.roles if role not in ("x", "y", "z", "valid")]

    def samples(self) -> Samples:
        """The whole table."""
        dropped: list[tuple[str, str]] = []
        left = self.rows - self.kept
        if left:
            why = ", ".join(self.reasons)
            dropped.append((f"{left:,} of {self.rows:,} rows are left out: {why}", f"{left:,} left out: {why}"))
        if not self.found:
            raise nothing_left(self.first.path, dropped)
        table = np.concatenate([*self.found, self.means.rest().values])
        length = self.means.length
        if short := self.means.left_out:
            clause = f"{short:,} of {self.rows:,} rows are left out, in stretches of fewer than half of {length}"
            dropped.append((clause, f"{short:,} left out: in short stretches"))
        if not len(table):
            raise nothing_left(self.first.path, dropped)
        names = ["x", "y", "z", *self._others()]
        values = {role: table[:, at] for at, role in enumerate(names) if role in self.roles}
        normal = VECTORS["normals"]
        if set(normal) <= values.keys():
            values |= dict(zip(normal, unit_vectors(np.column_stack([values[role] for role in normal])).T, strict=True))
        order = self._order(values, table)
        if is_moved(order):
            raise self._in_no_order()
        assert self.settings.tip_radius is not None
        about = about_averaging(self.means, table[:, :3], order.sweep, self.settings.tip_radius, self.kept, self.cuts)
        said = [order.said] * bool(order.said) + [averaging_words(about)]
        return Samples(
            self.first,
            self.roles,
            self.factors,
            values,
            order,
            self.rows,
            left + short,
            dropped,
            [*self.said, *said],
            about,
            cut_short=self.cut_short,
        )

    def _order(self, values: Columns, table: FloatArray) -> Order:
        """The sweeps: as of any table, and cut at the jumps of its rows, which are shorter than the samples' steps."""
        blocks = None if self.first.blocks is None else np.rint(table[:, -1]).astype(np.int64)
        blocks = None if blocks is None or blocks[0] == blocks[-1] else blocks
        jump = None if self.settings.jump is None else np.inf
        order = order_of(values, jump, self.first, blocks)
        parts = np.rint(table[:, -2]).astype(np.int64)
        if "sweep" in values or ("y" not in values and jump is None) or parts[0] == parts[-1]:
            return order
        cut = (np.diff(order.sweep) != 0) | (np.diff(parts) != 0)
        sweep = np.append(0, np.cumsum(cut)).astype(np.int64)
        return replace(order, sweep=sweep, said=f"{sweep[-1] + 1} sweeps, cut where the rows jump or turn")


def _points(values: Columns) -> FloatArray:
    return np.column_stack([values["x"], values.get("y", np.zeros(len(values["x"]))), values["z"]])
