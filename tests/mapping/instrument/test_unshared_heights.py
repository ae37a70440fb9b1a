"""What neighbouring sweeps share is no noise; what each of them has alone is."""

import numpy as np
import pytest

from mapping.instrument import Row, unshared

STEP, SD = 0.05e-3, 3e-6
PLACES = np.arange(0.0, 12e-3, STEP)


def rows_over(surface, rng, count=25, apart=1e-3, noise=None):
    """Rows side by side over a surface (x, y) -> z, with noise of their own."""
    rows = []
    for k in range(count):
        own = SD * rng.standard_normal(len(PLACES)) if noise is None else noise(rng)
        places = np.column_stack([PLACES, np.full(len(PLACES), k * apart), np.zeros(len(PLACES))])
        order = slice(None, None, -1 if k % 2 else 1)
        rows.append(Row(places[order], (surface(PLACES, k * apart) + own)[order], STEP, 1.0))
    return rows


def crest(x, y):
    """A crest as wide as most of the rows, a little aslant."""
    return np.maximum(0.3e-3 - (x - 6e-3 - 0.1 * y) ** 2 / 20e-3, 0.0)


def wandering(rng, length=1e-3, sd=SD):
    """Ornstein-Uhlenbeck noise."""
    keep = np.exp(-STEP / length)
    kicks = np.sqrt(1.0 - keep**2) * rng.standard_normal(len(PLACES))
    kicks[0] /= np.sqrt(1.0 - keep**2)
    out = np.zeros(len(PLACES))
    for i, kick in enumerate(kicks):
        out[i] = keep * out[i - 1] + kick
    return sd * out


@pytest.mark.parametrize("noise", [None, wandering])
def test_of_rows_that_lie_mostly_on_one_crest_only_the_noise_is_left(noise):
    rest = unshared(rows_over(crest, np.random.default_rng(1), noise=noise))
    assert rest is not None
    spread = np.std(np.concatenate(rest[1:-1]))
    assert spread == pytest.approx(SD, rel=0.15)


@pytest.mark.parametrize("length", [0.3e-3, 1e-3, 10e-3])
def test_noise_of_each_row_is_not_shared(length):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        rows = rows_over(lambda x, y: 0.0 * x, rng, noise=lambda rng: wandering(rng, length))
        assert unshared(rows) is None


def test_rows_that_stand_off_each_other_as_a_whole_share_nothing():
    rng = np.random.default_rng(2)
    rows = rows_over(lambda x, y: 10 * SD * rng.standard_normal() + 0.0 * x, rng)
    assert unshared(rows) is None


def test_a_rough_surface_that_close_rows_share_is_no_detail():
    rng = np.random.default_rng(3)
    x = np.arange(0.0, 12e-3, STEP)
    smooth = np.convolve(rng.standard_normal(len(x)), np.exp(-0.5 * (np.arange(-20, 21) / 2.0) ** 2), mode="same")
    rows = rows_over(lambda at, y: np.interp(at, x, 20 * SD * smooth), rng)
    assert unshared(rows) is None


def test_few_rows_and_rows_in_one_place_tell_nothing():
    rng = np.random.default_rng(4)
    assert unshared(rows_over(crest, rng, count=4)) is None
    assert unshared(rows_over(crest, rng, apart=0.0)) is None


@pytest.mark.filterwarnings("error")
def test_rows_without_noise_and_rows_in_a_line_are_asked_without_a_word() -> None:
    x = np.arange(0.0, 12e-3, 0.05e-3)

    def rows(aside: float, height: np.ndarray) -> list[Row]:
        return [Row(np.column_stack([x + k * aside, 0 * x + 5e-4 * k, 0 * x]), height, 0.05e-3, 1.0) for k in range(8)]

    exact = unshared(rows(0.0, np.maximum(0.0, 4e-3 - np.abs(x - 6e-3))))
    assert exact is not None and np.abs(np.concatenate(exact)).max() < 1e-12
    assert unshared(rows(0.0, 0 * x)) is None
    # none lies beside another
    assert unshared(rows(15e-3, 1e-6 * np.sin(1e4 * x))) is None
