"""The paper's figures: the files, and the numbers behind the curves."""

import numpy as np
import pytest

from explore3d.bench import figures

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("figures") / "new"
    return folder, figures.write_figures(folder)


def test_five_whole_pictures_are_written(written):
    folder, files = written
    assert [path.name[:7] for path in files] == ["figure1", "figure2", "figure2", "figure3", "figure5"]
    assert sorted(folder.iterdir()) == sorted(files)
    for path in files:
        content = path.read_bytes()
        assert content.startswith(PNG)
        assert b"IEND" in content[-12:]
        assert len(content) > 20_000


def test_the_same_figure_is_drawn_every_time(written):
    from explore3d.pictures.figure import png, styled

    with styled():
        assert png(figures.curvature_features()) == written[1][3].read_bytes()


def test_the_traced_section_follows_the_parallel_surface_outside_the_interference_points(written):
    trace = figures.section_trace()
    flank, plain = figures.PAPER_BUMP.interference(figures.FIGURE_TIP_RADIUS)
    u = np.r_[np.linspace(0, flank, 400), np.linspace(plain, 2.0, 400)]
    x, z = figures.PAPER_BUMP.parallel(u, figures.FIGURE_TIP_RADIUS)
    expected = np.interp(np.abs(trace.centers[:, 0]), x, z)
    assert np.abs(trace.centers[:, 2] - expected)[np.abs(trace.centers[:, 0]) < 1.9].max() < 1e-4


def test_the_mesh_folds_and_the_ball_leaps_where_the_closed_forms_say(written):
    folded, met = figures.mesh_fold()
    r = figures.FIGURE_TIP_RADIUS
    rings = figures.PAPER_BUMP.parallel(figures.PAPER_BUMP.caustics(r), r)[0]
    found = np.hypot(*folded.caustics[:, :2].T)
    assert np.abs(found[:, None] - rings).min(axis=1).max() < 0.02
    assert len(met) == 2 * figures.DIAMETERS
    assert np.abs(np.hypot(*met[:, :2].T) - figures._meeting()[0]).max() < 2e-3


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError):
        figures.write_figures(tmp_path / "file")
