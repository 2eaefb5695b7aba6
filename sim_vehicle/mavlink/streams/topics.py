"""Where the streams' contents come from, and how often each has been renewed: PX4's uORB topics, as counters."""

from enum import IntEnum

from sim_vehicle.autopilot.messages import StickInput
from sim_vehicle.autopilot.modes import Mode
from sim_vehicle.estimator.samples import FlowSample, RangeSample
from sim_vehicle.hil.messages import Air, HilGps
from sim_vehicle.mavlink.telemetry import Telemetry

# vehicle_status is published when it changes and at least at 2 Hz.
STATUS_PERIOD_US = 500_000
NEVER_SENT = -1


class Topic(IntEnum):
    """Without anything new in its topic, a stream sends nothing."""

    ALWAYS_NEW = 0
    SAMPLE = 1
    POSITION = 2
    STATUS = 3
    FLOW = 4
    RANGE = 5
    TRUTH = 6
    GPS = 7
    AIR = 8
    BATTERY = 9
    ORIGIN = 10
    """New once: it does not move."""
    MAGNETIC_FIELD = 11
    STICKS = 12
    ORBIT = 13


# What a vehicle may not have: nothing is sent of it before there is something.
OPTIONAL = (Topic.FLOW, Topic.RANGE, Topic.TRUTH, Topic.AIR, Topic.STICKS, Topic.ORBIT)


class Topics:
    """``versions[topic]`` grows whenever there is something new."""

    def __init__(self, state: Telemetry) -> None:
        self._state = state
        self.versions = [NEVER_SENT if topic in OPTIONAL else 0 for topic in Topic]
        self._flow: FlowSample | None = None
        self._range: RangeSample | None = None
        self._fix: HilGps | None = None
        self._battery = 0
        self._air: Air | None = None
        self._sticks: StickInput | None = None
        self._field = state.magnetic_field_frd_gauss
        self._status: tuple[int, bool, int] | None = None
        self._status_us = state.sample.time_boot_us

    def count(self, new_position: bool) -> None:
        """Look at what this interval has brought; ``new_position``: the estimator has published."""
        versions = self.versions
        versions[0] += 1
        versions[1] += 1
        state, commander = self._state, self._state.autopilot.commander
        if state.true_body is not None:
            versions[6] += 1
        if not new_position:
            return
        # All else is slow enough to be looked at this often only.
        versions[2] += 1
        sticks = commander.sticks.sticks
        if sticks is not self._sticks and sticks is not None:
            self._sticks = sticks
            versions[12] += 1
        if state.air is not self._air:
            self._air = state.air
            versions[8] += 1
        if state.magnetic_field_frd_gauss is not self._field:
            self._field = state.magnetic_field_frd_gauss
            versions[11] += 1
        if state.gps is not self._fix:
            self._fix = state.gps
            versions[7] += 1
        if commander.battery.version != self._battery:
            self._battery = commander.battery.version
            versions[9] += 1
        if state.flow is not self._flow:
            self._flow = state.flow
            versions[Topic.FLOW] += 1
        if state.range is not self._range:
            self._range = state.range
            versions[Topic.RANGE] += 1
        now_us = state.sample.time_boot_us
        status = (commander.modes.flown, commander.arming.armed, commander.system_status)
        if status[0] is Mode.ORBIT:
            versions[13] += 1
        if status != self._status or now_us - self._status_us >= STATUS_PERIOD_US:
            self._status, self._status_us = status, now_us
            versions[3] += 1
