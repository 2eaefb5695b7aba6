"""Which streams a link has unasked, and how often: PX4's sets for a companion and for a ground station.

Source: PX4's mavlink/mavlink_main.cpp (configure_streams_to_default) and init.d-posix/px4-rc.mavlink. Messages of
equipment that this vehicle does not have (gimbal, camera, transponder, speed controllers) are left out.
"""

from enum import Enum

from sim_vehicle.errors import LinkAddressError

UNLIMITED = -1.0
"""Whenever there is something new."""

_ONBOARD: dict[int, float] = {
    111: 10.0,  # TIMESYNC
    105: 50.0,  # HIGHRES_IMU
    32: 30.0,  # LOCAL_POSITION_NED
    30: 100.0,  # ATTITUDE
    132: 10.0,  # DISTANCE_SENSOR
    331: 30.0,  # ODOMETRY
    31: 50.0,  # ATTITUDE_QUATERNION
    83: 10.0,  # ATTITUDE_TARGET
    436: 0.5,  # CURRENT_MODE
    245: 5.0,  # EXTENDED_SYS_STATE
    106: 10.0,  # OPTICAL_FLOW_RAD
    85: 10.0,  # POSITION_TARGET_LOCAL_NED
    1: 5.0,  # SYS_STATUS
    241: 0.5,  # VIBRATION
    33: 50.0,  # GLOBAL_POSITION_INT
    141: 10.0,  # ALTITUDE
    74: 10.0,  # VFR_HUD
    36: 10.0,  # SERVO_OUTPUT_RAW
    24: UNLIMITED,  # GPS_RAW_INT
    87: 10.0,  # POSITION_TARGET_GLOBAL_INT
    230: 1.0,  # ESTIMATOR_STATUS
    360: 5.0,  # ORBIT_EXECUTION_STATUS
    49: 1.0,  # GPS_GLOBAL_ORIGIN
    242: 0.5,  # HOME_POSITION
    147: 0.5,  # BATTERY_STATUS
    2: 1.0,  # SYSTEM_TIME
    4: 1.0,  # PING
    29: 1.0,  # SCALED_PRESSURE
}

_NORMAL: dict[int, float] = {
    30: 15.0,
    31: 10.0,
    83: 2.0,
    436: 0.5,
    132: 0.5,
    245: 1.0,
    32: 1.0,
    85: 1.5,
    1: 1.0,
    241: 0.1,
    33: 5.0,
    141: 1.0,
    74: 4.0,
    36: 1.0,
    24: 5.0,
    87: 1.0,
    230: 0.5,
    360: 2.0,
    49: 1.0,
    242: 0.5,
    147: 0.5,
    4: 0.1,
    29: 1.0,
}

# What px4-rc.mavlink asks for beyond that on the ground station's UDP link.
_NORMAL_SITL: dict[int, float] = {
    **_NORMAL,
    **dict.fromkeys((85, 32, 33, 30, 31, 83, 36), 50.0),
    106: 10.0,
}


class LinkKind(Enum):
    """For whom a link is (PX4's MAVLINK_MODE)."""

    ONBOARD = "onboard"
    """A companion: UDP port 14540, or TELEM 2."""
    NORMAL = "normal"
    """A ground station behind a radio: TELEM 1."""
    GROUND = "ground"
    """A ground station of a simulation: UDP port 14550."""

    @property
    def rates_hz(self) -> dict[int, float]:
        """Message id to rate."""
        return _RATES[self]


_RATES = {LinkKind.ONBOARD: _ONBOARD, LinkKind.NORMAL: _NORMAL, LinkKind.GROUND: _NORMAL_SITL}


def link_kind(name: str) -> LinkKind:
    """By its name in addresses. Raises LinkAddressError for one that there is not."""
    try:
        return LinkKind(name)
    except ValueError as problem:
        names = ", ".join(kind.value for kind in LinkKind)
        raise LinkAddressError(f"unknown set of streams {name!r}: use one of {names}.") from problem
