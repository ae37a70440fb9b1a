"""The paper's experiment simulated: what each algorithm finds of a wire, and what it cannot."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.bench import apparatus


def test_without_errors_the_centre_runs_as_the_closed_form_says():
    trace = apparatus.crossing("sliding", apparatus.WIRE, None)
    x, z = (trace.centers @ apparatus._tilt())[:, [0, 2]].T
    arm = apparatus.TIP_RADIUS + apparatus.WIRE / 2
    over = np.maximum(apparatus.WIRE - x**2 / (arm + np.sqrt(arm**2 - np.minimum(np.abs(x), arm) ** 2)), 0.0)
    np.testing.assert_allclose(z, apparatus.TIP_RADIUS + over, atol=1e-8)


def test_the_paper_s_findings_come_out_for_a_finger_without_errors():
    found = {f.algorithm: f for f in apparatus.findings([apparatus.WIRE], seeds=1) if not f.noise}
    assert all(found[n].convex == 1.0 for n in (1, 2, 3, 4))
    assert found[1].concave == found[4].concave == 0.0
    assert found[2].concave == found[3].concave == 1.0
    # with the paper's own threshold the derivative of the normal shows no convex feature: k_t < 1/r
    assert (found[apparatus.PAPERS].convex, found[apparatus.PAPERS].concave) == (0.0, 1.0)
    assert all(f.false == 0.0 for f in found.values())


def test_the_table_has_one_line_for_each_case():
    found = [
        apparatus.Finding(motion, wire, n, noise, 1.0, 0.5, 0.0)
        for motion in apparatus.MOTION_LENGTHS
        for wire in (1e-3, 2e-3)
        for noise in (False, True)
        for n in apparatus.ALGORITHM_COLUMNS
    ]
    lines = apparatus.findings_table(found).splitlines()
    assert len(lines) == 2 + 8
    assert all(line.count("|") == 9 for line in lines)


@pytest.mark.slow
def test_figures_and_table_are_written_whole(tmp_path):
    files, found = apparatus.write_apparatus(tmp_path / "new", seeds=1)
    assert [path.name[:7] for path in files] == ["figure7", "figure8", "section"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in files[:2])
    assert apparatus.findings_table(found) in files[2].read_text()
