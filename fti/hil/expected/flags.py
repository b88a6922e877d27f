"""What the daemon must say of each fault, and how soon: the flags of ``FaultKind``.

A flag is a word at a place of the recorded session (``fti.post.score.messages``):

place                                words
-----------------------------------  ----------------------------------------------------------------------------------
/nav/height_above_ground/ALTIMETER   the reasons against a height: stale, device_flag, no_return, deviation ...
                                     terrain_edge, terrain_hole: nothing is known there to compare it with
/nav/nav_solution                    its reasons; "position not from D", "attitude not from D": D is the preferred one;
                                     "position from filter", "position from radio": no device has one
/nav/clearance_integrity             unavailable, caution, alert, and the reasons
/fti/health/devices/D                silent, noise, invalid, wrong rate; "damaged bytes" while bytes are refused;
                                     "clock away" while its time does not fit
/fti/health/links/L                  absent, denied, busy, silent
/fti/ledger/L                        errors that the line counts: slcan_bus_error, can_bus_off ...
/fti/alarm                           identities of alarms, which follow from other flags (``alarm_flags``)
/D/device_status                     the conditions that a device names while it is not well
/D/...                               invalid: a measurement that the device declares so

A duty is due when the fault lasts longer than it may take.  What no part of the daemon compares raises no flag, which
is neither a miss nor a success; ``compared`` lists the faults whose effects on the outputs are judged by the truth.
"""

from __future__ import annotations

import numpy as np

from fti.hil.expected.aircraft import Aircraft, Truth
from fti.hil.expected.device_flags import consequences, on_device, silence
from fti.hil.expected.duties import (
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
    NAV_EVENT,
    NAV_S,
    OBSTACLE_M,
    SILENT_S,
    SLOWEST_MPS,
    SOLUTION,
    WINDOW_S,
    Case,
    Duty,
    May,
    Told,
    doubted_s,
)
from fti.hil.expected.fallbacks import of_fallbacks
from fti.hil.faults.fitting import is_of
from fti.hil.tables.bases import OnLinks
from fti.hil.tables.kinds import Babbling, BusOff, CanStatus, Fault, Obstacle, OffTrack, TerrainShift


def told(fault: Fault, craft: Aircraft, truth: Truth) -> list[Told]:
    """What the daemon must, and may, say of a fault; one for each device or link that it is on."""
    if isinstance(fault, Obstacle):
        return [_obstacle(fault, craft, truth)]
    if isinstance(fault, OffTrack):
        return [_off_track(fault, craft, truth)]
    if isinstance(fault, TerrainShift):
        return [_displaced_map(craft, truth)]
    if isinstance(fault, OnLinks):
        return [_on_link(fault, craft, truth, name) for name in fault.links or craft.can_links(fault)]
    names = [bound.device.name for bound in craft.devices if is_of(fault, bound)]
    return [on_device(fault, Case(craft, truth, name, fault.from_s, fault.to_s)) for name in names]


def flags_of_faults(faults: tuple[Fault, ...], craft: Aircraft, truth: Truth) -> list[tuple[int, Told]]:
    """What the daemon must, and may, report of all faults of a scenario, each with the index of its fault.

    Of each fault by itself, then of those that together leave navigation without a device for its position.
    """
    single = [(index, one) for index, fault in enumerate(faults) for one in told(fault, craft, truth)]
    return single + of_fallbacks(faults, craft)


# ------------------------------------------------------------------------------------------------- of the world


def _obstacle(fault: Obstacle, craft: Aircraft, truth: Truth) -> Told:
    """Above it, the return of the altimeter is the obstacle's; beside it, as soon as the beam reaches it."""
    reach = craft.beam_reach * truth.height_agl
    near = abs(fault.before_threshold_m - truth.before_threshold)
    above = truth.span(near <= fault.length_m / 2)
    beside = truth.span(near <= fault.length_m / 2 + reach)
    if beside is None:
        return Told("flight", (), ())
    begin, end = beside
    last = end + doubted_s(craft)
    may = (May(INTEGRITY, begin, last), *_against_ground(craft, begin, end))
    if above is None:  # the flight ended with the obstacle ahead, where the beam saw it
        return Told("flight", (), may)
    left = above[0] + craft.window_m / SLOWEST_MPS  # the window, at the earliest
    duty = Duty(INTEGRITY, ("obstacle",), above[0], left, CONFIRM_S, last - left)
    seen = fault.height_m >= OBSTACLE_M and abs(fault.right_m) <= fault.width_m / 2 and craft.has_approach
    duties = (duty, *_deviations(craft, truth, above)) if seen else ()
    unknown = "" if seen else f"lower than {OBSTACLE_M:g} m, beside the track, or without an approach"
    return Told("flight", duties, may, unknown)


def _against_ground(craft: Aircraft, begin: float, end: float) -> tuple[May, ...]:
    """Ground that is not as it is known speaks against every altimeter."""
    return (
        *(May(f"{HEIGHT}/{name}", begin, end + SILENT_S, GROUND_WORDS) for name in craft.altimeters),
        *(May(f"{HEIGHT}/{name}", begin, end + MEMORY_S, MEMORY_WORDS) for name in craft.altimeters),
        *(May(f"/fti/event/{name}", begin, end + MEMORY_S) for name in craft.altimeters),
    )


def _deviations(craft: Aircraft, truth: Truth, above: tuple[float, float]) -> list[Duty]:
    """A radar above it says what the known ground does not explain, as long as it can measure at all."""
    if not craft.knows_ground:
        return []
    highest = float(np.max(truth.height_agl[(truth.t >= above[0]) & (truth.t <= above[1])]))
    radars = [name for name in craft.altimeters if not craft.is_laser(name) and highest < craft.range_m(name)]
    return [
        Duty(f"{HEIGHT}/{name}", ("deviation",), *above, craft.period_s(name) + NAV_S, SILENT_S + above[1] - above[0])
        for name in radars
    ]


def _off_track(fault: OffTrack, craft: Aircraft, truth: Truth) -> Told:
    """As long as the aircraft is beyond what the approach allows; no side step is that large: nothing is due."""
    beyond = truth.span(abs(truth.offset) > craft.track_limit_m)
    if beyond is None or not craft.has_approach:
        return Told("flight", (), (May(INTEGRITY, fault.from_s, fault.to_s + fault.turn_s),))
    begin, end = beyond
    duty = Duty(INTEGRITY, ("off_track",), begin, end, NAV_S + SILENT_S, NAV_S + SILENT_S)
    return Told("flight", (duty,), (May(INTEGRITY, begin, end + doubted_s(craft)),))


def _displaced_map(craft: Aircraft, truth: Truth) -> Told:
    """Everything that is compared with the elevation model, and what it aids, may be contradicted at any time."""
    end = truth.end_s + SILENT_S
    places = (INTEGRITY, HEIGHT, SOLUTION, NAV_EVENT, *(f"/fti/event/{name}" for name in craft.altimeters))
    may = tuple(May(place, 0.0, end) for place in places if craft.knows_ground or place == INTEGRITY)
    return Told("flight", (), may, "an elevation model that is displaced")


# --------------------------------------------------------------------------------------------------- of a line


def _on_link(fault: OnLinks, craft: Aircraft, truth: Truth, link: str) -> Told:
    """Everything that is on a bus."""
    end = fault.to_s + LEDGER_S
    may = [May(f"{place}/{link}", fault.from_s, end + WINDOW_S) for place in (LEDGER, LINKS, "/fti/event")]
    if isinstance(fault, Babbling):
        return Told(link, (), tuple(may), "a bus that is loaded by one node")
    case = Case(craft, truth, link, fault.from_s, fault.to_s)
    duties = _bus_off(case) if isinstance(fault, BusOff) else _status(fault, case)
    if isinstance(fault, BusOff):
        for device in craft.on_link(link):
            one = Case(craft, truth, device, fault.from_s, fault.to_s)
            duties += silence(one)
            may += consequences(one)
    return Told.from_duties(link, duties, may)


def _bus_off(case: Case) -> list[Duty]:
    return [case.duty(f"{LINKS}/{case.name}", "silent", within_s=SILENT_S + HEALTH_S, clears_s=HEALTH_S + 1.0)]


def _status(fault: OnLinks, case: Case) -> list[Duty]:
    """Every flag that the adapter is given to tell is counted."""
    assert isinstance(fault, CanStatus)
    place = f"{LEDGER}/{case.name}"
    return [
        case.duty(place, f"slcan_{flag}", within_s=LEDGER_S, clears_s=LEDGER_CLEARS_S, ports=True)
        for flag in fault.flags
    ]
