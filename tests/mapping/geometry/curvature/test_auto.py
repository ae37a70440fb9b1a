"""How the nearest points are bent, which tells whether a curvature is finer than the sampling."""

import numpy as np
import pytest

from mapping.geometry.curvature.auto import _bend_weights


@pytest.fixture
def normals() -> np.ndarray:
    """(200, 3) unit normals."""
    n = np.random.default_rng(1).normal(size=(200, 3))
    return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))


def _in_planes(normals: np.ndarray, places: np.ndarray) -> np.ndarray:
    return np.asarray(places - np.einsum("mkc,mc->mk", places, normals)[:, :, None] * normals[:, None])


def test_a_tilted_paraboloid_has_its_bend(normals: np.ndarray) -> None:
    flat = _in_planes(normals, np.random.default_rng(2).normal(size=(200, 10, 3)))
    heights = 0.3 + flat @ np.array([0.5, -0.2, 0.1]) + 0.7 * 0.5 * (flat**2).sum(axis=2)
    np.testing.assert_allclose((_bend_weights(flat, normals) * heights).sum(axis=1), 0.7, rtol=1e-9)


@pytest.mark.parametrize("share", [0.0, 1e-9, 1e-3])
def test_points_on_or_beside_one_line_have_the_weights_of_the_pseudoinverse(normals: np.ndarray, share: float) -> None:
    along = np.random.default_rng(3).normal(size=(200, 10, 1)) * np.array([1.0, 0.0, 0.0])
    flat = _in_planes(normals, along + share * np.random.default_rng(4).normal(size=(200, 10, 3)))
    columns = np.concatenate([np.ones((200, 10, 1)), flat, 0.5 * (flat**2).sum(axis=2)[:, :, None]], axis=2)
    expected = np.linalg.pinv(columns, rcond=1e-6)[:, -1]
    np.testing.assert_allclose(_bend_weights(flat, normals), expected, rtol=1e-6, atol=1e-6)


def test_points_in_one_place_have_no_bend(normals: np.ndarray) -> None:
    assert not _bend_weights(np.zeros((200, 10, 3)), normals).any()
