"""emcee is imported without scipy.stats, and nothing of it is lost."""

import subprocess
import sys

import numpy as np

from mapping.inference.sampler.emcee_import import emcee


def test_importing_emcee_for_a_run_does_not_load_scipy_stats():
    program = (
        "import sys; from mapping.inference.sampler.emcee_import import emcee; "
        "emcee(); assert 'scipy.stats' not in sys.modules; import scipy.stats; scipy.stats.norm"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_the_move_by_kernel_densities_still_works_and_loads_it_itself():
    program = (
        "import sys, numpy as np; from mapping.inference.sampler.emcee_import import emcee; "
        "move = emcee().moves.KDEMove(); rng = np.random.RandomState(0); points = rng.randn(40, 2); "
        "new, factors = move.get_proposal(points[:20], [points[20:]], rng); "
        "assert new.shape == (20, 2) and np.isfinite(factors).all() and 'scipy.stats' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_it_is_the_same_package_as_anybody_elses():
    import emcee as package

    assert emcee() is package
    assert np.isfinite(package.autocorr.integrated_time(np.random.default_rng(0).normal(size=(200, 1)), tol=0))
