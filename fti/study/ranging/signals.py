"""The receivers of section 2.2.6 on the return of level ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.ranging.radar.antenna import WIDE
from fti.ranging.radar.beam import Backscatter, make_beam, trace_beam
from fti.ranging.radar.dome import half_dome
from fti.ranging.radar.edge import LeadingEdge
from fti.ranging.radar.receivers import FmcwReceiver, Loat, Ssb
from fti.ranging.radar.waveform import Waveform
from fti.ranging.sensor import Poses
from fti.terrain.terrain import Terrain

#: Transmitted frequency of the figures [Hz].
F_TX = 4.3666e9
ORDER = 12
FARTHEST_M = 800.0
#: Sensor axes of a level aircraft that flies north.
LEVEL = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@dataclass(frozen=True)
class Example:
    """A receiver, and the beat [Hz] of the source."""

    name: str
    receiver: FmcwReceiver
    beat: float

    @property
    def height(self) -> float:
        """The range of the beat [m]."""
        return float(self.receiver.base.waveform.range_of_beat(self.beat))


LOAT, SSB = Example("LOAT", Loat(), 2.6e6), Example("SSB", Ssb(), 4.0e6)
EXAMPLES = (LOAT, SSB)


@dataclass(frozen=True, eq=False)
class Rays:
    """Return at the wide antenna at a height [m] over level ground: (n,) range [m], power, phase [rad]."""

    height: float
    ranges: Array
    powers: Array
    phases: Array

    @classmethod
    def over_level_ground(cls, height: float, seed: int) -> Rays:
        """The rays of the dome of order 12; phases drawn."""
        ground = Terrain.from_array(np.zeros((3, 3)), 5000.0, east0=-5000.0, north0=-5000.0)
        beam = make_beam(WIDE, half_dome(ORDER), Waveform().wavelength)
        poses = Poses.stationary([[0.0, 0.0, height]], LEVEL[None])
        echoes = trace_beam(ground, poses, beam, Backscatter(), FARTHEST_M)
        phases = np.random.default_rng([seed, 4]).uniform(0.0, 2.0 * np.pi, len(beam))
        return cls(height, echoes.ranges[0], echoes.powers[0], phases)


def edge_of(spectrum: Array) -> float:
    """Leading edge of a spectrum [bins]."""
    return float(LeadingEdge().find(spectrum[None]).position[0])


def chain(example: Example) -> float:
    """Range [m] that the whole chain measures for a single scatterer at the range of the beat."""
    spectrum = example.receiver.coherent([example.height], [1.0])
    return float(example.receiver.base.waveform.range_of_bin(edge_of(spectrum)))


def edge_distance(receiver: FmcwReceiver, rays: Rays) -> float:
    """Distance [bins] between the leading edges of the receiver and the baseband in one beam."""
    columns = rays.ranges, rays.powers, rays.phases
    return abs(edge_of(receiver.coherent(*columns)) - edge_of(receiver.base.coherent(*columns)))
