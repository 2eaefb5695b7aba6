"""Where the streams' contents come from, and how often each has been renewed: PX4's uORB topics, as counters."""

from enum import IntEnum

from sim_vehicle.estimator.samples import FlowSample, RangeSample
from sim_vehicle.mavlink.encode import Telemetry

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


# What a vehicle may not have: nothing is sent of it before there is something.
OPTIONAL = (Topic.FLOW, Topic.RANGE, Topic.TRUTH)


class Topics:
    """``versions[topic]`` grows whenever there is something new."""

    def __init__(self, state: Telemetry) -> None:
        self._state = state
        self.versions = [NEVER_SENT if topic in OPTIONAL else 0 for topic in Topic]
        self._flow: FlowSample | None = None
        self._range: RangeSample | None = None
        self._status: tuple[int, bool, int] | None = None
        self._status_us = state.sample.time_boot_us

    def count(self, new_position: bool) -> None:
        """Look at what this interval has brought; ``new_position``: the estimator has published."""
        versions = self.versions
        versions[0] += 1
        versions[1] += 1
        if new_position:
            versions[2] += 1
        state = self._state
        if state.flow is not self._flow:
            self._flow = state.flow
            versions[Topic.FLOW] += 1
        if state.range is not self._range:
            self._range = state.range
            versions[Topic.RANGE] += 1
        if state.true_body is not None:
            versions[Topic.TRUTH] += 1
        autopilot, now_us = state.autopilot, state.sample.time_boot_us
        status = (autopilot.modes.mode, autopilot.arming.armed, autopilot.system_status)
        if status != self._status or now_us - self._status_us >= STATUS_PERIOD_US:
            self._status, self._status_us = status, now_us
            versions[3] += 1
