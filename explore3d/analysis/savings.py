"""What leaving a stage out saved: measured where it can be, else estimated from what the others cost, and said so.

The ratios were measured at 3e6 samples of the paper's apparatus over four wires (`explore3d bench scaling`): what a
stage costs in units of that run's detection, which every analysis has done by itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from explore3d import seconds_text
from explore3d.scene import SimulatedFingerTable
from hw.simulated import Dynamics
from mapping import LeftOut
from mapping.geometry.templates import kink_angle

if TYPE_CHECKING:
    from explore3d.analysis.stages import Stages
    from explore3d.scene import Scene

# Cost of a stage over that of detection
STAGE_COST_RATIOS = {
    "base fit": 0.3,
    "algorithms 1 and 2": 0.6,
    "grammar": 0.4,
    "estimated surface": 2.1,
    "smoothing": 0.8,
    "curvature": 0.4,
}
# A chain until it converges costs so many times the fast path (`explore3d bench`, posterior)
CHAIN = 4.0


def with_savings(left_out: Sequence[LeftOut], timings: Mapping[str, float]) -> tuple[LeftOut, ...]:
    """The same stages, each with an estimate of the seconds that it would have taken where there is one."""
    return tuple(each if each.saved else replace(each, saved=_estimate(each.stage, timings)) for each in left_out)


def _estimate(stage: str, timings: Mapping[str, float]) -> str:
    if stage == "long chain":
        return _about(CHAIN * timings.get("posterior", 0.0), "4 times the fast path")
    if stage in STAGE_COST_RATIOS and "detection" in timings:
        return _about(
            STAGE_COST_RATIOS[stage] * timings["detection"], f"{STAGE_COST_RATIOS[stage]:g} times the detection"
        )
    return ""


def _about(seconds: float, why: str) -> str:
    return f"about {seconds_text(seconds)} (estimated: {why})" if seconds > 0 else ""


def without_needless_dynamics(scene: Scene, stages: Stages) -> Scene:
    """The scene without the finger's dynamics where the rigid trace says as much: lambda > 10 v tan(phi) / sigma.

    The kink phi is that of the tallest true feature; a scene that names none keeps its dynamics.
    """
    finger, tallest = scene.finger, max((abs(true.height) for true in scene.truth), default=0.0)
    if not isinstance(finger, SimulatedFingerTable) or finger.dynamics is None:
        stages.needed("dynamics", "the contact is rigid: the scene gives no stiffness", possible=False)
        return scene

    noise = finger.noise
    sigma, kink = math.hypot(noise.white, noise.correlated), float(kink_angle(tallest, tallest / 2, scene.tip.radius))
    stiff = tallest > 0 and not Dynamics(**finger.dynamics.model_dump()).needed(scene.sweep_speed, kink, sigma)
    why_not = "the tip follows the rigid trace within the noise: lambda > 10 v tan(phi) / sigma" if stiff else ""
    if stages.needed("dynamics", why_not):
        return scene
    return scene.with_finger(finger.model_copy(update={"dynamics": None}))
