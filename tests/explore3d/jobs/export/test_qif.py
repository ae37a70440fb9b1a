"""Measured results as QIF: read back as XML; the schema of QIF 3.0 takes the same document, keys and all."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
from two_features import two_features

from explore3d.jobs.export.qif import QIF_NAMESPACE, qif_results
from mapping import Interval
from mapping.model import ObjectModel, Tolerance, judged

NAMES = {"q": QIF_NAMESPACE}


def document(model: ObjectModel) -> ET.Element:
    return ET.fromstring(qif_results(model))


def test_each_size_is_a_measured_value_in_millimetres_with_its_standard_uncertainty() -> None:
    root = document(two_features())
    measured = root.findall(".//q:HeightCharacteristicMeasurement", NAMES)
    assert len(measured) == 2 and len(root.findall(".//q:LengthCharacteristicMeasurement", NAMES)) == 2
    value = measured[0].find("q:Value", NAMES)
    assert value is not None and value.text is not None
    # 1 mm with a standard deviation of 10 um
    assert abs(float(value.text) - 1.0) < 1e-12 and abs(float(value.attrib["combinedUncertainty"]) - 0.01) < 1e-5
    low = measured[0].find("q:Attributes/q:AttributeStr[@name='low']", NAMES)
    assert low is not None and abs(float(low.attrib["value"]) - (1.0 - 1.645 * 0.01)) < 1e-5
    factor = root.find(".//q:LinearUnit/q:UnitConversion/q:Factor", NAMES)
    assert factor is not None and factor.text == "0.001"


def test_every_reference_leads_to_what_it_names_and_every_list_counts_its_members() -> None:
    root = document(two_features())
    named = {each.attrib["id"]: each for each in root.iter() if "id" in each.attrib}
    assert len(named) == sum("id" in each.attrib for each in root.iter())
    assert int(root.attrib["idMax"]) == max(map(int, named)) == len(named)
    ends = {"DefinitionId": "Definition", "NominalId": "Nominal", "ItemId": "Item", "Id": "Measurement"}
    references = 0
    for each in root.iter():
        name = each.tag.rpartition("}")[2]
        for end, kind in ends.items():
            if name == f"Characteristic{end}" or (name == end == "Id"):
                assert each.text is not None and named[each.text].tag.endswith(kind), name
                references += 1
        if "n" in each.attrib and name != "MeasurementResultsSet":
            assert int(each.attrib["n"]) == len(each), name
    assert references == 6 * 4


def test_a_curve_has_its_vertices_and_a_point_its_place() -> None:
    root = document(two_features())
    points = [each.text for each in root.findall(".//q:DefiningPoint/q:Point", NAMES)]
    assert [[float(part) for part in (text or "").split()] for text in points] == [[0, 0, 0], [10, 0, 0], [20, 10, 0]]
    place = root.find(".//q:PointFeatureMeasurement/q:Location", NAMES)
    assert place is not None and place.text == "0.0 20.0 0.0"
    assert [each.text for each in root.findall(".//q:FeatureName", NAMES)] == ["ridge-1", "bump-1"]


def test_what_is_only_bounded_has_no_value_and_a_depth_is_positive() -> None:
    model = two_features()
    ridge, bump = model.features
    sunk = replace(
        ridge, height=Interval(-1e-3, -1.1e-3, -0.9e-3), length=Interval(np.nan, 0.02, np.nan, censored=True)
    )
    unknown = replace(bump, width=Interval(np.nan, np.nan, np.nan))
    root = document(replace(model, features=(sunk, unknown)))
    depth = root.find(".//q:DepthCharacteristicMeasurement/q:Value", NAMES)
    assert depth is not None and depth.text == "1.0"
    first = root.findall(".//q:LengthCharacteristicMeasurement", NAMES)[0]
    assert first.find("q:Value", NAMES) is None
    assert [each.attrib["name"] for each in first.iter(f"{{{QIF_NAMESPACE}}}AttributeStr")] == ["low"]
    assert len(root.findall(".//q:WidthCharacteristicMeasurement", NAMES)) == 1


def test_limits_of_the_scene_stand_with_the_size_and_are_judged() -> None:
    model = two_features()
    asked = (
        Tolerance("ridge", "height", limit=0.9e-3),
        Tolerance("ridge", "width", limit=1.5e-3, least=0.5e-3),
        Tolerance("bump", "height", limit=1e-3),
    )
    found = [each.record() for each in judged(model.features, asked, 0.1e-3, 1.0)]
    root = document(replace(model, provenance={"tolerances": found}))
    status = {
        (root.findtext(f".//*[@id='{each.findtext('q:CharacteristicItemId', '', NAMES)}']/q:Name", "", NAMES)): (
            each.findtext("q:Status/q:CharacteristicStatusEnum", "", NAMES)
        )
        for each in root.iterfind(".//q:CharacteristicMeasurements/*", NAMES)
    }
    assert status == {
        "ridge-1 height": "FAIL",
        "ridge-1 width": "PASS",
        "ridge-1 length": "NOT_ANALYZED",
        "bump-1 height": "INDETERMINATE",
        "bump-1 width": "NOT_ANALYZED",
        "bump-1 length": "NOT_ANALYZED",
    }
    limits = root.find(".//q:WidthCharacteristicDefinition/q:Tolerance", NAMES)
    assert limits is not None and [(each.tag.rpartition("}")[2], each.text) for each in limits] == [
        ("MaxValue", "1.5"),
        ("MinValue", "0.5"),
        ("DefinedAsLimit", "true"),
    ]
    assert root.findtext(".//q:InspectionStatus/q:InspectionStatusEnum", "", NAMES) == "FAIL"


def test_a_size_that_a_feature_does_not_have_is_not_written() -> None:
    model, none = two_features(), Interval(0.0, 0.0, 0.0)
    root = document(replace(model, features=(replace(model.features[0], width=none),)))
    assert root.find(".//q:WidthCharacteristicMeasurement", NAMES) is None


def test_numbers_have_no_exponent_and_the_same_model_gives_the_same_bytes() -> None:
    model = two_features()
    small = replace(model, features=(replace(model.features[0], height=Interval.normal(2e-11, 1e-12)),))
    content = qif_results(small)
    assert content == qif_results(small)
    value = ET.fromstring(content).find(".//q:HeightCharacteristicMeasurement/q:Value", NAMES)
    assert value is not None and value.text is not None
    assert (
        abs(float(value.text) - 2e-8) < 1e-20
        and "e" not in value.text
        and "e" not in value.attrib["combinedUncertainty"]
    )


def test_a_model_without_features_is_a_document_without_characteristics() -> None:
    root = document(replace(two_features(), features=()))
    assert root.find("q:Characteristics", NAMES) is None and root.find(".//q:MeasuredFeatures", NAMES) is None
    assert root.find(".//q:InspectionStatus", NAMES) is not None
