"""What PX4's simulator start-up does to its time-outs when the simulation is not as fast as the clock.

Source: ROMFS/px4fmu_common/init.d-posix/rcS, which multiplies these by PX4_SIM_SPEED_FACTOR: clients go by the clock.
"""

from sim_vehicle.parameters.definitions import definitions

_AT_REAL_TIME = {"COM_DL_LOSS_T": 10.0, "COM_RC_LOSS_T": 1.0, "COM_OF_LOSS_T": 0.3}


def time_outs_at(speed: float) -> dict[str, float]:
    """The parameters for a speed in simulated seconds a second; none at real time, or where there is no speed (0)."""
    if speed in (0.0, 1.0):
        return {}
    return {name: definitions()[name].limited(speed * seconds) for name, seconds in _AT_REAL_TIME.items()}
