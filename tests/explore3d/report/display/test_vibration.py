"""Crossings as vibrations: against the closed form of a wire, and as files."""

from __future__ import annotations

import io
import json
import os
import wave
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from explore3d import UserError
from explore3d.report.display import Vibration, feel, haptic_file, human_threshold, vibration
from explore3d.report.display.haptic_files import ahap_bytes, hjif_bytes, wav_bytes
from hw.display import DisplayFinger, Rendering
from mapping import Feature, Interval, ObjectModel, Support, Surface
from mapping.base import Base
from mapping.geometry.proxy import ProxyBody, Trench
from mapping.geometry.templates import cap_height, contact_half_width, groove_height
from mapping.model import touchable

SCHEMAS = Path(__file__).with_name("schemas")
R, HEIGHT, SPEED = 5e-3, 0.2e-3, 30e-3
PLATE = Surface(0.03 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]])


def exactly(value: float) -> Interval:
    return Interval(value, value, value)


def model() -> ObjectModel:
    """A wire of 0.2 mm along y on a plate."""
    axis = np.array([[0.0, -15e-3, 0.0], [0.0, 15e-3, 0.0]])
    wire = Feature(
        "ridge", axis, np.broadcast_to([0.0, 0.0, 1.0], axis.shape), exactly(HEIGHT), exactly(HEIGHT),
        exactly(30e-3), Support(20.0, 5), True, 1e-6,
    )  # fmt: skip
    return ObjectModel.attach(Base(PLATE), [wire], provenance={"tip_radius": R})


def complaints(form: str, document: Any) -> list[str]:
    """What the schema of a form has against a document: our own, from what is published of it."""
    import jsonschema

    schema = json.loads((SCHEMAS / f"{form}.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return [each.message for each in jsonschema.Draft202012Validator(schema).iter_errors(document)]


def crossing() -> Vibration:
    return vibration(model(), np.array([[-6e-3, 0.0, 0.0], [6e-3, 0.0, 0.0]]), SPEED)


def test_the_height_is_the_closed_form_at_each_sample() -> None:
    found = crossing()
    x = -6e-3 + np.arange(len(found.height)) * SPEED / 48_000
    assert np.abs(found.height - cap_height(x, HEIGHT, 0.5 * HEIGHT, R)).max() < 2e-8


def test_events_are_the_kinks_within_a_sample() -> None:
    found = crossing()
    half = float(contact_half_width(HEIGHT, 0.5 * HEIGHT, R))
    assert np.abs(found.events - np.array([6e-3 - half, 6e-3 + half]) / SPEED).max() < 1.0 / 48_000


def test_the_wav_has_the_spectrum_of_the_closed_form() -> None:
    found = crossing()
    with wave.open(io.BytesIO(wav_bytes(found))) as file:
        assert file.getparams()[:3] == (1, 2, 48_000)
        samples = np.frombuffer(file.readframes(file.getnframes()), "<i2") / 32767.0
    x = -6e-3 + np.arange(len(samples)) * SPEED / 48_000
    truth = cap_height(x, HEIGHT, 0.5 * HEIGHT, R) / (0.5 * HEIGHT)
    felt, true = (np.abs(np.fft.rfft(each - each[0])) for each in (samples, truth))
    frequency = np.fft.rfftfreq(len(samples), 1.0 / 48_000)
    # up to 1 kHz, wherever the spectrum is above the noise of 16 bits
    loud = (frequency < 1000.0) & (true > 20.0 * np.sqrt(len(samples) / 12.0) / 32767.0)
    assert loud.sum() > 50
    assert np.abs(20.0 * np.log10(felt[loud] / true[loud])).max() < 1.0


def test_an_ahap_file_is_what_core_haptics_reads() -> None:
    document = json.loads(ahap_bytes(crossing()))
    assert complaints("ahap", document) == []
    events = [entry["Event"] for entry in document["Pattern"] if "Event" in entry]
    times = [each["Time"] for each in events if each["EventType"] == "HapticTransient"]
    half = float(contact_half_width(HEIGHT, 0.5 * HEIGHT, R))
    assert np.abs(np.array(times) - np.array([6e-3 - half, 6e-3 + half]) / SPEED).max() < 1.0 / 48_000


def test_an_hjif_file_keeps_the_rules_of_the_reference_software() -> None:
    document = json.loads(hjif_bytes(crossing()))
    assert complaints("hjif", document) == []
    assert date.fromisoformat(document["date"])
    for band in document["perceptions"][0]["channels"][0]["bands"]:
        assert band["lower_frequency_limit"] <= band["upper_frequency_limit"]


@pytest.mark.parametrize("empty", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_crossings_without_events_and_long_ones_validate_too(empty: bool) -> None:
    samples = 10_000 if empty else 48_000 * 70  # longer than one continuous event of Core Haptics
    height = np.zeros(samples) if empty else 1e-4 * np.sin(np.arange(samples) / 500.0)
    found = Vibration(48_000.0, height, np.zeros(0), np.zeros(0), SPEED)
    assert complaints("ahap", json.loads(ahap_bytes(found))) == complaints("hjif", json.loads(hjif_bytes(found))) == []


@pytest.mark.parametrize(
    ("form", "place", "value"),
    [
        ("hjif", "avatars/0/id", 0),
        ("hjif", "timescale", 96_000),
        ("hjif", "perceptions/0/channels/0/bands/0/curve_type", None),
        ("hjif", "perceptions/0/channels/0/bands/1/effects/0/phase", None),
        ("hjif", "perceptions/0/channels/0/bands/0/effects/0/keyframes/0/relative_position", 0.5),
        ("ahap", "Pattern/0/Event/EventDuration", None),
        ("ahap", "Pattern/0/Event/EventParameters/0/ParameterValue", 1.5),
        ("ahap", "Version", 2.0),
    ],
)
def test_the_schemas_refuse_what_readers_refuse(form: str, place: str, value: float | None) -> None:
    document = json.loads({"hjif": hjif_bytes, "ahap": ahap_bytes}[form](crossing()))
    *way, last = place.split("/")
    there = document
    for name in way:
        there = there[int(name)] if isinstance(there, list) else there[name]
    if value is None:
        del there[last]
    else:
        there[last] = value
    assert len(complaints(form, document)) == 1


def test_an_hjif_file_validates_against_the_schemas_of_the_standard() -> None:
    """They are not free to copy: EXPLORE3D_HJIF_SCHEMAS names the folder that holds MPEG_haptics.schema.json."""
    folder = os.environ.get("EXPLORE3D_HJIF_SCHEMAS")
    if folder is None:
        pytest.skip("EXPLORE3D_HJIF_SCHEMAS names no folder with the schemas of ISO/IEC 23090-31")
    import jsonschema
    import referencing

    schemas = {path.name: json.loads(path.read_text()) for path in Path(folder).glob("*.json")}

    def named(uri: str) -> Any:
        return referencing.Resource.from_contents(
            schemas[uri.rsplit("/", 1)[-1]], default_specification=referencing.jsonschema.DRAFT202012
        )

    registry = referencing.Registry(retrieve=named)  # type: ignore[call-arg]
    whole = schemas["MPEG_haptics.schema.json"]
    validator = jsonschema.validators.validator_for(whole)(whole, registry=registry)
    assert [error.message for error in validator.iter_errors(json.loads(hjif_bytes(crossing())))] == []


def test_an_hjif_file_has_what_the_reference_reader_asks_for() -> None:
    document = json.loads(hjif_bytes(crossing()))
    assert {"version", "profile", "level", "date", "description", "avatars", "perceptions", "syncs"} <= document.keys()
    (perception,) = document["perceptions"]
    assert perception["perception_modality"] == "Vibrotactile" and perception["effect_library"] == []
    assert perception["avatar_id"] in [each["id"] for each in document["avatars"]]
    (channel,) = perception["channels"]
    assert {"id", "description", "gain", "mixing_coefficient", "body_part_mask", "bands"} <= channel.keys()
    curve, transient = channel["bands"]
    for band in (curve, transient):
        assert isinstance(band["lower_frequency_limit"], int) and isinstance(band["upper_frequency_limit"], int)
        for effect in band["effects"]:
            assert effect["effect_type"] == "Basis" and isinstance(effect["position"], int)
            places = [each["relative_position"] for each in effect["keyframes"]]
            assert places == sorted(places)
            assert all(-1.0 <= each["amplitude_modulation"] <= 1.0 for each in effect["keyframes"])
    half = float(contact_half_width(HEIGHT, 0.5 * HEIGHT, R))
    at = np.array([each["position"] for each in transient["effects"]]) / document["timescale"]
    assert np.abs(at - np.array([6e-3 - half, 6e-3 + half]) / SPEED).max() < 1.0 / 48_000


def test_a_person_feels_it_and_no_wire_a_thousand_times_lower() -> None:
    assert crossing().above_threshold() > 1.0
    frequency = np.array([10.0, 250.0, 1000.0])
    assert np.allclose(human_threshold(frequency), [8e-6, 8e-6 * 0.16**2, 8e-6 * 0.16**2 * 16.0])


def test_what_cannot_be_is_refused(tmp_path: Path) -> None:
    found = crossing()
    with pytest.raises(UserError, match=r"possible endings: \.wav, \.ahap, \.hjif"):
        haptic_file(found, tmp_path / "crossing.mp3")
    with pytest.raises(UserError, match="there is no folder"):
        haptic_file(found, tmp_path / "absent" / "crossing.wav")
    with pytest.raises(UserError, match="--full-scale"):
        haptic_file(found, tmp_path / "crossing.wav", 1e-6)
    assert not list(tmp_path.iterdir())
    here = np.zeros((2, 3))
    with pytest.raises(UserError, match="two places"):
        vibration(model(), here, SPEED)
    with pytest.raises(UserError, match="--speed"):
        vibration(model(), here, 0.0)
    with pytest.raises(UserError, match="samples"):
        vibration(model(), np.array([[0.0, 0, 0], [1e-6, 0, 0]]), 1.0)


def test_a_simulated_hand_feels_the_wire_and_the_log_says_so(tmp_path: Path) -> None:
    from explore3d.log import read_log

    felt = feel(model(), paced=False, log=tmp_path / "felt.mcap", rendering=Rendering(stiffness=1000.0))
    assert felt.run.reason == "done" and felt.trace.sweep.max() >= 3
    trace = read_log(tmp_path / "felt.mcap").trace
    assert np.array_equal(trace.centers, felt.trace.centers) and trace.tip_radius == R
    x, _, z = trace.centers.T
    assert np.abs(z - R - cap_height(x, HEIGHT, 0.5 * HEIGHT, R)).max() < 1e-8
    assert "energy made by the display: 0 µJ" in "\n".join(felt.lines())


def test_a_finger_explores_what_is_displayed() -> None:
    from hw import Move

    body, left_out = touchable(model(), R)
    assert left_out == ()
    finger = DisplayFinger(object=PLATE, tip_radius=R, rate=1000.0, display=body)
    level = np.array([[-6e-3, 1e-3, R], [6e-3, 1e-3, R]])
    trace = finger.execute(Move(level, [0.0, 0.0, -1.0], speed=SPEED))
    x, _, z = trace.centers.T
    assert len(trace) > 300
    assert np.abs(z - R - cap_height(x, HEIGHT, 0.5 * HEIGHT, R)).max() < 1e-8


def test_what_breaks_off_a_display_costs_nothing_that_was_felt(tmp_path: Path) -> None:
    from explore3d.log import read_log

    count = 0

    def broken(records: np.ndarray) -> bool:
        nonlocal count
        count += 1
        if count == 3:
            raise RuntimeError("the power fails")
        return False

    with pytest.raises(RuntimeError, match="power"):
        feel(model(), paced=False, log=tmp_path / "felt.mcap", look=broken)
    trace = read_log(tmp_path / "felt.mcap").trace
    assert len(trace) > 2000 and trace.sweep.max() >= 2


def test_a_finger_on_a_stiff_display_reaches_into_hollows() -> None:
    from hw import Move

    body = ProxyBody(PLATE, (Trench(model()["ridge-1"].axis, np.tile([0.0, 0.0, 1.0], (2, 1)), 3e-3, 0.15e-3),), R)
    finger = DisplayFinger(object=PLATE, tip_radius=R, rate=1000.0, display=body)
    level = np.array([[-6e-3, 1e-3, R], [6e-3, 1e-3, R]])
    trace = finger.execute(Move(level, [0.0, 0.0, -1.0], speed=SPEED))
    x, _, z = trace.centers.T
    assert np.abs(z - R - groove_height(x, 3e-3, R, 0.15e-3)).max() < 1e-6
    spacing = np.diff(x)  # it neither dwells nor hurries, but for the tip's own lean
    assert len(x) == 401 and spacing.min() > 0.8 * SPEED / 1000.0 and spacing.max() < 1.2 * SPEED / 1000.0
