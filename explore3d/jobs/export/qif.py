"""The features and their sizes as QIF measurement results.

Reference:
    ANSI/DMSC QIF 3.0, Quality Information Framework (ISO 23952:2020), MeasurementResults.
"""

from __future__ import annotations

import uuid
import xml.etree.ElementTree as ET
from decimal import Decimal
from itertools import count
from typing import Any

from explore3d import __version__
from mapping import Feature, Interval
from mapping.model import DISPROOF, FAIL, PASS, PROOF, UNDECIDED, ObjectModel, overall, probability

QIF_NAMESPACE = "http://qifstandards.org/xsd/qif3"
QIF_VERSION = "3.0.0"
# The document's unit of length, m: drawings and coordinate measuring machines write millimetres
_MILLIMETRE = 1e-3
# Standard deviations in a central interval of 90 % of a Gaussian
_NINETY = 3.29
# QIF's word for each verdict on the whole
STATUS_WORDS = {FAIL: "FAIL", PASS: "PASS", UNDECIDED: "UNKNOWN", "": "NOT_CALCULATED"}
# A document's identity follows from its content: the same model gives the same file
_IDENTITIES = uuid.uuid5(uuid.NAMESPACE_URL, QIF_NAMESPACE)


def qif_results(model: ObjectModel) -> bytes:
    """A QIF document (XML) of what was found, in mm.

    A bump or pit is a point, all others are curves through the vertices of their axes. Each known size is a
    characteristic: its median, with half the 90 % interval over 1.645 as its combined standard uncertainty and the
    interval's ends as attributes. A size that the data only bound has no value, only those ends. Depths of pits and
    grooves are positive. Where tolerances give a size limits, the characteristic has them, and passes or fails if
    that is proved (mapping.model.Tolerance); one of each tolerance, where several speak of a size.
    """
    written = _Document(model)
    return written.content()


class _Document:
    """One document on its way; ids count from 1."""

    def __init__(self, model: ObjectModel) -> None:
        self.model = model
        self._ids = count(1)
        self._last = 0
        self.definitions: list[ET.Element] = []
        self.nominals: list[ET.Element] = []
        self.items: list[ET.Element] = []
        self.features: list[ET.Element] = []
        self.measurements: list[ET.Element] = []

    def content(self) -> bytes:
        root = ET.Element("QIFDocument", {"xmlns": QIF_NAMESPACE, "versionQIF": QIF_VERSION})
        identity = _add(root, "QPId")
        self._header(root)
        standard = self._standard(root)
        units = _add(_add(_add(root, "FileUnits"), "PrimaryUnits"), "LinearUnit")
        _add(units, "SIUnitName", "meter")
        _add(units, "UnitName", "mm")
        _add(_add(units, "UnitConversion"), "Factor", _decimal(_MILLIMETRE))
        for feature in self.model.features:
            self._feature(feature)
        if self.measurements:
            about = _add(root, "Characteristics")
            _add(about, "FormalStandardId", standard)
            for name, aspects in (
                ("Definitions", self.definitions),
                ("Nominals", self.nominals),
                ("Items", self.items),
            ):
                _list(about, f"Characteristic{name}", aspects)
        results = self._results()
        root.append(results)
        root.set("idMax", str(self._last))
        identity.text = str(uuid.uuid5(_IDENTITIES, ET.tostring(results, "unicode")))
        ET.indent(root, " ")
        return bytes(ET.tostring(root, "utf-8", xml_declaration=True)) + b"\n"

    def _new(self) -> str:
        self._last = next(self._ids)
        return str(self._last)

    def _header(self, root: ET.Element) -> None:
        header = _add(root, "Header")
        program = _add(header, "Application")
        _add(program, "Name", f"explore3d {__version__}")
        _add(program, "Organization", "explore3d")
        about = self.model.provenance
        scene = f" of {about['scene']}" if about.get("scene") else ""
        digest = f"; recording with SHA-256 {about['log_sha256']}" if about.get("log_sha256") else ""
        _add(header, "Description", f"Fine surface features that a round fingertip found{scene}{digest}")

    def _standard(self, root: ET.Element) -> str:
        """The standard by which the characteristics are meant; returns its id."""
        standards = _add(root, "StandardsDefinitions", n="1")
        number = self._new()
        standard = _add(standards, "Standard", id=number)
        _add(_add(standard, "Organization"), "StandardsOrganizationEnum", "ISO")
        _add(standard, "Designator", "14405-1")
        _add(
            standard,
            "Title",
            "Geometrical product specifications (GPS) - Dimensional tolerancing - Part 1: Linear sizes",
        )
        return number

    def _feature(self, feature: Feature) -> None:
        number = self._new()
        if len(feature.axis) == 1:
            measured = ET.Element("PointFeatureMeasurement", id=number)
            self._about(measured, feature)
            _add(measured, "Location", _numbers(feature.axis[0] / _MILLIMETRE))
            _add(measured, "Normal", _numbers(feature.normals[0]))
        else:
            measured = ET.Element("PointDefinedCurveFeatureMeasurement", id=number)
            self._about(measured, feature)
            points = _add(measured, "DefiningPoints", n=str(len(feature.axis)))
            for order, (place, normal) in enumerate(zip(feature.axis, feature.normals, strict=True), 1):
                point = _add(points, "DefiningPoint", id=self._new())
                _add(point, "Point", _numbers(place / _MILLIMETRE))
                _add(point, "Normal", _numbers(normal))
                _add(point, "SequenceNumber", str(order))
        self.features.append(measured)
        sunk = feature.height.median < 0
        height = feature.height
        depth = Interval(-height.median, -height.high, -height.low, height.censored, height.bounded) if sunk else height
        for name, size in (
            ("Depth" if sunk else "Height", depth),
            ("Width", feature.width),
            ("Length", feature.length),
        ):
            if not (size.low == size.low and (size.low or size.high)):
                continue  # not known, or none: a step has no width
            asked = [
                (of, each["probability"])
                for of in self.model.provenance.get("tolerances", ())
                for each in of["features"]
                if each["id"] == feature.id and of["size"] in (name.lower(), "height" if name == "Depth" else "")
            ]
            for tolerance, conforms in asked or [(None, None)]:
                self._size(feature.id, number, name, size, tolerance, conforms)

    def _about(self, measured: ET.Element, feature: Feature) -> None:
        known = {"position_sd": _decimal(float(feature.position_sd) / _MILLIMETRE)}
        if (there := probability(feature)) is not None:
            known["probability"] = _decimal(there)
        _attributes(measured, {"kind": feature.kind} | known)
        _add(measured, "FeatureName", feature.id)

    def _size(
        self,
        feature: str,
        number: str,
        name: str,
        size: Interval,
        tolerance: dict[str, Any] | None,
        conforms: float | None,
    ) -> None:
        """A size as definition, nominal, item and measurement, each of which names the one before.

        Args:
            feature, number: its name and the id of its measurement.
            name: of the characteristic.
            size: m.
            tolerance: a record of mapping.model.Judgement, None if nobody asked for limits.
            conforms: the probability that the size lies within them, None if it is not known.
        """
        kind = f"{name}Characteristic"
        definition = ET.Element(f"{kind}Definition", id=self._new())
        _add(definition, "Name", f"{feature} {name.lower()}")
        if tolerance is None:
            _add(definition, "NonTolerance", "MEASURED")
        else:
            limits = _add(definition, "Tolerance")
            for bound, limit in (("MaxValue", tolerance["limit"]), ("MinValue", tolerance["least"] or None)):
                if limit is not None:
                    _add(limits, bound, _decimal(float(f"{limit / _MILLIMETRE:.12g}")))  # as the drawing has it
            _add(limits, "DefinedAsLimit", "true")
        nominal = ET.Element(f"{kind}Nominal", id=self._new())
        _add(nominal, "CharacteristicDefinitionId", definition.attrib["id"])
        item = ET.Element(f"{kind}Item", id=self._new())
        _add(item, "Name", f"{feature} {name.lower()}")
        _add(item, "CharacteristicNominalId", nominal.attrib["id"])
        measurement = ET.Element(f"{kind}Measurement", id=self._new())
        ends = {"low": size.low} if size.censored and not size.bounded else {"low": size.low, "high": size.high}
        _attributes(measurement, {end: _decimal(value / _MILLIMETRE) for end, value in ends.items()})
        _add(_add(measurement, "Status"), "CharacteristicStatusEnum", _status(tolerance, conforms))
        _add(measurement, "CharacteristicItemId", item.attrib["id"])
        _add(_add(measurement, "FeatureMeasurementIds", n="1"), "Id", number)
        if not size.censored:
            sd = (size.high - size.low) / _NINETY / _MILLIMETRE
            _add(measurement, "Value", _decimal(size.median / _MILLIMETRE), combinedUncertainty=_decimal(sd))
        for aspects, aspect in (
            (self.definitions, definition),
            (self.nominals, nominal),
            (self.items, item),
            (self.measurements, measurement),
        ):
            aspects.append(aspect)

    def _results(self) -> ET.Element:
        results = ET.Element("Results")
        one = _add(_add(results, "MeasurementResultsSet", n="1"), "MeasurementResults", id=self._new())
        if self.features:
            _list(one, "MeasuredFeatures", self.features)
        if self.measurements:
            _list(_add(one, "MeasuredCharacteristics"), "CharacteristicMeasurements", self.measurements)
        whole = overall([each["verdict"] for each in self.model.provenance.get("tolerances", ())])
        _add(_add(one, "InspectionStatus"), "InspectionStatusEnum", STATUS_WORDS[whole])
        return results


def _status(tolerance: dict[str, Any] | None, conforms: float | None) -> str:
    if tolerance is None:
        return "NOT_ANALYZED"
    if conforms is None:
        return "INDETERMINATE"
    return "PASS" if conforms >= PROOF else "FAIL" if conforms <= DISPROOF else "INDETERMINATE"


def _add(parent: ET.Element, name: str, text: str = "", **attributes: str) -> ET.Element:
    child = ET.SubElement(parent, name, attributes)
    child.text = text or None
    return child


def _list(parent: ET.Element, name: str, children: list[ET.Element]) -> None:
    """A list element states how many it holds."""
    _add(parent, name, n=str(len(children))).extend(children)


def _attributes(parent: ET.Element, values: dict[str, str]) -> None:
    children = [ET.Element("AttributeStr", name=name, value=value) for name, value in values.items()]
    _list(parent, "Attributes", children)


def _decimal(value: float) -> str:
    """A number without an exponent, which xs:decimal does not know; every digit of the float."""
    return format(Decimal(repr(float(value))), "f")


def _numbers(vector: object) -> str:
    return " ".join(_decimal(float(value)) for value in vector)  # type: ignore[attr-defined]
