"""Where the streams' contents come from, and how often each has been renewed: PX4's uORB topics, as counters."""

from enum import IntEnum

from sim_vehicle.autopilot.offboard import STATUS_PERIOD_US
from sim_vehicle.mavlink.telemetry import Telemetry

NEVER_SENT = -1


class Topic(IntEnum):
    """Without anything new in its topic, a stream sends nothing."""

    ALWAYS_NEW = 0
    SAMPLE = 1
    POSITION = 2
    STATUS = 3
    FLOW = 4
    RANGE = 5
    GPS = 6
    AIR = 7
    BATTERY = 8
    ORIGIN = 9
    """New once: it does not move."""
    MAGNETIC_FIELD = 10
    STICKS = 11


# What a vehicle may not have: nothing is sent of it before there is something.
OPTIONAL = (Topic.FLOW, Topic.RANGE, Topic.AIR, Topic.STICKS)


class Topics:
    """``versions[topic]`` grows whenever there is something new."""

    def __init__(self, state: Telemetry) -> None:
        self._state = state
        self.versions = [NEVER_SENT if topic in OPTIONAL else 0 for topic in Topic]
        self._seen: dict[Topic, object] = dict(self._sources())
        self._status: tuple[int, bool, int] | None = None
        self._status_us = state.sample.time_boot_us

    def _sources(self) -> tuple[tuple[Topic, object], ...]:
        """What is another object, or another number, whenever it is renewed."""
        state, commander = self._state, self._state.autopilot.commander
        return (
            (Topic.STICKS, commander.sticks.sticks),
            (Topic.AIR, state.slow.air),
            (Topic.MAGNETIC_FIELD, state.slow.magnetic_field_frd_gauss),
            (Topic.GPS, state.slow.gps),
            (Topic.BATTERY, commander.battery.version),
            (Topic.FLOW, state.flow),
            (Topic.RANGE, state.range),
        )

    def count(self, new_position: bool) -> None:
        """Look at what this interval has brought; ``new_position``: the estimator has published."""
        versions = self.versions
        versions[Topic.ALWAYS_NEW] += 1
        versions[Topic.SAMPLE] += 1
        state, commander = self._state, self._state.autopilot.commander
        if not new_position:
            return
        # All else is slow enough to be looked at this often only.
        versions[Topic.POSITION] += 1
        for topic, source in self._sources():
            is_gone = source is None and topic in OPTIONAL
            if source is not self._seen[topic] and not is_gone:
                self._seen[topic] = source
                versions[topic] += 1
        now_us = state.sample.time_boot_us
        status = (commander.modes.flown, commander.arming.armed, commander.system_status)
        if status != self._status or now_us - self._status_us >= STATUS_PERIOD_US:
            self._status, self._status_us = status, now_us
            versions[Topic.STATUS] += 1
