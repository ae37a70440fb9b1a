"""Rendered pictures: their pixels are means of what was sampled."""

from __future__ import annotations

import numpy as np

from explore3d.pictures.camera import Camera
from explore3d.pictures.render import Picture


def test_a_picture_is_reduced_to_the_means_of_its_blocks_and_what_fills_none_is_left_out() -> None:
    camera = Camera.facing(np.eye(3), np.array([0.0, 0.3, 1.0]), 31, 23)
    pixels = np.random.default_rng(2).random((camera.height, camera.width, 3), dtype=np.float32)
    none = np.zeros(pixels.shape[:2])
    picture = Picture(camera, pixels, none.astype(np.float32), none.astype(np.int32), np.zeros((0, 3)))
    height, width = camera.height // 2, camera.width // 2
    blocks = pixels[: 2 * height, : 2 * width].reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
    assert np.abs(picture.reduced(2) - 255.0 * blocks).max() <= 0.5 + 1e-4
