"""Which logs a batch is of: patterns, folders, manifests; and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from explore3d import UserError
from explore3d.jobs import Told
from explore3d.jobs.batch.tasks import Task, tasks_of


@pytest.fixture
def scans(tmp_path: Path) -> Path:
    for name in ("a.csv", "b.csv", "b.csv.toml", ".hidden", "deep/c.csv", "session/log.mcap", "session/report.html"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("x")
    return tmp_path


def names(tasks: list[Task], folder: Path) -> list[str]:
    return [str(Path(task.log).relative_to(folder)) for task in tasks]


def test_files_folders_and_patterns_name_logs_and_none_twice(scans: Path) -> None:
    assert names(tasks_of([str(scans / "*.csv"), str(scans / "a.csv")], Told()), scans) == ["a.csv", "b.csv"]
    assert names(tasks_of([str(scans / "**" / "*.csv")], Told()), scans) == ["a.csv", "b.csv", "deep/c.csv"]
    assert names(tasks_of([str(scans)], Told()), scans) == ["a.csv", "b.csv"]
    assert names(tasks_of([str(scans / "session")], Told()), scans) == ["session/log.mcap"]


def test_a_manifest_tells_each_file_its_own(scans: Path) -> None:
    path = scans / "list.csv"
    path.write_text("file,object,tip_radius,units,mask\na.csv,ring,5 um,mm,1mm..2mm; 3mm..4mm\nabsent.csv,,,,\n")
    first, second = tasks_of([], Told("2 um", quick=True), path)
    assert (first.object, first.told.tip_radius, first.told.quick) == ("ring", "5 um", True)
    assert first.told.table == {"units": "mm", "mask": ["1mm..2mm", "3mm..4mm"]}
    assert second.told == Told("2 um", quick=True) and second.log == str(scans / "absent.csv")
    assert Task.read(first.record()).told == first.told


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            "file,radius\na.csv,1\n",
            "unknown column 'radius'; a manifest is CSV with the columns file, object, tip_radius",
        ),
        ("name\na.csv\n", "unknown column 'name'"),
        ("object\na\n", "no column 'file'"),
        ("file,object\na.csv,b,c\n", "line 2: too many values"),
        ("file,object\n,b\n", "line 2: no file is named"),
    ],
)
def test_a_manifest_that_cannot_be_understood_is_refused(scans: Path, text: str, complaint: str) -> None:
    path = scans / "list.csv"
    path.write_text(text)
    with pytest.raises(UserError, match=complaint):
        tasks_of([], Told(), path)


def test_what_names_nothing_is_refused(scans: Path) -> None:
    for pattern in ("*.nothing", "absent.csv"):
        with pytest.raises(UserError, match="names no file"):
            tasks_of([str(scans / pattern)], Told())
    with pytest.raises(UserError, match="no log was named"):
        tasks_of([], Told())
    with pytest.raises(UserError, match="cannot be read as a manifest"):
        tasks_of([], Told(), scans / "absent-list.csv")
