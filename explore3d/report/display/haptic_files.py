"""Vibrations as files: WAV for voice coils and loudspeakers, Apple's AHAP, MPEG's HJIF."""

from __future__ import annotations

import io
import json
import wave
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.report.display.vibration import EVENT_GAP, Vibration
from mapping import FloatArray, length_text
from mapping.geometry.mesh import write_whole

# Full scale of 16 bit samples
FULL_SCALE_16_BIT = 32767
# Points of a curve in AHAP and keyframes in HJIF, per second: phones follow no faster
CURVE_RATE = 200.0
# Points of one AHAP parameter curve: Core Haptics takes no more
MOST_AHAP_POINTS = 16
# Number of the body that is touched: 0 is kept for bodies that are not described (ISO/IEC 23090-31; its reference
# software refuses an avatar of that number)
AVATAR = 1
# s; continuous events of Core Haptics last no longer
LONGEST_AHAP_EVENT = 30.0


def wav_bytes(vibration: Vibration, full_scale: float | None = None) -> bytes:
    """16 bit mono WAV of the heights, about the middle of their span.

    Args:
        full_scale: height that the largest sample stands for, m; None: the vibration's own amplitude.

    Raises:
        UserError: the vibration is larger than full scale.
    """
    middle = 0.5 * (vibration.height.min() + vibration.height.max())
    scale = full_scale if full_scale is not None else max(vibration.amplitude, np.finfo(float).tiny)
    if vibration.amplitude > scale * (1.0 + 1e-12):
        raise UserError(
            f"--full-scale: the vibration has {length_text(vibration.amplitude)} to either side, the actuator "
            f"{length_text(scale)}; give more, or less exaggeration"
        )
    samples = np.round(FULL_SCALE_16_BIT * (vibration.height - middle) / scale).astype("<i2")
    stream = io.BytesIO()
    with wave.open(stream, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(round(vibration.rate))
        file.writeframes(samples.tobytes())
    return stream.getvalue()


def ahap_bytes(vibration: Vibration, full_scale: float | None = None) -> bytes:
    """Apple Haptic and Audio Pattern: a transient at each event, and one continuous event that follows the heights."""
    level = _levels(vibration, full_scale)
    low, high = vibration.band()
    sharpness = float(np.clip(np.sqrt(max(low * high, 0.0)) / 250.0, 0.0, 1.0))
    pattern: list[dict[str, Any]] = [
        {
            "Event": {
                "Time": float(begin),
                "EventType": "HapticContinuous",
                "EventDuration": float(min(vibration.duration - begin, LONGEST_AHAP_EVENT)),
                "EventParameters": [
                    {"ParameterID": "HapticIntensity", "ParameterValue": 1.0},
                    {"ParameterID": "HapticSharpness", "ParameterValue": sharpness},
                ],
            }
        }
        for begin in np.arange(0.0, vibration.duration, LONGEST_AHAP_EVENT)
    ]
    for time, size in _events(vibration):
        pattern.append(
            {
                "Event": {
                    "Time": time,
                    "EventType": "HapticTransient",
                    "EventParameters": [
                        {"ParameterID": "HapticIntensity", "ParameterValue": size},
                        {"ParameterID": "HapticSharpness", "ParameterValue": 1.0},
                    ],
                }
            }
        )
    times, values = level
    for first in range(0, len(times) - 1, MOST_AHAP_POINTS - 1):
        some = slice(first, first + MOST_AHAP_POINTS)
        begin = float(times[first])
        points = [
            {"Time": float(t - begin), "ParameterValue": float(v)}
            for t, v in zip(times[some], values[some], strict=True)
        ]
        curve = {"ParameterID": "HapticIntensityControl", "Time": begin, "ParameterCurveControlPoints": points}
        pattern.append({"ParameterCurve": curve})
    about = {"Project": "explore3d", "Description": _about(vibration)}
    return _json({"Version": 1.0, "Metadata": about, "Pattern": pattern})


def hjif_bytes(vibration: Vibration, full_scale: float | None = None) -> bytes:
    """MPEG haptics interchange format (ISO/IEC 23090-31): a curve band of the heights, a transient band of the events.

    Its time scale is the vibration's sample, so that times are exact to a sample.
    """
    ticks = vibration.rate
    times, values = _levels(vibration, full_scale, signed=True)
    keyframes = [
        {"relative_position": round(float(t) * ticks), "amplitude_modulation": round(float(v), 6)}
        for t, v in zip(times, values, strict=True)
    ]
    hits = [
        {
            "effect_type": "Basis",
            "position": round(time * ticks),
            "phase": 0.0,
            "base_signal": "Sine",
            "keyframes": [
                {"relative_position": 0, "amplitude_modulation": round(size, 6), "frequency_modulation": 250}
            ],
        }
        for time, size in _events(vibration)
    ]
    curve = {"effect_type": "Basis", "position": 0, "keyframes": keyframes}  # a wave's phase and form are no curve's
    bands: list[dict[str, Any]] = [
        {
            "band_type": "Curve",
            "curve_type": "Linear",
            "lower_frequency_limit": 0,
            "upper_frequency_limit": round(0.5 * CURVE_RATE),
            "effects": [curve],
        }
    ]
    if hits:
        bands.append(
            {"band_type": "Transient", "lower_frequency_limit": 65, "upper_frequency_limit": 300, "effects": hits}
        )
    channel = {
        "id": 0, "description": "height of the fingertip", "gain": 1.0, "mixing_coefficient": 1.0,
        "body_part_mask": 0, "bands": bands,
    }  # fmt: skip
    perception = {
        "id": 0, "avatar_id": AVATAR, "description": "crossing", "perception_modality": "Vibrotactile",
        "unit_exponent": -3, "perception_unit_exponent": 0,
        "reference_devices": [], "effect_library": [], "channels": [channel],
    }  # fmt: skip
    return _json(
        {
            "version": "2023",
            "profile": "Main",
            "level": 1,
            "date": "1970-01-01",
            "description": _about(vibration),
            "timescale": round(ticks),
            "avatars": [{"id": AVATAR, "lod": 0, "type": "Vibration"}],
            "perceptions": [perception],
            "syncs": [{"timestamp": 0}],
        }
    )


VIBRATION_FORMATS: dict[str, Callable[[Vibration, float | None], bytes]] = {
    ".wav": wav_bytes,
    ".ahap": ahap_bytes,
    ".hjif": hjif_bytes,
}


def haptic_file(vibration: Vibration, out: Path | str, full_scale: float | None = None) -> Path:
    """Write a vibration in the format that the file's name ends with.

    Raises:
        UserError: another ending, a folder that is not there, or a vibration larger than full scale.
        OSError: the file cannot be written.
    """
    place = Path(out)
    make = VIBRATION_FORMATS.get(place.suffix.lower())
    if make is None:
        raise UserError(
            f"--out: {place.name} names no format of a vibration; possible endings: {', '.join(VIBRATION_FORMATS)}"
        )
    if not place.parent.is_dir():
        raise UserError(f"--out {place}: there is no folder {place.parent}; make it first")
    return write_whole(place, make(vibration, full_scale))


def _levels(vibration: Vibration, full_scale: float | None, signed: bool = False) -> tuple[FloatArray, FloatArray]:
    """Times, s, and heights between -1 and 1 (0 and 1 if not signed) at CURVE_RATE."""
    count = max(2, int(np.ceil(vibration.duration * CURVE_RATE)) + 1)
    last = (len(vibration.height) - 1) / vibration.rate
    times = np.linspace(0.0, last, count)
    height = np.interp(times, np.arange(len(vibration.height)) / vibration.rate, vibration.height)
    middle = 0.5 * (vibration.height.min() + vibration.height.max())
    scale = max(full_scale if full_scale is not None else vibration.amplitude, np.finfo(float).tiny)
    level = np.clip((height - middle) / scale, -1.0, 1.0)
    return times, np.asarray(level if signed else 0.5 * (1.0 + level))


def _events(vibration: Vibration) -> list[tuple[float, float]]:
    """Times, s, and strengths from 0 to 1 of the events that a person tells apart; of several the strongest."""
    if len(vibration.events) == 0:
        return []
    strongest = float(np.abs(vibration.sizes).max())
    kept: list[tuple[float, float]] = []
    for time, size in zip(vibration.events, np.abs(vibration.sizes) / strongest, strict=True):
        if kept and time - kept[-1][0] < EVENT_GAP:
            if size > kept[-1][1]:
                kept[-1] = (float(time), float(size))
            continue
        kept.append((float(time), float(size)))
    return kept


def _about(vibration: Vibration) -> str:
    return " / ".join(vibration.lines())


def _json(document: dict[str, Any]) -> bytes:
    return (json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()
