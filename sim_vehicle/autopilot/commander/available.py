"""What there is of all that modes need, and which modes cannot run without the rest."""

from functools import cache

from sim_vehicle.autopilot.commander.modes import Mode, Need, missing


@cache
def available(
    has_local: bool, has_global: bool, has_sticks: bool, has_setpoints: bool, has_mission: bool
) -> frozenset[Need]:
    """What modes may need, as far as it is there."""
    there = {
        Need.LOCAL_POSITION: has_local,
        Need.HOME: True,
        Need.GLOBAL_POSITION: has_global,
        Need.STICKS: has_sticks,
        Need.SETPOINTS: has_setpoints,
        Need.MISSION: has_mission,
    }
    return frozenset(need for need, is_there in there.items() if is_there)


@cache
def cannot_run(there_is: frozenset[Need], has_setpoints: bool) -> frozenset[Mode]:
    """The modes that cannot run, as the failsafes count: lost sticks have a row of their own."""
    there = there_is | {Need.STICKS, Need.SETPOINTS} if has_setpoints else (there_is | {Need.STICKS}) - {Need.SETPOINTS}
    return frozenset(mode for mode in Mode if missing(mode, there))
