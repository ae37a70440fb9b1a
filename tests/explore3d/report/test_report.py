"""The report is one page that fetches nothing, says what was found, and keeps markup out of its texts."""

import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reported_wire import AXIS, BASE, HEIGHT, TIP, UP, crossing, ridge, sweeps

from explore3d.analysis.result import Analysis, TipCount
from explore3d.analysis.truth import TrueFeature, compare
from explore3d.pictures import curvature_picture, extent_picture
from explore3d.pictures.chart import FONT_SIZE
from explore3d.report.pictures import Pictures
from explore3d.report.report import report_page, write_report
from mapping.base.base import Base
from mapping.detection.detect import Detections
from mapping.detection.path import Lifted, PathLedger
from mapping.estimate.deviation import Yielding
from mapping.estimate.envelope import estimate_surface
from mapping.feature import Feature, Interval, LeftOut, Support
from mapping.geometry.curvature import principal_curvatures
from mapping.geometry.templates.shapes import chain_height
from mapping.instrument.noise import Noise
from mapping.model.conformity import Tolerance, judged
from mapping.model.object_model import ObjectModel
from mapping.surface import Surface
from mapping.trace import Trace

PAGE_WIDTH = 1155.0  # px, of a picture on a screen of 1200


def analysis(features: tuple[Feature, ...] = (ridge(),), title: str = "A wire") -> Analysis:
    trace = sweeps()
    model = ObjectModel.attach(BASE, features, provenance={"tip_radius": TIP})
    crossings = tuple(crossing(i, x) for i, x in enumerate(np.linspace(-0.03, 0.03, 11)) if abs(x) < 0.02)
    truth = (TrueFeature("ridge", AXIS, HEIGHT),) if features else ()
    return Analysis(
        title,
        trace,
        BASE,
        Detections(crossings if features else (), Noise(1e-5), 3, 4e-5, 0.95, 5.0, 0.55),
        model,
        truth=truth,
        errors=compare(model, truth, TIP),
        timings={"detection": 1.5, "posterior": 3.0},
        left_out=(LeftOut("base fit", "the global model was given"),),
        time_curve=((10.0, 1e-3), (20.0, 2e-4)),
        tip_counts=(TipCount(TIP, 1, 0), TipCount(2 * TIP, 0, 1)),
    )


def words(page: str) -> str:
    """The page's text without scripts, styles and tags."""
    bare = re.sub(r"<(script|style)[^>]*>.*?</\1>", " ", page, flags=re.S)
    return " ".join(re.sub(r"<[^>]+>", " ", bare).split())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("report")
    write_report(analysis(), place)
    return place


def test_the_page_loads_nothing_from_elsewhere(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    assert not re.search(r"<(script|link|img|iframe)[^>]+(src|href)=\"(?!data:)", page)
    assert "default-src 'none'" in page


def test_the_page_says_what_was_found_and_what_was_left_out(folder: Path) -> None:
    text = words((folder / "report.html").read_text())
    for sentence in (
        "1 ridge was found.",
        "0.650 mm (0.634 to 0.666) high",
        "1 detail stands out of the noise: finer than the tip",
        "1 of 1 features found, 0 missed, 0 invented",
        "the global model was given",
        "A sharp crest 40 µm high or higher is seen with 95 % probability",
        "4.5 s",
    ):
        assert sentence in text, sentence


def test_every_section_is_in_the_contents_and_every_link_leads_somewhere(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    ids, links = set(re.findall(r' id="([^"]+)"', page)), re.findall(r'href="#([^"]+)"', page)
    assert set(links) <= ids
    listed = re.findall(r'href="#([^"]+)"', page[page.index("<nav") : page.index("</nav>")])
    assert listed == re.findall(r'<section id="([^"]+)"', page)


def test_a_table_is_reached_by_keyboard_and_has_no_empty_header(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    assert page.count('class="table"') == page.count('class="table" role="group" tabindex="0"') > 2
    assert "<th></th>" not in page and not re.search(r'<th class="number"></th>', page)


def test_tolerances_and_who_stand_on_the_page_as_text() -> None:
    made = analysis()
    judgements = judged(made.model.features, [Tolerance("ridge", "height", 5e-4)], 4e-5, 1.0)
    about = {"about": {"operator": "<b>Ann</b>"}, "recorded": "2026-11-23T08:30:12+00:00"}
    model = replace(made.model, provenance=made.model.provenance | about)
    page = report_page(replace(made, model=model, judgements=judgements), Pictures({}), ())
    text = words(page)
    assert "fail height of every ridge: at most 0.5 mm ridge-1 conforms with probability below 0.001" in text
    assert "Haptic exploration · 2026-11-23 08:30 UTC · by &lt;b&gt;Ann&lt;/b&gt;" in text


def test_every_figure_lies_beside_the_page_as_an_svg_with_its_words(folder: Path) -> None:
    said = {
        "object": {"ridge-1  0.650 mm"},
        "sections": {"ridge-1, sweep 5", "across the feature (mm)", "trace of the feature found", "true height"},
        "sizes": {"Height", "Length", "found minus true (µm)"},
        "time": {"time of the finger (s)", "error of the axis (mm)"},
    }
    assert {each.stem for each in (folder / "pictures").iterdir()} == set(said)
    for name, words_of_it in said.items():
        drawing = ElementTree.parse(folder / "pictures" / f"{name}.svg").getroot()
        texts = {each.text for each in drawing.iter("{http://www.w3.org/2000/svg}text")}
        assert words_of_it <= texts, (name, texts)


def test_the_page_is_small_and_holds_every_figure(folder: Path) -> None:
    page = (folder / "report.html").read_text()
    assert len(page.encode()) < 500_000
    for name in ("Picture of the object", "Profiles across the features", "Errors of the sizes found"):
        assert f'aria-label="{name}"' in page


def test_the_same_analysis_gives_the_same_pictures(folder: Path, tmp_path: Path) -> None:
    write_report(analysis(), tmp_path)
    for each in (folder / "pictures").iterdir():
        assert (tmp_path / "pictures" / each.name).read_bytes() == each.read_bytes(), each.name


def test_an_empty_result_says_what_would_have_been_seen() -> None:
    text = words(report_page(analysis(()), Pictures({}), []))
    assert "Nothing was found that the base does not explain." in text
    assert "A sharp crest 40 µm high or higher is seen with 95 % probability" in text


def test_what_was_changed_of_the_trace_stands_on_the_page() -> None:
    lifted = Lifted(np.ones(3, dtype=bool), 12, 0.5, 0.02, TIP)
    yielding = Yielding(1e-5, 1e-6, 5.0, 1.0, 20.0)
    text = words(report_page(replace(analysis(), lifted=lifted, yielding=yielding), Pictures({}), []))
    assert "The finger was lifted 12 times, up to 20 mm off the base: 500 mm of path" in text
    assert f"By the recorded forces {yielding.sentence()}." in text


def test_texts_from_outside_cannot_become_markup() -> None:
    hostile = "<script>alert(1)</script>"
    noted = replace(ridge(), notes=(hostile,))
    page = report_page(analysis((noted,), title=hostile), Pictures({}), [])
    assert hostile not in page and "&lt;script&gt;alert(1)" in page


def test_names_of_files_and_columns_cannot_become_markup() -> None:
    hostile = "<img src=x onerror=alert(1)>.csv"
    whole = analysis((ridge(),))
    said = whole.model.provenance | {"read_as": [f"x = '{hostile}' mm"], "sources": [hostile], hostile: hostile}
    page = report_page(replace(whole, model=replace(whole.model, provenance=said)), Pictures({}), [])
    assert "<img src=x" not in page and "&lt;img src=x onerror=alert(1)&gt;.csv" in page


def test_a_profile_is_drawn_as_a_profile(tmp_path: Path) -> None:
    x = np.arange(0.0, 1e-3, 5e-7)
    bump = Feature(
        "bump",
        np.array([[5e-4, 0.0, 0.0]]),
        UP[None],
        Interval.normal(1e-6, 1e-8),
        Interval.normal(4e-6, 1e-7),
        Interval(0, 0, 0),
        Support(50.0, 1, (3,)),
        False,
        1e-8,
    )
    strip = Base(
        Surface([[0, -1e-4, 0], [1e-3, -1e-4, 0], [1e-3, 1e-4, 0], [0, 1e-4, 0]], [[0, 1, 2], [0, 2, 3]]), "profile"
    )
    feet = np.column_stack([x, 0 * x, 0 * x])
    radius = 2.5e-6
    z = 2e-6 + chain_height(feet, np.tile(UP, (len(x), 1)), bump.axis + (1e-6 - radius) * UP, radius, 2e-6)
    whole = replace(
        analysis(),
        trace=Trace.from_profile(x, z, 2e-6),
        base=strip,
        model=ObjectModel.attach(strip, (bump,)),
        truth=(),
        errors=(),
        time_curve=(),
    )
    text = words(write_report(whole, tmp_path).read_text())
    assert {each.stem for each in (tmp_path / "pictures").iterdir()} == {"profile", "sections"}
    assert "1 bump was found. It is 1.000 µm" in text and "Against the truth" not in text


def test_the_picture_of_extents_says_the_length_that_the_table_says() -> None:
    cut = replace(ridge(), length=Interval(0.04, 0.0393, 0.041, censored=True))
    cut = replace(cut, details=replace(cut.details, axis_sd=np.full(len(cut.axis), 1e-5)))
    picture = extent_picture([cut], [None])
    assert picture is not None and "at least 39.3 mm long" in picture.decode()


def test_the_path_inspected_is_one_number_on_the_page() -> None:
    known = replace(analysis(), path=PathLedger(recorded=0.6, inspected=0.5))
    page = words(report_page(known, Pictures({}), ()))
    assert "500 mm of path inspected" in page and "500 mm of 600 mm of path recorded" in page
    assert "550 mm" not in page  # what the detection takes for it, which counts a sweep's ends otherwise


def test_letters_of_the_map_of_curvature_are_as_large_on_the_page_as_those_of_other_pictures() -> None:
    estimate = estimate_surface(sweeps(), base=BASE)
    assert estimate.surface is not None
    curvature = principal_curvatures(estimate.surface)
    drawing = ElementTree.fromstring(curvature_picture(estimate, curvature, TIP, BASE.surface, [ridge()]))
    shown = PAGE_WIDTH / float(drawing.get("viewBox", "").split()[2])
    titles = [each for each in drawing.iter("{http://www.w3.org/2000/svg}text") if "Principal" in (each.text or "")]
    assert len(titles) == 2
    assert all(float(each.get("font-size", "nan")) * shown > 0.9 * FONT_SIZE for each in titles)
