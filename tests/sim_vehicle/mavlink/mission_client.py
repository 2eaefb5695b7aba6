"""A ground station's side of the mission protocol, and a wire that loses, repeats and reorders packets."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.mission_protocol import mission_items as commands
from sim_vehicle.autopilot.mission_protocol.mission_items import MissionType
from sim_vehicle.autopilot.mission_protocol.mission_store import MissionStore
from sim_vehicle.faults.spec import WireFault
from sim_vehicle.faults.wire import Wire
from sim_vehicle.mavlink.services.mission_transfer import MissionTransfer
from sim_vehicle.mavlink.services.mission_wire import MissionResult

CLIENT, STRANGER = (245, 190), (246, 190)
STEP_US = 4_000
# MAVSDK asks again after half a second.
CLIENT_RETRY_US = 500_000


def wire_item(number, command=commands.WAYPOINT, kind=MissionType.MISSION, **fields):
    """A waypoint north of home, 10 m up, in MISSION_ITEM_INT."""
    params = fields.pop("params", (0.0, 0.0, 0.0, 0.0))
    values = {
        "frame": commands.FRAME_GLOBAL_RELATIVE_INT,
        "current": int(number == 0),
        "autocontinue": 1,
        "x": 473_977_420 + 100 * number,
        "y": 85_455_940,
        "z": 10.0,
        **fields,
    }
    frame, current, autocontinue, *place = values.values()
    return sent(
        dialect.MAVLink_mission_item_int_message(
            1, 1, number, frame, command, current, autocontinue, *params, *place, kind
        )
    )


def sent(message, peer=CLIENT):
    """The message as it comes from that peer."""
    message._header.srcSystem, message._header.srcComponent = peer
    return message


def said(name, *fields, peer=CLIENT):
    """A message of the protocol, MISSION_..., to the vehicle."""
    return sent(getattr(dialect, f"MAVLink_mission_{name}_message")(1, 1, *fields), peer)


def of_type(answers, *types):
    return [answer for answer in answers if answer.get_type() in types]


@dataclass
class Exchange:
    """Client and vehicle with a bad wire each way, in virtual time."""

    store: MissionStore = field(default_factory=MissionStore)
    seed: int = 0
    loss: float = 0.0
    repeat: float = 0.0
    latest_us: int = 0

    def __post_init__(self) -> None:
        late = {"reorder": 0.5, "reorder_by_s": 1e-6 * self.latest_us} if self.latest_us else {}
        bad = {"loss": self.loss, "duplicate": self.repeat, **late}
        faults = [WireFault(kind="wire", at_s=0, **bad)] if any(bad.values()) else []
        self.there, self.back = (Wire(faults, seed) for seed in (self.seed, ~self.seed))
        self.asked: list[Any] = []
        self.answers: list[Any] = []
        self.link = SimpleNamespace(send=self.answers.append, now_us=1_000_000)
        self.transfer = MissionTransfer(self.store, self.link)

    @property
    def now_us(self) -> int:
        return self.link.now_us

    def step(self) -> list[Any]:
        self.link.now_us += STEP_US
        arrived = self.there.carry(self.asked, self.now_us)
        self.asked.clear()
        for message in arrived:
            self.transfer.receive(message)
        self.transfer.update(self.now_us)
        back = self.back.carry(self.answers, self.now_us)
        self.answers.clear()
        return list(back)

    def ask(self, message: object) -> list:
        """One message and what comes back at once."""
        self.asked.append(message)
        return self.step()

    def upload(self, items, kind=MissionType.MISSION, within_s: float = 60.0) -> int:
        """The result that the client gets in the end."""
        asked = said("count", len(items), kind)
        self.asked.append(asked)
        asked_us = end_us = self.now_us
        end_us += round(1e6 * within_s)
        while self.now_us < end_us:
            for answer in self.step():
                if answer.get_type() == "MISSION_ACK" and answer.target_system == CLIENT[0]:
                    return answer.type
                if answer.get_type().startswith("MISSION_REQUEST") and answer.seq < len(items):
                    asked, asked_us = items[answer.seq], self.now_us
                    asked.mission_type = kind
                    self.asked.append(asked)
            if self.now_us - asked_us > CLIENT_RETRY_US:
                asked_us = self.now_us
                self.asked.append(asked)
        raise AssertionError("no acknowledgement came")

    def download(self):
        """The items that the client gets, in their order."""
        (told,) = of_type(self.ask(said("request_list", MissionType.MISSION)), "MISSION_COUNT")
        asked = (said("request_int", number, MissionType.MISSION) for number in range(told.count))
        items = [of_type(self.ask(each), "MISSION_ITEM_INT")[0] for each in asked]
        self.ask(said("ack", MissionResult.ACCEPTED, MissionType.MISSION))
        return items
