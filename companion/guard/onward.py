"""Whether what flew before the hit would fly on into what was touched."""

import math

from companion.autopilot.interface import Pilot
from companion.flight.context import Target
from companion.flight.obstacle_map import all_known
from companion.guard.context import GuardContext
from companion.guard.watching import OTHERS_STOPPED_US
from companion.memory.patch import LEAST_SPEED_M_S
from companion.messages import Asked, Vector3
from companion.motion.vector import ZERO, along, plus

# PX4 brakes by this where it is set up as docs/how-to/guard.md has it. With PX4's default it needs less room
# (reflex.config.BRAKES_M_S2).
BRAKES_M_S2 = 2.0
# A velocity that is asked for leads somewhere: as far as in the time in which PX4 takes its setpoint for lost.
GOES_ON_S = OTHERS_STOPPED_US * 1e-6

# Standard deviations of a surface's direction that a program must stay clear of to have the vehicle back: 95 %.
CERTAIN = 2.0


def leads_into(guard: GuardContext, mode: int) -> str | None:
    """Why the mode would hit again; None where it would not."""
    autopilot = guard.vehicle.autopilot
    if mode == autopilot.setpoints:
        does_lead = lead_into(guard, guard.asked or Asked(), CERTAIN)
        if does_lead is None:
            return "nobody knows where the program's setpoints lead: choose a mode"
        return "the program's setpoints lead into what was hit: send others, or choose a mode" if does_lead else None
    if mode == autopilot.hold or not guard.collisions:
        return None
    contact = guard.collisions[-1].contact
    if autopilot.pilot(mode) is not Pilot.AUTOPILOT:
        pushed = -along(_sticks_ned(guard), contact.normal_ned) > autopilot.stick_deadzone
        return "the sticks push on into what was hit: release them" if pushed else None
    if -along(contact.velocity_ned_m_s, contact.normal_ned) < LEAST_SPEED_M_S:
        return None
    name = autopilot.mode_name(mode)
    return f"{name} goes on into what was hit: change it and choose it again, or choose another mode"


def _sticks_ned(guard: GuardContext) -> Vector3:
    """Where the pilot's sticks push the vehicle by its present heading: 1 is full deflection, NED."""
    heading_rad = guard.vehicle.heading_rad
    if guard.sticks_now is None or heading_rad is None:
        return ZERO
    forward, right, *_ = guard.sticks_now.deflections
    cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
    return (forward * cosine - right * sine, forward * sine + right * cosine, 0.0)


def lead_into(guard: GuardContext, asked: Asked, deviations: float = 0.0) -> bool | None:
    """Whether setpoints do; None where they do not say where they lead.

    With `deviations` also where a surface would have to bend towards them by so many standard deviations.
    """
    if asked.place_ned_m is None and asked.velocity_ned_m_s is None:
        return None
    velocity = asked.velocity_ned_m_s or ZERO
    ahead_s = math.hypot(*velocity) / (2.0 * BRAKES_M_S2) + GOES_ON_S
    here = guard.mission_ned_m(guard.latest.position_ned_m)
    place = here if asked.place_ned_m is None else guard.mission_ned_m(asked.place_ned_m)
    known = all_known(guard)
    goal = plus(place, ahead_s, velocity)
    # A surface may be longer than it is known to be: who is in front of it stays there.
    leads_behind = any(
        patch.off_m(here) > 0.0
        and patch.off_m(goal) - deviations * patch.bends_m(patch.beside_m(goal)) < known.clearance_m
        for patch in known.patches
    )
    return leads_behind or known.block([here, goal])


def stop(guard: GuardContext) -> Target:
    """Where the vehicle comes to rest when it brakes now."""
    latest = guard.latest
    brakes_s = math.hypot(*latest.velocity_ned_m_s) / (2.0 * BRAKES_M_S2)
    return Target(plus(latest.position_ned_m, brakes_s, latest.velocity_ned_m_s), guard.yaw_rad)
