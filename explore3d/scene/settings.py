"""Settings: what a scene asks of the analysis of its recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from mapping.instrument import Noise, StatedNoise

if TYPE_CHECKING:
    from explore3d.scene.scene import Scene


@dataclass(frozen=True)
class AnalysisSettings:
    """What a recording is asked for.

    Args:
        algorithm: number in figure 4 of the paper that decides.
        false_alarms_per_metre: expected number of invented crossings per metre of path.
        seed: of the posterior's chains.
        tip_sd: standard deviation of the tip's radius, m.
        noise: of the centres, as the scene states it; None: not stated.
        begin: of the centres, as whoever felt them measured it on the way; None: nobody did.
    """

    algorithm: int = 3
    false_alarms_per_metre: float = 0.01
    seed: int = 1
    tip_sd: float = 0.0
    noise: StatedNoise | None = None
    begin: Noise | None = None

    @classmethod
    def of(cls, scene: Scene | None, begin: Noise | None = None) -> AnalysisSettings:
        """The settings of a scene; the defaults without one."""
        if scene is None:
            return cls(begin=begin)
        of = scene.detection
        return cls(of.algorithm, of.false_alarms_per_metre, scene.seed, scene.tip.radius_sd, scene.noise, begin)

    def of_means(self, average: Mapping[str, Any] | None) -> AnalysisSettings:
        """The same of a recording whose samples are means: their white noise is less than that of single samples."""
        if average is None:
            return self
        less = float(average["white_noise"])
        noise = None if self.noise is None else replace(self.noise, noise=self.noise.noise.scaled(white=less))
        return replace(self, noise=noise, begin=None if self.begin is None else self.begin.scaled(white=less))

    @property
    def detection(self) -> dict[str, Any]:
        """Arguments of `mapping.detection.detect.detect`."""
        rate = self.false_alarms_per_metre
        return {"algorithm": self.algorithm, "false_alarms_per_metre": rate, "stated": self.noise, "begin": self.begin}
