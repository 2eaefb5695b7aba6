"""A ground station's side of the mission protocol, and a wire that loses, repeats and reorders packets."""

import random
from dataclasses import dataclass, field

from sim_vehicle.autopilot.mission_protocol import mission_items as commands
from sim_vehicle.autopilot.mission_protocol import mission_messages as wire
from sim_vehicle.autopilot.mission_protocol.mission_messages import MissionPeer, MissionResult, MissionType, WireItem
from sim_vehicle.autopilot.mission_protocol.mission_store import MissionStore
from sim_vehicle.autopilot.mission_protocol.mission_transfer import MissionTransfer

CLIENT = MissionPeer(245, 190)
STEP_US = 4_000
# MAVSDK asks again after half a second.
CLIENT_RETRY_US = 500_000


def wire_item(number: int, command: int = commands.WAYPOINT, **fields: object) -> WireItem:
    """A waypoint north of home, 10 m up, in MISSION_ITEM_INT."""
    values: dict[str, object] = {
        "number": number,
        "frame": commands.FRAME_GLOBAL_RELATIVE_INT,
        "command": command,
        "current": number == 0,
        "autocontinue": 1,
        "params": (0.0, 0.0, 0.0, 0.0),
        "x": 473_977_420 + 100 * number,
        "y": 85_455_940,
        "z": 10.0,
        "is_int": True,
    }
    return WireItem(**{**values, **fields})  # type: ignore[arg-type]


@dataclass
class Wire:
    """One direction: packets in, the same, some or more of them out, up to 40 ms later."""

    random: random.Random
    loss: float = 0.0
    repeat: float = 0.0
    latest_us: int = 0
    waiting: list[tuple[int, int, object]] = field(default_factory=list)
    count: int = 0

    def put(self, message: object, now_us: int) -> None:
        copies = 2 if self.random.random() < self.repeat else 1
        for _ in range(copies):
            if self.random.random() >= self.loss:
                self.count += 1
                self.waiting.append((now_us + self.random.randrange(self.latest_us + 1), self.count, message))

    def take(self, now_us: int) -> list[object]:
        due = sorted(entry[:2] for entry in self.waiting if entry[0] <= now_us)
        messages = [next(entry[2] for entry in self.waiting if entry[:2] == key) for key in due]
        self.waiting = [entry for entry in self.waiting if entry[0] > now_us]
        return messages


@dataclass
class Exchange:
    """Client and vehicle with a wire each way, in virtual time."""

    store: MissionStore = field(default_factory=MissionStore)
    seed: int = 0
    loss: float = 0.0
    repeat: float = 0.0
    latest_us: int = 0

    def __post_init__(self) -> None:
        source = random.Random(self.seed)
        self.transfer = MissionTransfer(self.store)
        self.there = Wire(source, self.loss, self.repeat, self.latest_us)
        self.back = Wire(source, self.loss, self.repeat, self.latest_us)
        self.now_us = 1_000_000

    def step(self) -> list[object]:
        self.now_us += STEP_US
        for message in self.there.take(self.now_us):
            for answer in self.transfer.receive(message, self.now_us):  # type: ignore[arg-type]
                self.back.put(answer, self.now_us)
        for answer in self.transfer.update(self.now_us):
            self.back.put(answer, self.now_us)
        return self.back.take(self.now_us)

    def ask(self, message: object) -> list[object]:
        """One message and what comes back at once."""
        self.there.put(message, self.now_us)
        return self.step()

    def upload(self, items: list[WireItem], kind: MissionType = MissionType.MISSION, within_s: float = 60.0) -> int:
        """The result that the client gets in the end."""
        said: object = wire.Count(CLIENT, len(items), kind)
        self.there.put(said, self.now_us)
        said_us = end_us = self.now_us
        end_us += round(1e6 * within_s)
        while self.now_us < end_us:
            for answer in self.step():
                if isinstance(answer, wire.SendAck) and answer.peer == CLIENT:
                    return answer.result
                if isinstance(answer, wire.SendRequest) and answer.number < len(items):
                    said, said_us = wire.SentItem(CLIENT, items[answer.number], kind), self.now_us
                    self.there.put(said, self.now_us)
            if self.now_us - said_us > CLIENT_RETRY_US:
                said_us = self.now_us
                self.there.put(said, self.now_us)
        raise AssertionError("no acknowledgement came")

    def download(self, kind: MissionType = MissionType.MISSION, within_s: float = 60.0) -> list[wire.SendItem]:
        """The items that the client has in the end, in their order."""
        said: object = wire.RequestList(CLIENT, kind)
        self.there.put(said, self.now_us)
        said_us, count, items = self.now_us, None, {}
        end_us = self.now_us + round(1e6 * within_s)
        while self.now_us < end_us:
            for answer in self.step():
                if isinstance(answer, wire.SendAck):
                    raise AssertionError(f"refused: {answer}")
                if isinstance(answer, wire.SendCount):
                    count = answer.count if count is None else count
                elif isinstance(answer, wire.SendItem) and answer.number == len(items):
                    items[answer.number] = answer
                else:
                    continue
                if len(items) == count:
                    self.there.put(wire.Ack(CLIENT, MissionResult.ACCEPTED, kind), self.now_us)
                    return [items[number] for number in range(count)]
                said, said_us = wire.RequestItem(CLIENT, len(items), kind, True), self.now_us
                self.there.put(said, self.now_us)
            if self.now_us - said_us > CLIENT_RETRY_US:
                said_us = self.now_us
                self.there.put(said, self.now_us)
        raise AssertionError("the download did not end")
