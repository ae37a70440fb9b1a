"""Two hundred inputs that no command can take: each names what it gets wrong and what the answer must hold."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ASSETS = Path(__file__).resolve().parents[2] / "assets"
WIRE = (ASSETS / "scenes" / "wire_on_plate.toml").read_text()
GRBL = (ASSETS / "scenes" / "grbl_peck.toml").read_text()
TRIANGLE = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
PROFILE = "x,z\n" + "".join(f"{0.01 * k:.2f},{0.001 * (k * 7 % 11):.3f}\n" for k in range(200))
MM, TIP = ("--units", "mm"), ("--tip-radius", "2 um")


@dataclass(frozen=True)
class Bad:
    """One call that must be refused.

    Args:
        words: of the command line; {} is a folder of the test's own.
        said: what the one line must hold, parts of it, beside the name of the program.
        files: {name: content} to be written into that folder beforehand.
        make: what writes others.
    """

    words: tuple[str, ...]
    said: tuple[str, ...]
    files: tuple[tuple[str, str | bytes], ...] = ()
    make: Callable[[Path], object] | None = None

    @property
    def name(self) -> str:
        return " ".join(self.words).replace("{}/", "")


BAD: list[Bad] = []


def bad(
    words: str | tuple[str, ...], *said: str, make: Callable[[Path], object] | None = None, **files: str | bytes
) -> None:
    """`__` in a file's name stands for a point."""
    split = tuple(words.split()) if isinstance(words, str) else words
    BAD.append(Bad(split, said, tuple((name.replace("__", "."), content) for name, content in files.items()), make))


def scene(
    old: str, new: str, *said: str, command: str = "run {}/s.toml --out {}/out", whole: str = WIRE, **files: str | bytes
) -> None:
    """A scene with one text replaced by another."""
    assert old in whole, old
    bad(command, *said, s__toml=whole.replace(old, new, 1), **files)


PLAN, CALIBRATE = "plan {}/s.toml", "calibrate {}/s.toml --radius 12mm --out {}/out/tip.toml"


def scenes() -> None:
    radius = 'radius = "10 mm"'
    for value, said in (
        ('"-1 mm"', "greater than 0"),
        ('"0 mm"', "greater than 0"),
        ('"10"', "unit missing"),
        ('"10 kHz"', "'kHz' is a unit of rate"),
        ('"ten mm"', "ten mm"),
        ("true", "tip.radius"),
        ("[1, 2]", "tip.radius"),
        ("inf", "tip.radius"),
        ("nan", "tip.radius"),
        ('"1e400 mm"', "tip.radius"),
        ('""', "tip.radius"),
        ('"1 km"', "3e-07 radii of the tip"),
        ('"1 nm"', "3e+05 radii of the tip"),
        ('"10 mm 5"', "tip.radius"),
        ("1e-400", "tip.radius"),
    ):
        scene(radius, f"radius = {value}", "s.toml: ", said)
        scene(radius, f"radius = {value}", "s.toml: ", said, command=PLAN)
    for old, new, *said in (
        ("schema =", "scheme =", "schema"),
        ("scene/1", "scene/9", "schema", "explore3d/scene/1"),
        ("scene/1", "log/1", "schema"),
        ("[tip]", "[tips]", "tips", "did you mean"),
        ("[tip]", "[[tip]]", "tip"),
        ("seed = 1", "seed = -1", "seed"),
        ("seed = 1", 'seed = "one"', "seed"),
        ("seed = 1", "seed = 1.5", "seed"),
        ("seed = 1", "seed = 1\nseed = 2", "s.toml"),
        ('kind = "simulated"', 'kind = "simulatd"', "finger.kind", "simulated"),
        ('kind = "simulated"', "kind = 3", "finger.kind"),
        ('units = "m"', 'units = "parsec"', "units", "mm"),
        ('units = "m"', 'units = "kHz"', "units"),
        ('rate = "5 kHz"', 'rate = "0 Hz"', "finger.rate"),
        ('rate = "5 kHz"', 'rate = "5 mm"', "finger.rate"),
        ('white = "0.2 mm"', 'white = "-0.2 mm"', "finger.noise.white"),
        ('white = "0.2 mm"', 'white = "0.2 V"', "finger.noise.white"),
        ('correlation_length = "1 mm"', 'correlation_length = "0 mm"', "correlation_length"),
        ('smallest_feature = "0.3 mm"', 'smallest_feature = "0 mm"', "survey.smallest_feature"),
        ('smallest_feature = "0.3 mm"', 'smallest_feature = "1 km"', "survey.smallest_feature"),
        ('smallest_feature = "0.3 mm"', 'smallest_feature = "0.3 m"', "300 mm high on a mesh of 200 mm"),
        (
            'smallest_feature = "0.3 mm"',
            'smallest_feature = "0.3 nm"',
            "survey.smallest_feature is 3e-10 m",
            "1e-07 to 10 m",
        ),
        ('time_budget = "10 min"', 'time_budget = "1 s"', "take about 4 min 13 s", "time budget is 1 s"),
        ('smallest_feature = "0.3 mm"', "", "survey.smallest_feature"),
        ('smallest_feature = "0.3 mm"', 'smalest_feature = "0.3 mm"', "did you mean"),
        ('speed = "30 mm/s"', 'speed = "0 mm/s"', "survey.speed"),
        ('speed = "30 mm/s"', 'speed = "quick"', "survey.speed"),
        ('force = "1 N"', 'force = "-1 N"', "survey.force"),
        ("algorithm = 3", "algorithm = 7", "detection.algorithm"),
        ("algorithm = 3", "algorithm = 1", "detection.algorithm"),
        ("false_alarms_per_metre = 0.01", "false_alarms_per_metre = 0", "false_alarms_per_metre"),
        ("false_alarms_per_metre = 0.01", "false_alarms_per_metre = -3", "false_alarms_per_metre"),
        ('precision = "0.1 mm"', 'precision = "0 mm"', "explore.precision"),
        ('time_budget = "10 min"', 'time_budget = "-1 s"', "explore.time_budget"),
        ('time_budget = "10 min"', 'time_budget = "10 mm"', "explore.time_budget"),
        ('kind = "ridge"', 'kind = "rigde"', "truth", "ridge"),
        ("axis = [[", "axis = [[[", "s.toml"),
        ("height = 0.00065", "height = nan", "truth"),
        ("[model]", "[model]\npose = 'maybe'", "model.pose", "given"),
        ("[model]", "[model]\nregion = {low = [0, 0, 0], high = [-1, 1, 1]}", "model.region"),
        ("[model]", "[model]\nregion = {low = [0, 0], high = [1, 1, 1]}", "model.region"),
        ("[finger.noise]", "[finger.machine]\nport = 'emulator'\n[finger.noise]", "finger.machine"),
        ("[finger.noise]", "[finger.dynamics]\nmass = -1\n[finger.noise]", "finger.dynamics.mass"),
        ("[finger.noise]", "[finger.dynamics]\ngain = 2\n[finger.noise]", "finger.dynamics.gain"),
        ("[survey]", "[survey", "s.toml"),
        ("title = ", "title == ", "s.toml"),
    ):
        scene(old, new, *said)
    for old, new, *said in (
        ("../meshes/plate.ply", "absent.ply", "model.mesh", "absent.ply"),
        ("../meshes/wire_on_plate.ply", "absent.ply", "finger.object", "absent.ply"),
        ("../meshes/plate.ply", "mesh.off", "model.mesh"),
        ("../meshes/plate.ply", ".", "model.mesh"),
        ("../meshes/plate.ply", "", "model.mesh"),
        ("../meshes/plate.ply", "s.toml", "model.mesh"),
    ):
        scene(old, new, *said, mesh__off="OFF\n0 0 0\n")
    for name, *said in (  # near it means: in or below its own folder or a folder beside that
        ("../../plate.ply", "model.mesh", "--files-from"),
        ("../plate.ply", "model.mesh", "--files-from"),
        ("meshes/../../../etc/passwd", "model.mesh", "--files-from"),
        (f"{ASSETS}/meshes/../meshes/plate.ply", "model.mesh", "own folder or a folder beside", "--files-from"),
        ("/dev/zero", "model.mesh", "--files-from /dev"),
        ("a\\u0000b.ply", "model.mesh", "no file's name"),
    ):
        scene("../meshes/plate.ply", name, *said)
        scene("../meshes/plate.ply", name, *said, command="plan {}/s.toml --out {}/out")
    scene("../meshes/wire_on_plate.ply", "/etc/passwd", "finger.object", "--files-from /etc")
    scene(
        'radius = "10 mm"', 'profile = "/etc/passwd"', "tip.profile", "--files-from /etc",
        command="calibrate {}/s.toml --radius 12mm --out {}/out/tip.toml",
    )  # fmt: skip
    scene(radius, radius, "--files-from", "no such", command="run {}/s.toml --out {}/out --files-from {}/absent")
    for content in (
        "",
        "OFF\n",
        "OFF\n3 1 0\n0 0 0\nnan 0 0\n0 1 0\n3 0 1 2\n",
        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n",
        "OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n",
        "OFF\n3 1 0\n0 0 0\n4e9 0 0\n0 4e9 0\n3 0 1 2\n",
        "OFF\n999999999 1 0\n0 0 0\n",
        b"\x00\xff" * 100,
        "OFF\n3 1 0\n0 0 0\n1e-12 0 0\n0 1e-12 0\n3 0 1 2\n",
    ):
        scene("../meshes/plate.ply", "mesh.off", "model.mesh", "mesh.off", mesh__off=content)
    for content in (b"", b"\xff\xfe\x00", b"\x00" * 50, b"[" * 2000, b"x,z\n1,2\n", b"\x89PNG\r\n"):
        bad("run {}/s.toml --out {}/out", "s.toml", s__toml=content)
    for old, new, *said in (
        ('port = "emulator"', 'port = "/dev/absent"', "/dev/absent"),
        ('port = "emulator"', "port = 5", "finger.machine.port"),
        ('kind = "grbl"', 'kind = "simulated"', "finger.machine"),
    ):
        scene(old, new, *said, whole=GRBL, command="run {}/s.toml --out {}/out --arm")
    for asked, *said in (
        ("0mm", "--radius", "greater than 0"),
        ("-3mm", "--radius", "greater than 0"),
        ("12", "--radius", "unit missing"),
        ("round", "--radius"),
        ("1km", "reference sphere", "2000 m"),
        ("12in2", "--radius", "'in2'"),
    ):
        scene(radius, radius, *said, command=f"calibrate {{}}/s.toml --radius {asked} --out {{}}/out/tip.toml")
        scene(radius, radius, *said, command=f"selftest {{}}/s.toml --radius {asked}")
    for asked in ("0mm,0mm", "a,b,c", "0mm,0mm,0kHz"):
        scene(radius, radius, "--center", command=f"selftest {{}}/s.toml --radius 12mm --center {asked}")


def tables() -> None:
    analyze = "analyze {}/scan.csv --out {}/out --units mm --tip-radius 2um"
    for content, *said in (
        ("", "is empty"),
        ("\n\n\n", "is empty"),
        ("x,z\n", "no line of two"),
        ("hello world\n" * 20, "no line of two"),
        ("x,z\n1,2\n3,oops\n" + PROFILE[4:], "line 3", "oops"),
        ("x,z\n1,2\n1,2,3\n" + PROFILE[4:], "line 3", "2 columns"),
        (b"\x00\x01\x02" * 500, "binary"),
        (b"\x89PNG\r\n\x1a\n" + bytes(50), "PNG"),
        (b"%PDF-1.4" + bytes(9), "PDF"),
        (b"\x1f\x8b\x08" + bytes(20), "gzip"),
        (b"PK\x03\x04" + bytes(40), "ZIP"),
        (b"PAR1" + bytes(40), "Parquet"),
        (b"\x89MCAP0\r\n" + bytes(40), "scan.csv"),
        (b"\x89HDF\r\n" + bytes(40), "HDF5"),
        (b"\x7fELF" + bytes(60), "program"),
        (b"\x80\x04\x95" + bytes(60), "pickle"),
        (b"SQLite format 3\x00" + bytes(90), "scan.csv"),
        (b"\x93NUMPY\x01\x00v\x00{", "scan.csv"),
        (b"ply\nformat ascii 1.0\n", "scan.csv"),
        (b"solid \n", "scan.csv"),
        ("x [kHz],z [mm]\n" + PROFILE[4:], "units", "kHz"),
        ("a,b\n" + PROFILE[4:], "--columns"),
        ("x,x\n" + PROFILE[4:], "columns"),
        ("x [um],z [um]\n" + PROFILE[4:], "units", "um"),
        ("x,depth\n" + PROFILE[4:], "depth"),
        ("x,z\n" + "nan,nan\n" * 30, "no line of two"),
        ("x,z\n1,2\n", "three samples"),
        ("x,z\n1,2\n1,2\n1,2\n", "scan.csv"),
        ('{"x": [1, 2], "z": [1, 2]}', "scan.csv"),
    ):
        bad(analyze, *said, scan__csv=content)
    good = {"scan__csv": PROFILE}
    for words, *said in (
        ("--tip-radius 2um", "units", "--units"),
        ("--units mm", "tip_radius", "--tip-radius"),
        ("--units mm --tip-radius 0mm", "tip_radius"),
        ("--units mm --tip-radius -2um", "tip_radius"),
        ("--units mm --tip-radius 2", "tip_radius"),
        ("--units mm --tip-radius 2kHz", "tip_radius"),
        ("--units parsec --tip-radius 2um", "units", "parsec"),
        ("--units kHz --tip-radius 2um", "units", "kHz"),
        ("--units mm --tip-radius 2um --columns x=9,z=1", "columns.x", "1 to 2"),
        ("--units mm --tip-radius 2um --columns x=X9,z=1", "columns.x", "X9"),
        ("--units mm --tip-radius 2um --columns x", "columns"),
        ("--units mm --tip-radius 2um --columns q=1", "columns"),
        ("--units mm --tip-radius 2um --columns x=1,z=1", "columns"),
        ("--units mm --tip-radius 2um --pixel 0um", "pixel"),
        ("--units mm --tip-radius 2um --pixel wide", "pixel"),
        ("--units mm --tip-radius 2um --tip-sd -1nm", "tip_sd"),
        ("--units mm --tip-radius 2um --tip-sd much", "tip_sd"),
        ("--units mm --tip-radius 2um --form cube", "form", "auto"),
        ("--units mm --tip-radius 2um --form poly:99", "form"),
        ("--units mm --tip-radius 2um --form poly:x", "form"),
        ("--units mm --tip-radius 2um --form gaussian:0mm", "form"),
        ("--units mm --tip-radius 2um --mask 1mm", "mask"),
        ("--units mm --tip-radius 2um --mask 2mm..1mm", "mask"),
        ("--units mm --tip-radius 2um --frame 0mm,0mm", "frame"),
        ("--units mm --tip-radius 2um --frame a,b,c", "frame"),
        ("--units mm --tip-radius 2um --model {}/absent.ply", "absent.ply"),
        ("--units mm --tip-radius 2um --model {}/scan.csv", "scan.csv"),
        ("--units mm --tip-radius 2um --model {}/m.off --model-units parsec", "parsec"),
        ("--units mm --tip-radius 2um --force nonsense", "nonsense"),
        ("--units mm --tip-radius 2um --nonsense", "nonsense"),
    ):
        bad(f"analyze {{}}/scan.csv --out {{}}/out {words}", *said, m__off=TRIANGLE, **good)
    for sidecar in ("units = 'parsec'", "tip_radius = '-1 mm'", "nonsense = 1", "units = ", "columns = 3", "\x00"):
        bad(
            "analyze {}/scan.csv --out {}/out --units mm --tip-radius 2um",
            "scan.csv.toml",
            scan__csv__toml=sidecar,
            **good,
        )
    bad("analyze {}/absent.csv --out {}/out", "absent.csv")
    bad("analyze {} --out {}/out", "{}")
    bad("analyze --out {}/out", "LOG")
    bad("analyze {}/scan.csv", "--out", **good)
    for content in ("", "hello\n" * 9, b"\x00\x01" * 90, b"\x1f\x8b\x08" + bytes(20)):
        bad("inspect {}/scan.csv", "scan.csv", scan__csv=content)
    for words in ("--units parsec", "--tip-radius many", "--pixel 0mm", "--columns q"):
        bad(f"inspect {{}}/scan.csv {words}", words.split()[1].split("=")[0], **good)
    bad("inspect {}/absent.csv", "absent.csv")
    bad("inspect {}", "{}")
    bad("inspect", "FILE")


def bomb(folder: Path) -> None:
    with zipfile.ZipFile(folder / "scan.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scan.csv", bytes(100_000_000))


def executing(folder: Path) -> None:
    np.save(folder / "scan.npy", np.array([{"x": 1}], dtype=object), allow_pickle=True)


def known(folder: Path) -> None:
    (folder / "model").mkdir()
    (folder / "model" / "model.json").write_text(json.dumps({"schema": "explore3d/model/9"}))


def others() -> None:
    bad("analyze {}/scan.zip --out {}/out --units mm --tip-radius 2um", "scan.zip", "100,000,000", make=bomb)
    bad("analyze {}/scan.npy --out {}/out --units mm --tip-radius 2um", "scan.npy", make=executing)
    bad("merge {}/absent {}/scan.csv --out {}/out", "absent", scan__csv=PROFILE)
    bad("merge {}/model.json {}/scan.csv --out {}/out", "model.json", model__json="{", scan__csv=PROFILE)
    bad("merge {}/model.json {}/scan.csv --out {}/out", "model.json", model__json="[]", scan__csv=PROFILE)
    bad("merge {}/model {}/scan.csv --out {}/out", "model", make=known, scan__csv=PROFILE)
    bad("merge {}/scan.csv {}/scan.csv --out {}/out", "scan.csv", scan__csv=PROFILE)
    bad("merge {} --out {}/out", "LOG")
    for at in ("1mm,2mm", "here", "1mm,2mm,3kHz"):
        bad(f"reprobe {{}} --at {at}", "--at")
    bad("reprobe {}/absent --at 0mm,0mm,0mm", "absent")
    bad("reprobe {} --at 0mm,0mm,0mm --touches 0", "--touches")
    bad("run {}/absent.toml --out {}/out", "absent.toml")
    bad("run {} --out {}/out", "{}")
    bad("run {}/s.toml", "--out", s__toml=WIRE)
    for command in ("run {}/s.toml", "plan {}/s.toml", "analyze {}/scan.csv --units mm --tip-radius 2um"):
        files = {"s__toml": WIRE, "scan__csv": PROFILE}
        bad(f"{command} --out {{}}/file", "file", file="", **files)
        bad(f"{command} --out {{}}/file/below", "file", file="", **files)
        bad(f"{command} --out /proc/none/out", "/proc/none", **files)
        bad(f"{command} --out {{}}/others", "others", make=lambda folder: _foreign(folder / "others"), **files)
    bad("run {}/s.toml --out {}/out --resume", "resume", s__toml=WIRE)
    bad("run {}/s.toml --out {}/out --force nonsense", "nonsense", s__toml=WIRE)
    bad("examples nonsense --out {}/out", "nonsense", "wire_on_plate")
    bad("init {}/mine --example nonsense", "nonsense", "wire_on_plate")
    bad("init {}/mine --mesh {}/absent.ply --units mm --tip-radius 5mm", "absent.ply")
    bad("init {}/mine --mesh {}/m.off --units parsec --tip-radius 5mm", "parsec", m__off=TRIANGLE)
    bad("init {}/mine --mesh {}/m.off --units mm --tip-radius 0mm", "tip", m__off=TRIANGLE)
    bad("init {}/mine --mesh {}/m.off --units mm --tip-radius 5mm --finger robot", "robot", m__off=TRIANGLE)
    bad("figures --out {}/file", "file", file="")
    bad("figures --out {}/out --seeds 0", "--seeds")
    bad("stability --only nonsense", "nonsense")
    bad("emulate grbl --mesh {}/absent.ply", "absent.ply")
    bad("emulate nonsense --mesh {}/m.off", "nonsense", m__off=TRIANGLE)
    bad("emulate grbl --mesh {}/m.off --units parsec", "parsec", m__off=TRIANGLE)
    bad("emulate grbl --mesh {}/m.off --tip-radius 0mm", "tip", m__off=TRIANGLE)
    bad("emulate grbl --mesh {}/m.off --sensor nose", "nose", m__off=TRIANGLE)
    bad("emulate grbl --mesh {}/m.off --stiffness=-1", "stiffness", m__off=TRIANGLE)
    bad("emulate grbl --mesh {}/m.off --pace 0", "pace", m__off=TRIANGLE)
    bad("emulate grbl --mesh {}/m.off --origin 1mm", "origin", m__off=TRIANGLE)
    bad("doctor --port /dev/absent --baudrate 0", "--baudrate")
    bad("bench detect --out {}/file --store {}/file/below", "file", file="")
    bad("bench nonsense", "nonsense")
    bad("nonsense", "nonsense")


def _foreign(folder: Path) -> None:
    folder.mkdir()
    (folder / "thesis.tex").write_text("years of work")


scenes()
tables()
others()
