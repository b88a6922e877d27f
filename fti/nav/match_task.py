"""What a method of position from the ground gets for each profile."""

from __future__ import annotations

from dataclasses import dataclass

from fti.nav.height_profile import HeightProfile
from fti.nav.terrain_matching.fix import MatchFix, MatchLimits, MatchPriors, match
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import TerrainWindow


@dataclass(frozen=True, eq=False)
class MatchTask:
    """A profile, and what is known before it is matched.

    height_sd : one sigma of the navigated height [m];  reach_m : largest shift that is searched, each way [m]
    """

    heights: HeightProfile
    height_sd: float
    reach_m: float
    limits: MatchLimits
    priors: MatchPriors

    def search_area(self) -> tuple[Profile, TerrainWindow, Lattice]:
        """The profile, and the ground and the shifts to compare it with."""
        return self.heights.search_area(self.height_sd, self.reach_m)

    def solve(self, profile: Profile, window: TerrainWindow, lattice: Lattice) -> MatchFix:
        """The fix by the likelihood."""
        return match(window, profile, lattice, self.limits, self.priors)
