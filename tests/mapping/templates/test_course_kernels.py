"""Places about a line's course: node by node, and all nodes at once."""

import numpy as np
from numba import njit

from mapping.geometry.templates.course_kernels import about_course, lay_about_course


@njit
def _one_by_one(s, lateral, basis, course, found):
    for i in range(found.shape[1]):
        found[0, i], found[1, i], found[2, i] = about_course(s, lateral, basis, course, i, 0)


def test_all_nodes_at_once_lie_where_each_does_to_the_last_bit():
    rng = np.random.default_rng(1)
    s, lateral = rng.uniform(0.0, 0.1, 100), rng.normal(0.0, 0.01, 100)
    basis = rng.normal(0.0, 1.0, (2, 3, 100))
    for course in (np.zeros(3), np.array([2e-3, -1e-3, 5e-4])):
        single, together = np.empty((3, 100)), np.empty((3, 100))
        _one_by_one(s[:, None], lateral[:, None], basis[..., None], course, single)
        lay_about_course(s, lateral, basis, course, *together)
        assert np.array_equal(single, together)
