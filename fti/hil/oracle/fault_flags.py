"""Expected flags of each fault and their deadlines.

A flag is a word at a place of the recorded session (``fti.post.score.messages``):

place                                words
-----------------------------------  ----------------------------------------------------------------------------------
/nav/height_above_ground/ALTIMETER   reasons that make a height invalid: stale, device_flag, no_return, deviation ...
                                     terrain_edge, terrain_hole: no known terrain for a comparison
/nav/nav_solution                    its reasons; "position not from D", "attitude not from D": D is the first source;
                                     "position from filter", "position from radio": no device gives one
/nav/ground_drift                    contradiction: the device of the looks has a wrong mounting, clock or range
/nav/clearance_integrity             unavailable, caution, alert, and the reasons
/fti/health/devices/D                silent, noise, invalid, wrong rate; "damaged bytes" while bytes are rejected;
                                     "clock away" while its time is inconsistent
/fti/health/links/L                  absent, denied, busy, silent
/fti/ledger/L                        error counters of the line: slcan_bus_error, can_bus_off ...
/fti/alarm                           alarm identities, derived from other flags (``alarm_flags``)
/D/device_status                     conditions that a device reports
/D/...                               invalid: the device declares a measurement invalid

A flag is expected if the fault lasts longer than its deadline.  Effects that the daemon does not monitor raise no flag,
which is neither a miss nor a success; ``truth_checked_faults`` lists faults whose outputs are compared with the truth.
"""

from __future__ import annotations

import numpy as np

from fti.hil.faults.applicability import applies_to
from fti.hil.oracle.device_flags import consequences, flags_on_device, silence_flags
from fti.hil.oracle.fallbacks import fallback_flags
from fti.hil.oracle.flag_definitions import (
    CONFIRM_S,
    GROUND_WORDS,
    HEALTH_S,
    HEIGHT,
    INTEGRITY,
    LEDGER,
    LEDGER_CLEARS_S,
    LEDGER_S,
    LINKS,
    MEMORY_S,
    MEMORY_WORDS,
    MIN_SPEED_MPS,
    NAV_EVENT,
    NAV_S,
    OBSTACLE_M,
    SILENT_S,
    SOLUTION,
    WINDOW_S,
    ExpectedFlag,
    FaultCase,
    FaultFlags,
    FlagAllowance,
    monitor_recovery_s,
)
from fti.hil.oracle.roles import AircraftRoles, TruthSeries
from fti.hil.tables.fault_base import LinkFault
from fti.hil.tables.fault_types import Babbling, CanStatus, Fault, Obstacle, OffTrack, TerrainShift


def flags_of_fault(fault: Fault, craft: AircraftRoles, truth: TruthSeries) -> list[FaultFlags]:
    """Expected and allowed flags of a fault; one entry for each of its devices or links."""
    if isinstance(fault, Obstacle):
        return [_obstacle_flags(fault, craft, truth)]
    if isinstance(fault, OffTrack):
        return [_off_track_flags(fault, craft, truth)]
    if isinstance(fault, TerrainShift):
        return [_terrain_shift_flags(craft, truth)]
    if isinstance(fault, LinkFault):
        return [_link_flags(fault, craft, truth, name) for name in fault.links or craft.can_links(fault)]
    names = [bound.device.name for bound in craft.devices if applies_to(fault, bound)]
    return [flags_on_device(fault, FaultCase(craft, truth, name, fault.from_s, fault.to_s)) for name in names]


def flags_of_scenario(
    faults: tuple[Fault, ...], craft: AircraftRoles, truth: TruthSeries
) -> list[tuple[int, FaultFlags]]:
    """Expected and allowed flags of all faults of a scenario, each with the index of its fault.

    First those of each single fault, then those of faults that together cause the loss of all position devices.
    """
    single = [(index, one) for index, fault in enumerate(faults) for one in flags_of_fault(fault, craft, truth)]
    return single + fallback_flags(faults, craft)


# ------------------------------------------------------------------------------------------------------- world


def _obstacle_flags(fault: Obstacle, craft: AircraftRoles, truth: TruthSeries) -> FaultFlags:
    """An obstacle is expected to be flagged above it; flags are allowed as soon as the beam reaches it."""
    reach = craft.beam_reach * truth.height_agl
    near = abs(fault.before_threshold_m - truth.before_threshold)
    above = truth.span(near <= fault.length_m / 2)
    in_beam = truth.span(near <= fault.length_m / 2 + reach)
    if in_beam is None:
        return FaultFlags("flight", (), ())
    begin, end = in_beam
    last = end + monitor_recovery_s(craft)
    allowances = (FlagAllowance(INTEGRITY, begin, last), *_terrain_allowances(craft, begin, end))
    if above is None:  # the flight ends before the obstacle, but the beam reaches it
        return FaultFlags("flight", (), allowances)
    left = above[0] + craft.window_m / MIN_SPEED_MPS  # earliest time at which it has left the window
    expected_flag = ExpectedFlag(INTEGRITY, ("obstacle",), above[0], left, CONFIRM_S, last - left)
    is_detectable = fault.height_m >= OBSTACLE_M and abs(fault.right_m) <= fault.width_m / 2 and craft.has_approach
    expected_flags = (expected_flag, *_deviation_flags(craft, truth, above)) if is_detectable else ()
    unknown = "" if is_detectable else f"lower than {OBSTACLE_M:g} m, off the track, or no approach is configured"
    return FaultFlags("flight", expected_flags, allowances, unknown)


def _terrain_allowances(craft: AircraftRoles, begin: float, end: float) -> tuple[FlagAllowance, ...]:
    """Allowed flags of all altimeters over ground that differs from the known terrain."""
    return (
        *(FlagAllowance(f"{HEIGHT}/{name}", begin, end + SILENT_S, GROUND_WORDS) for name in craft.altimeters),
        *(FlagAllowance(f"{HEIGHT}/{name}", begin, end + MEMORY_S, MEMORY_WORDS) for name in craft.altimeters),
        *(FlagAllowance(f"/fti/event/{name}", begin, end + MEMORY_S) for name in craft.altimeters),
    )


def _deviation_flags(craft: AircraftRoles, truth: TruthSeries, above: tuple[float, float]) -> list[ExpectedFlag]:
    """A radar above the obstacle, within its range, deviates from the known terrain."""
    if not craft.has_terrain:
        return []
    highest = float(np.max(truth.height_agl[(truth.t >= above[0]) & (truth.t <= above[1])]))
    radars = [name for name in craft.altimeters if not craft.is_laser(name) and highest < craft.range_m(name)]
    return [
        ExpectedFlag(
            f"{HEIGHT}/{name}", ("deviation",), *above, craft.period_s(name) + NAV_S, SILENT_S + above[1] - above[0]
        )
        for name in radars
    ]


def _off_track_flags(fault: OffTrack, craft: AircraftRoles, truth: TruthSeries) -> FaultFlags:
    """Expected while the aircraft is beyond the lateral limit of the approach; no flag for a smaller offset."""
    beyond = truth.span(abs(truth.offset) > craft.track_limit_m)
    if beyond is None or not craft.has_approach:
        return FaultFlags("flight", (), (FlagAllowance(INTEGRITY, fault.from_s, fault.to_s + fault.turn_s),))
    begin, end = beyond
    expected_flag = ExpectedFlag(INTEGRITY, ("off_track",), begin, end, NAV_S + SILENT_S, NAV_S + SILENT_S)
    return FaultFlags("flight", (expected_flag,), (FlagAllowance(INTEGRITY, begin, end + monitor_recovery_s(craft)),))


def _terrain_shift_flags(craft: AircraftRoles, truth: TruthSeries) -> FaultFlags:
    """Allowed at any time at all outputs that are compared with the elevation model or aided by it."""
    end = truth.end_s + SILENT_S
    places = (INTEGRITY, HEIGHT, SOLUTION, NAV_EVENT, *(f"/fti/event/{name}" for name in craft.altimeters))
    allowances = tuple(FlagAllowance(place, 0.0, end) for place in places if craft.has_terrain or place == INTEGRITY)
    return FaultFlags("flight", (), allowances, "a displaced elevation model may raise flags, none is certain")


# ------------------------------------------------------------------------------------------------------- lines


def _link_flags(fault: LinkFault, craft: AircraftRoles, truth: TruthSeries, link: str) -> FaultFlags:
    end = fault.to_s + LEDGER_S
    allowances = [
        FlagAllowance(f"{place}/{link}", fault.from_s, end + WINDOW_S) for place in (LEDGER, LINKS, "/fti/event")
    ]
    if isinstance(fault, Babbling):
        return FaultFlags(link, (), tuple(allowances), "an additional node on a bus raises no certain flag")
    case = FaultCase(craft, truth, link, fault.from_s, fault.to_s)
    if isinstance(fault, CanStatus):  # the ledger counts every flag that the adapter reports
        place = f"{LEDGER}/{link}"
        expected_flags = [
            case.expected_flag(place, f"slcan_{flag}", within_s=LEDGER_S, clears_s=LEDGER_CLEARS_S, needs_ports=True)
            for flag in fault.flags
        ]
    else:
        within_s, clears_s = SILENT_S + HEALTH_S, HEALTH_S + 1.0
        expected_flags = [case.expected_flag(f"{LINKS}/{link}", "silent", within_s=within_s, clears_s=clears_s)]
        for device in craft.devices_on_link(link):
            one = FaultCase(craft, truth, device, fault.from_s, fault.to_s)
            expected_flags += silence_flags(one)
            allowances += consequences(one)
    return FaultFlags.from_flags(link, expected_flags, allowances)
