"""The cells of a table's lines as numbers, compiled: one pass over the bytes, every value correctly rounded.

A decimal number of at most 53 bits times a power of ten of at most 22 is rounded once by IEEE arithmetic, so it is
exact to the last bit. Longer ones, of at most 19 digits (numpy.savetxt writes so many), are multiplied in pairs of
float64, which leaves an error of 2^-100: where both ends of that round to the same number, it is the number. All
others are handed back, for Python's float().

References:
    W. D. Clinger, How to read floating point numbers accurately, PLDI 1990 (the fast path).
    T. J. Dekker, A floating-point technique for extending the available precision, Numer. Math. 18, 1971 (the pairs).
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numba import njit

EXACT = 2**53  # whole numbers up to here are float64 without rounding
TENS = 10.0 ** np.arange(23)  # 10^22 is the last power of ten that float64 holds exactly
# 10^-60 to 10^60 as pairs of float64, whose sum errs by 2^-106 of itself
MOST_POWER = 60
_POWERS = [Fraction(10) ** power for power in range(-MOST_POWER, MOST_POWER + 1)]
POWER = np.array([float(power) for power in _POWERS])
POWER_REST = np.array([float(power - Fraction(float(power))) for power in _POWERS])
# Six products and sums, each rounded to 2^-53 of what is itself 2^-53 of the whole, stay well below
PAIR_ERROR = 2.0**-100
SPLIT = 2.0**27 + 1.0
NEWLINE, RETURN, BLANK, TAB, QUOTE, HASH, PERCENT, SLASH = 10, 13, 32, 9, 34, 35, 37, 47
NUMBER, EMPTY, OTHER = 0, 1, 2


@njit(cache=True, error_model="numpy", nogil=True)
def read_cells(data, start, delimiter, decimal, thousands, textual, rows, lines, blocks, spans, odd, strange, marks):  # type: ignore[no-untyped-def]
    """Read all lines from byte `start` on.

    Args:
        data: (B,) uint8, ends with a newline.
        start: first byte of the first line that is read.
        delimiter: byte, or 0 for white space.
        decimal, thousands: bytes; thousands 0: none.
        textual: (C,) bool, columns whose cells are not read as numbers.
        rows: (N, C) float64, out.
        lines: (N,) number of each row's line, counted from `start`, out.
        blocks: (N,) number of the block between blank lines, out.
        spans: (N, T, 2) first and last byte of the T textual cells, out.
        odd: (K, 4) row, column, first, last byte of cells that are no plain number, out.
        strange: (K, 4) line, cells found, first, last byte of lines with another number of cells, out.
        marks: (C, 4) how many numbers have a decimal sign with 1 to 3 digits before and 3 after; a decimal sign
            otherwise; none; none and a leading zero; out.

    Returns:
        (4,): rows, odd cells, strange lines found, and whether odd or strange were too short (1).
    """
    columns = len(textual)
    at, line, block, row, odds, stranges, full, blank = start, 0, 0, 0, 0, 0, 0, False
    end = len(data)
    shape, usual = np.zeros((columns, 3), dtype=np.int64), thousands == 0 and not textual.any()
    while at < end:
        if usual and row < len(rows):
            stop = _plain_line(data, at, delimiter, decimal, rows[row], shape)
            if stop >= 0:
                for column in range(columns):
                    _mark(marks[column], shape[column, 0], shape[column, 1], shape[column, 2])
                if blank:
                    block, blank = block + 1, False
                lines[row], blocks[row] = line, block
                at, line, row = stop + 1, line + 1, row + 1
                continue
        first = at
        while at < end and (data[at] == BLANK or (data[at] == TAB and delimiter != TAB)):
            at += 1
        if data[at] == NEWLINE or data[at] == RETURN:
            blank = blank or row > 0
            while data[at] != NEWLINE:
                at += 1
            at, line = at + 1, line + 1
            continue
        if _comment(data, at):
            while data[at] != NEWLINE:
                at += 1
            at, line = at + 1, line + 1
            continue
        column, odd_before, texts = 0, odds, 0
        if row == len(rows):
            full = 1
            break
        while True:
            kind, value, before, after, leading, left, right, at = _cell(data, at, delimiter, decimal, thousands)
            if column < columns:
                if textual[column]:
                    spans[row, texts, 0], spans[row, texts, 1] = left, right
                    texts += 1
                    rows[row, column] = np.nan
                elif kind == NUMBER:
                    rows[row, column] = value
                    _mark(marks[column], before, after, leading)
                else:
                    rows[row, column] = np.nan
                    if kind == OTHER:
                        if odds == len(odd):
                            full = 1
                            odds -= 1
                        odd[odds, 0], odd[odds, 1], odd[odds, 2], odd[odds, 3] = row, column, left, right
                        odds += 1
            column += 1
            stop = data[at]
            if stop in (NEWLINE, RETURN) or (column >= columns and _comment(data, at)):
                break
            if delimiter != 0:
                at += 1  # the delimiter
                look = at
                more = column >= columns and delimiter != TAB
                while (
                    data[look] == BLANK
                    or (data[look] == TAB and delimiter != TAB)
                    or (more and data[look] == delimiter)
                ):
                    look += 1
                # delimiters at the end of the line make no column, unless one is missing
                ends = data[look] == NEWLINE or data[look] == RETURN or (column >= columns and _comment(data, look))
                if ends and column >= columns:
                    at = look
                    break
        last = at
        while data[at] != NEWLINE:
            at += 1
        if column == columns:
            if blank:
                block, blank = block + 1, False
            lines[row], blocks[row] = line, block
            row += 1
        else:
            odds = odd_before
            if stranges == len(strange):
                full = 1
                stranges -= 1
            strange[stranges, 0], strange[stranges, 1] = line, column
            strange[stranges, 2], strange[stranges, 3] = first, last
            stranges += 1
        at, line = at + 1, line + 1
    return np.array([row, odds, stranges, full])


@njit(cache=True, error_model="numpy", nogil=True)
def _mark(marks, before, after, leading):  # type: ignore[no-untyped-def]
    """Count a number among those of its column (`marks` of read_cells)."""
    if after < 0:
        marks[2 + leading] += 1
    elif after == 3 and 1 <= before <= 3 and leading == 0:
        marks[0] += 1
    else:
        marks[1] += 1


@njit(cache=True, error_model="numpy", nogil=True)
def _plain_line(data, at, delimiter, decimal, values, shape):  # type: ignore[no-untyped-def]
    """A whole line of plain numbers with nothing but one delimiter between them, as nearly all are.

    Args:
        values: (C,) the numbers, out.
        shape: (C, 3) digits before and after each one's decimal sign (-1: none), leading zero (0, 1), out.

    Returns:
        The place of its newline, or -1: the line holds something else, and `values` is of no use.
    """
    columns = len(values)
    for column in range(columns):
        byte = np.int64(data[at])
        negative = byte == 45
        if negative:
            at += 1
            byte = np.int64(data[at])
        first, zero, number = at, byte == 48, np.int64(0)
        while 48 <= byte <= 57:
            number = number * 10 + (byte - 48)
            at += 1
            byte = np.int64(data[at])
        before, after = at - first, -1
        if byte == decimal and decimal != delimiter:
            at += 1
            start = at
            byte = np.int64(data[at])
            while 48 <= byte <= 57:
                number = number * 10 + (byte - 48)
                at += 1
                byte = np.int64(data[at])
            after = at - start
        digits = before + max(after, 0)
        # 15 digits are always below 2^53
        if digits == 0 or digits > 15:
            return -1
        if column + 1 < columns:
            if byte != delimiter and not (delimiter == 0 and byte in (BLANK, TAB)):
                return -1
            at += 1
        else:
            if byte == RETURN:
                at += 1
            if data[at] != NEWLINE:
                return -1
        value = float(number) / TENS[after] if after > 0 else float(number)
        values[column] = -value if negative else value
        shape[column, 0], shape[column, 1] = before, after
        shape[column, 2] = 1 if zero and (before > 1 or after >= 0) else 0
    return at


@njit(cache=True, error_model="numpy", nogil=True)
def _comment(data, at):  # type: ignore[no-untyped-def]
    return data[at] == HASH or data[at] == PERCENT or (data[at] == SLASH and data[at + 1] == SLASH)


@njit(cache=True, error_model="numpy", nogil=True)
def _ends(data, at, delimiter, quoted):  # type: ignore[no-untyped-def]
    """True if a cell ends at this byte."""
    byte = data[at]
    if byte in (NEWLINE, RETURN):
        return True
    if quoted:
        return byte == QUOTE and data[at + 1] != QUOTE
    if delimiter == 0:
        return byte in (BLANK, TAB)
    return byte == delimiter


@njit(cache=True, error_model="numpy", nogil=True)
def _plain(data, at, delimiter, decimal):  # type: ignore[no-untyped-def]
    """A cell of sign, digits, decimal sign and digits, nearly all there are; kind OTHER if it holds anything else."""
    # the digits are scanned as in _plain_line: one function for both costs a table of two columns 1.3 times the time
    negative = data[at] == 45
    if negative or data[at] == 43:
        at += 1
    first = at
    number = np.int64(0)
    byte = np.int64(data[at])
    while 48 <= byte <= 57:
        number = number * 10 + (byte - 48)
        at += 1
        byte = np.int64(data[at])
    before, after = at - first, -1
    if byte == decimal and decimal != delimiter:
        at += 1
        start = at
        byte = np.int64(data[at])
        while 48 <= byte <= 57:
            number = number * 10 + (byte - 48)
            at += 1
            byte = np.int64(data[at])
        after = at - start
    digits = before + max(after, 0)
    ended = byte in (delimiter, NEWLINE, RETURN)
    if delimiter == 0 and (byte in (BLANK, TAB)):
        ended = True
        while data[at] == BLANK or data[at] == TAB:
            at += 1
    # 15 digits are always below 2^53
    if not ended or digits == 0 or digits > 15:
        return OTHER, np.nan, 0, -1, 0, at
    value = float(number) / TENS[after] if after > 0 else float(number)
    leading = 1 if data[first] == 48 and (before > 1 or after >= 0) else 0
    return NUMBER, -value if negative else value, before, after, leading, at


@njit(cache=True, error_model="numpy", nogil=True)
def _scaled(number, power):  # type: ignore[no-untyped-def]
    """A whole number (uint64) times a power of ten, and whether that is surely the nearest float64."""
    high = float(number)
    if number <= EXACT and -22 <= power <= 22:
        return (high * TENS[power] if power >= 0 else high / TENS[-power]), True
    if power < -MOST_POWER or power > MOST_POWER:
        return np.nan, False
    low = float(np.int64(number - np.uint64(high)))
    ten, rest = POWER[power + MOST_POWER], POWER_REST[power + MOST_POWER]
    product = high * ten
    # Dekker: what the product lost by rounding
    a = SPLIT * high - (SPLIT * high - high)
    b = SPLIT * ten - (SPLIT * ten - ten)
    lost = ((a * b - product) + a * (ten - b) + (high - a) * b) + (high - a) * (ten - b)
    small = lost + (high * rest + low * ten)
    error = PAIR_ERROR * product
    return product + small, product + (small - error) == product + (small + error)


@njit(cache=True, error_model="numpy", nogil=True)
def _cell(data, at, delimiter, decimal, thousands):  # type: ignore[no-untyped-def]
    """One cell: kind, value, digits before and after the decimal sign (-1: none), leading zero, span, and its end."""
    while data[at] == BLANK or (data[at] == TAB and delimiter != TAB):
        at += 1
    kind, plain, before, after, leading, stop = _plain(data, at, delimiter, decimal)
    if kind == NUMBER:
        return NUMBER, plain, before, after, leading, at, stop, stop
    quoted = data[at] == QUOTE
    if quoted:
        at += 1
        while data[at] == BLANK:
            at += 1
    left = at
    negative = data[at] == 45
    if negative or data[at] == 43:
        at += 1
    number, digits, before, after, since, power = np.int64(0), 0, 0, -1, -1, 0
    zero = data[at] == 48
    good = True
    while good and not _ends(data, at, delimiter, quoted):
        byte = data[at]
        if 48 <= byte <= 57:
            if digits < 19:  # above 2^63 the bits are those of the unsigned number
                number = number * 10 + (byte - 48)
                digits += 1 if number != 0 else 0
            else:
                good = False
            if after < 0:
                before += 1
                since += 1 if since >= 0 else 0
            else:
                after += 1
        elif byte == decimal and after < 0:
            good = since < 0 or since == 3
            after = 0
        elif byte == thousands and thousands != 0 and after < 0 and before > 0:
            good = since == 3 if since >= 0 else before <= 3
            since = 0
        else:
            break
        at += 1
    good = good and before + max(after, 0) > 0 and (since < 0 or since == 3)
    exponent = False
    if good and (data[at] == 101 or data[at] == 69):
        exponent = True
        at += 1
        minus = data[at] == 45
        if minus or data[at] == 43:
            at += 1
        good = 48 <= data[at] <= 57
        while 48 <= data[at] <= 57 and power < 10000:
            power = power * 10 + (data[at] - 48)
            at += 1
        power = -power if minus else power
    right = at
    while not _ends(data, at, delimiter, quoted):
        # what follows the number is blank, or else the cell is not a plain number
        if data[at] != BLANK and data[at] != TAB:
            behind = at > left and (data[at - 1] == BLANK or data[at - 1] == TAB)
            if delimiter != 0 and not quoted and _comment(data, at) and good and behind:
                break
            good = False
            right = at + 1
        at += 1
        if quoted and data[at] == QUOTE and data[at + 1] == QUOTE:
            at += 2
    if quoted and data[at] == QUOTE:
        at += 1
        while data[at] == BLANK:
            at += 1
    power -= max(after, 0)
    if delimiter == 0 or quoted:
        while data[at] == BLANK or (data[at] == TAB and delimiter != TAB):
            at += 1
    if right == left:
        return EMPTY, np.nan, 0, -1, 0, left, right, at
    value, sure = _scaled(np.uint64(number), power)
    if not (good and sure):
        return OTHER, np.nan, 0, -1, 0, left, right, at
    leading = 1 if (zero and before > 1) or (zero and after >= 0) else 0
    if after < 0 and exponent:
        after = 0
    return NUMBER, -value if negative else value, before, after, leading, left, right, at
