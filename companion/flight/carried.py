"""What hit the vehicle goes on pushing it, or comes after it while it recovers."""

import math

from companion.estimate.rotation import body_to_ned
from companion.flight.collision import CollisionRecord
from companion.flight.context import FlightContext
from companion.messages import LocalPosition, Vector3
from companion.recovery.direction import split
from companion.recovery.way import REST, Motion

# A contact that still pushes this long after it began is no hit but something that carries the vehicle along.
CARRIED_AFTER_US = 250_000
# It pushes still when it pushed within this: a few IMU samples of the slowest stream.
STILL_PUSHING_US = 60_000
# The place to recover to is then found anew, ten times a second.
CARRIED_EVERY_US = 100_000
# What has come after the vehicle pushes it on, too softly to be felt, when it does not slow down as it is asked to: six
# times the noise of a good velocity. For so long after the last push that was felt.
NOT_SLOWED_M_S = 0.2
COMES_AFTER_US = 1_500_000
# What is then asked for besides: half a metre a second is 0.2 m in the time that a lean takes both ways.
CLEAR_M_S = 0.5
# Six times the noise of a good estimate.
LEAVING_M_S = 0.2
# Cosine of 30 degrees: friction leans a push by 17, and the estimate of the normal is good to ten.
AGREEING = 0.87


def overtaken(flight: FlightContext, push_frd_m_s2: Vector3, velocity_ned_m_s: Vector3) -> Vector3 | None:
    """The normal of the hit before, where what was hit has come after a vehicle that still recovers from it.

    What pushes a vehicle on in the direction in which it leaves is behind it, whatever an estimate makes of a push.
    """
    if not flight.collisions or flight.collisions[-1].is_over or flight.vehicle.attitude is None:
        return None
    normal = flight.collisions[-1].contact.normal_ned
    push = body_to_ned(flight.vehicle.attitude.attitude_wxyz, push_frd_m_s2)
    leaves_m_s, pushed_m_s2 = split(velocity_ned_m_s, normal)[0], split(push, normal)[0]
    return normal if leaves_m_s > LEAVING_M_S and pushed_m_s2 > AGREEING * math.hypot(*push) else None


def is_carried(
    flight: FlightContext, record: CollisionRecord, normal_ned: Vector3, sample: LocalPosition, asked: Motion
) -> bool:
    """Whether the recovery from the hit is to begin anew from where the vehicle is. `asked`: of it at this moment."""
    now_us, pushed_us = sample.time_boot_us, record.contact_ended_boot_us
    if now_us - record.sample_time_boot_us <= CARRIED_AFTER_US:
        return False
    touch, comes_after = flight.touch, record.is_behind
    if touch is not None and touch.time_boot_us > pushed_us and split(touch.push_ned_m_s2, normal_ned)[0] > 0.0:
        pushed_us, comes_after = touch.time_boot_us, True
    u, v, w = asked.velocity_ned_m_s or REST
    a, b, c = sample.velocity_ned_m_s
    faster_m_s = split((a - u, b - v, c - w), normal_ned)[0]
    # A vehicle that flies as it is asked to is carried by nothing, however it shakes.
    return now_us - pushed_us < (COMES_AFTER_US if comes_after else STILL_PUSHING_US) and faster_m_s > NOT_SLOWED_M_S
