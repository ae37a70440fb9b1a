"""Maps in colours: what is unsure is pale, without a jump."""

from __future__ import annotations

import numpy as np

from explore3d.pictures.maps import coloured, faded


def test_a_sure_value_has_its_colour_and_an_unsure_one_none() -> None:
    shares = np.array([0.5, -0.5, 0.5, 0.5, 3.0, 0.0])
    sd = np.array([1e-6, 1e-6, np.nan, 1e6, 1e-6, 0.0])
    np.testing.assert_allclose(faded(shares, sd), [0.5, -0.5, 0.5, 0.0, 1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(faded(np.array([1.0]), np.array([1.0])), 0.6827, atol=1e-4)  # of a normal, within one sd


def test_no_level_of_certainty_makes_a_jump() -> None:
    sd = np.geomspace(0.01, 100.0, 2001)
    drawn = faded(np.full(2001, 0.8), sd)
    assert np.abs(np.diff(coloured(0.5 + 0.5 * drawn), axis=0)).max() < 0.01
    assert (np.diff(drawn) <= 0.0).all() and drawn[0] > 0.79 and drawn[-1] < 0.01


def test_what_is_twice_as_sure_is_never_paler() -> None:
    shares = np.linspace(-1.5, 1.5, 301)
    for sd in (0.03, 0.3, 3.0):
        assert (np.abs(faded(shares, np.full(301, sd))) >= np.abs(faded(shares, np.full(301, 2.0 * sd)))).all()
        assert (np.diff(faded(shares, np.full(301, sd))) >= 0.0).all()  # order stays order
