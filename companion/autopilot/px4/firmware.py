"""PX4 behind the interface of autopilots."""

from companion.autopilot.interface import Autopilot
from companion.autopilot.px4 import modes, setup
from companion.messages import MessageId, VehicleCommand, set_message_interval


def _changed_law(leans: bool | None) -> VehicleCommand | None:
    """Have PX4 change between its controllers of position and of attitude.

    Within OFFBOARD it does so with its status, twice a second (Commander.cpp, updateControlMode): until then both
    fly the vehicle, or neither does. MAV_CMD_RUN_PREARM_CHECKS changes nothing in flight, and the commander acts on any
    command at once.
    """
    return None if leans is None else VehicleCommand(401, (), "run checks")


PX4 = Autopilot(
    name="PX4",
    mav_autopilot=12,
    setpoints=modes.OFFBOARD,
    hold=modes.AUTO_LOITER,
    land=modes.AUTO_LAND,
    sticks=modes.POSCTL,
    descents=frozenset({modes.AUTO_LAND, modes.AUTO_PRECLAND}),
    modes=modes.MODES,
    mode_mask=modes.MAIN,
    mode_parameters=lambda mode: (mode >> 16 & 0xFF, mode >> 24 & 0xFF),
    attitude_mask=0x03,  # PX4's attitude loop makes the rates of roll and pitch
    # After a hit its estimator moves a bias by 0.3 m/s^2 within 0.25 s.
    streams=(set_message_interval(MessageId.SCALED_IMU, 40_000),),
    estimator_message=MessageId.ESTIMATOR_STATUS,
    sticks_message=MessageId.MANUAL_CONTROL,
    unsigned_throttle_since=(1, 16, 0),  # 80ea3a09bb of March 2025
    wants_setpoints_first=True,
    changed_law=_changed_law,
    attitude_parameters=(setup.LOSS,),
    attitude_held_s=lambda told: told[setup.LOSS],
    # Of a real one, by motion capture: its velocity is wrong by up to 7 m/s, and then its tilt by 8 degrees.
    misled_s=1.4,
    loss_parameter=setup.LOSS,
    rate_parameter="MAV_x_RATE",
    sight=setup.sight,
    parameters=setup.PARAMETERS,
    judge_vehicle=(setup.rotors, setup.port),
    judge_parameters=setup.judge_parameters,
    remedy_slow_stream="serial: baud rate 921600 (SER_TEL2_BAUD), MAV_1_MODE 2 (Onboard), MAV_1_RATE 0; then ask again",
    remedy_full_link="the link is full: baud rate 921600 and MAV_1_RATE 0 give HIGHRES_IMU about 200 Hz",
    remedy_no_time="MAVLink 2 on the link (MAV_PROTO_VER 2)",
    remedy_no_battery="set up the power module (BAT1_SOURCE)",
    remedy_no_estimator="look at EKF2 in QGroundControl",
    remedy_not_armed="`commander check` in PX4's console says why",
    stick_deadzone=0.1,  # MPC_HOLD_DZ
    stick_override=0.3,  # COM_RC_STICK_OV
)
