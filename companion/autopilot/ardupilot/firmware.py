"""Copter behind the interface of autopilots."""

import math

from companion.autopilot.ardupilot import modes, setup
from companion.autopilot.interface import Autopilot
from companion.messages import MessageId, VehicleCommand, set_message_interval

# RC_Channel.h: while FORCEFLYING is high, neither the crash check nor the land detector stops the motors. A recovery
# leans further from its target, and shakes more, than they allow in the air.
_FORCE_FLYING = 159
_LOW, _HIGH = 0, 2


def _changed_law(leans: bool | None) -> VehicleCommand:
    """MAV_CMD_DO_AUX_FUNCTION, a transmitter's switch: high while it is flown by attitude, low before and after."""
    level = _HIGH if leans else _LOW
    return VehicleCommand(218, (_FORCE_FLYING, level), f"auxiliary function {_FORCE_FLYING} at {level}")


ARDUPILOT = Autopilot(
    name="ArduPilot",
    mav_autopilot=3,
    setpoints=modes.GUIDED,
    # Not LOITER: a throttle stick that lies low, as while AUTO flies, makes it descend.
    hold=modes.BRAKE,
    land=modes.LAND,
    sticks=modes.LOITER,
    descents=frozenset({modes.LAND}),
    modes=modes.MODES,
    mode_parameters=lambda mode: (mode, 0),
    casts_whole_numbers=True,
    # All three rates or none: with one that is left out alone Copter stops where it is.
    attitude_mask=0,
    least_version=(4, 3, 0),  # GUID_TIMEOUT, GUID_OPTIONS bit 3
    # It has no CURRENT_MODE: how soon a pilot's mode is seen depends on this alone.
    streams=(set_message_interval(MessageId.HEARTBEAT, 50_000),),
    filters_imu=True,  # INS_ACCEL_FILTER
    lesser_imu=MessageId.RAW_IMU,
    estimator_message=MessageId.EKF_STATUS_REPORT,
    sticks_message=MessageId.RC_CHANNELS,
    is_told_to_take_off=True,
    wants_setpoints_first=False,
    changed_law=_changed_law,
    keeps_trim=True,  # AC_PosControl: init_xy_controller, since 4.7 NE_init_controller
    attitude_parameters=(setup.LOSS, setup.OPTIONS),
    attitude_held_s=setup.attitude_held_s,
    # Wrong by up to 7 m/s after a clipped hit, and by less than 1 m/s from then on.
    misled_s=0.8,
    # By a tilt that is wrong by 8 degrees a vehicle at rest drifts 2 m towards the obstacle before it is turned.
    last_place_m=4.0,
    loss_parameter=setup.LOSS,
    rate_parameter="SERIALn_BAUD",
    sight=setup.sight,
    parameters=setup.PARAMETERS,
    judge_vehicle=(setup.frame, setup.port),
    judge_parameters=setup.judge_parameters,
    remedy_slow_stream="serial: SERIAL2_PROTOCOL 2, SERIAL2_BAUD 921",
    remedy_full_link="the link is full: SERIAL2_BAUD 921",
    remedy_no_time="MAVLink 2 on the link (SERIAL2_PROTOCOL 2)",
    remedy_no_battery="set up the power module (BATT_MONITOR)",
    remedy_no_estimator="look at EKF in Mission Planner",
    remedy_not_armed="its messages in Mission Planner say why",
    stick_deadzone=0.2,  # THR_DZ, of 500 from the middle
    stick_override=math.inf,  # sticks end no mode
)
