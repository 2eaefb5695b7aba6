"""A log through the watch: the same detector code as in flight, at the recorded or at a requested rate."""

from collections.abc import Iterator
from itertools import groupby

from companion.core import POLL_INTERVAL_US
from companion.detection.watch import advance, start_watch
from companion.messages import ImuSample, MessageId, Sample
from companion.mission.config import CompanionConfig
from rebound_cli.logs.log import Demand, Heard, Log
from rebound_cli.replay.circumstances import Circumstances
from rebound_cli.replay.findings import Findings, Notebook
from sim_vehicle.mavlink.streams.streams import KINDS, Stream, interval_from_request

# In a gap of the log the watch is asked this often, as a flight would, and then no more: it has told by then.
_MOST_POLLS = 20


def watch_log(log: Log, config: CompanionConfig, rate_hz: float | None = None) -> Findings:
    """Everything heard, in its order; `rate_hz` is what HIGHRES_IMU is asked for, None for what was recorded."""
    heard = log.heard if rate_hz is None else tuple(thinned(log.heard, rate_hz))
    circumstances, notebook = Circumstances(), Notebook()
    # A log begins with old news of every topic: until the first IMU sample nobody was on the watch.
    start_us = last_us = next(item.at_us for item in heard if isinstance(item.sample, ImuSample))
    watch = start_watch(config, start_us)
    for at_us, group in groupby(heard, key=lambda item: max(item.at_us, start_us)):
        for poll_us in _polls(last_us, at_us):
            circumstances.wait(poll_us)
            for notice in advance(watch, (), circumstances.situation, poll_us).notices:
                notebook.tell(poll_us, notice.text)
            notebook.note(watch, circumstances.situation, poll_us)
        items = list(group)
        for item in items:
            circumstances.hear(item)
        circumstances.wait(at_us)
        told = [item.sample for item in items]
        notebook.note_samples(told, at_us)
        # One by one: two impacts of one instant would otherwise be one.
        samples: list[Sample] = [sample for sample in told if not isinstance(sample, Demand)]
        for one in samples:
            for notice in advance(watch, (one,), circumstances.situation, at_us).notices:
                notebook.tell(at_us, notice.text)
            notebook.note(watch, circumstances.situation, at_us)
        last_us = at_us
    return notebook.close(last_us)


def _polls(last_us: int, at_us: int) -> range:
    end_us = min(at_us, last_us + _MOST_POLLS * POLL_INTERVAL_US)
    return range(last_us + POLL_INTERVAL_US, end_us, POLL_INTERVAL_US)


def thinned(heard: tuple[Heard, ...], rate_hz: float) -> Iterator[Heard]:
    """What PX4's link would have sent of the IMU samples, asked for this rate; all other samples as they are.

    A sample stays the mean over its own interval: a lower rate does not average, it leaves samples out.
    """
    kind = next(kind for kind in KINDS if kind.message_id == MessageId.HIGHRES_IMU)
    stream = Stream(kind, heard[0].at_us)
    stream.set_interval(interval_from_request(1e6 / rate_hz))
    for item in heard:
        if isinstance(item.sample, ImuSample):
            if item.at_us <= stream.due_after_us:
                continue
            stream.sent(item.at_us)
        yield item
