"""The mission protocol: every message in every state, and lists that survive a wire that loses and repeats."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import development as dialect

from sim_vehicle.autopilot.mission_protocol import mission_items as commands
from sim_vehicle.autopilot.mission_protocol.mission_items import MissionType
from sim_vehicle.autopilot.mission_protocol.mission_store import MissionStore
from sim_vehicle.faults.spec import WireFault
from sim_vehicle.faults.wire import Wire
from sim_vehicle.mavlink.services.mission_transfer import RETRY_US, TIMEOUT_US, MissionTransfer, TransferState
from sim_vehicle.mavlink.services.mission_wire import MissionResult

MISSION = MissionType.MISSION
CLIENT, STRANGER = (245, 190), (246, 190)
STEP_US = 4_000
# MAVSDK asks again after half a second.
CLIENT_RETRY_US = 500_000


def wire_item(
    number, command=commands.WAYPOINT, kind=MISSION, frame=commands.FRAME_GLOBAL_RELATIVE_INT, params=(0.0,) * 4
):
    """A waypoint north of home, 10 m up, in MISSION_ITEM_INT."""
    place = (473_977_420 + 100 * number, 85_455_940, 10.0)
    return said("item_int", number, frame, command, int(number == 0), 1, *params, *place, kind)


def sent(message, peer=CLIENT):
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
        board: Any = SimpleNamespace(autopilot=SimpleNamespace(missions=self.store))
        self.transfer = MissionTransfer(self.link, board)

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
        (told,) = of_type(self.ask(said("request_list", MissionType.MISSION)), "MISSION_COUNT")
        asked = (said("request_int", number, MissionType.MISSION) for number in range(told.count))
        items = [of_type(self.ask(each), "MISSION_ITEM_INT")[0] for each in asked]
        self.ask(said("ack", MissionResult.ACCEPTED, MissionType.MISSION))
        return items


SQUARE = [wire_item(0, commands.TAKEOFF), wire_item(1), wire_item(2), wire_item(3, commands.LAND)]


def receiving() -> Exchange:
    exchange = Exchange()
    exchange.ask(said("count", 3, MISSION))
    assert exchange.transfer.state is TransferState.RECEIVING
    return exchange


def sending() -> Exchange:
    exchange = Exchange()
    assert exchange.upload(SQUARE) == MissionResult.ACCEPTED
    exchange.ask(said("request_list", MISSION))
    assert exchange.transfer.state is TransferState.SENDING
    return exchange


def test_an_uploaded_list_comes_back_as_it_went():
    exchange = Exchange()
    assert exchange.upload(SQUARE) == MissionResult.ACCEPTED
    # The last acknowledgement is given again
    acks = exchange.ask(sent(SQUARE[3]))
    assert MissionResult.ACCEPTED in [ack.type for ack in of_type(acks, "MISSION_ACK")]
    (ack,) = exchange.ask(sent(SQUARE[1]))
    assert ack.type == MissionResult.ERROR
    # Cancelling the next upload frees the vehicle and keeps the list
    exchange.ask(said("count", 2, MISSION))
    exchange.ask(said("ack", MissionResult.CANCELLED, MISSION))
    assert exchange.transfer.state is TransferState.IDLE and not exchange.store.uploading
    assert len(exchange.store.mission) == 4
    back = exchange.download()
    assert [(item.seq, item.command) for item in back] == [(0, 22), (1, 16), (2, 16), (3, 21)]
    assert [item.x for item in back] == [wire_item(n).x for n in range(4)]
    assert [item.current for item in back] == [1, 0, 0, 0]


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    loss=st.floats(0.0, 0.4),
    repeat=st.floats(0.0, 0.4),
    latest_us=st.sampled_from([0, 12_000, 40_000]),
    count=st.integers(1, 8),
)
def test_lists_survive_loss_repetition_and_reordering(seed, loss, repeat, latest_us, count):
    # Given a link of up to 40 % loss, on which packets come twice and out of order
    exchange = Exchange(seed=seed, loss=loss, repeat=repeat, latest_us=latest_us)
    items = [wire_item(number) for number in range(count)]
    # When a client uploads, however often it takes
    results = []
    while MissionResult.ACCEPTED not in results:
        results.append(exchange.upload(items, within_s=120.0))
        assert len(results) < 200
        # No client begins anew while packets of its last attempt are on their way
        for _ in range(25):
            exchange.step()
    # Then the vehicle holds exactly that list, never parts of it
    stored = exchange.store.mission
    assert [round(1e7 * item.place.latitude_deg) for item in stored] == [item.x for item in items]


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_no_message_in_any_order_breaks_it_or_leaves_half_a_list(data):
    exchange = Exchange()
    exchange.upload(SQUARE)
    before = exchange.store.mission
    peers, kinds = st.sampled_from([CLIENT, STRANGER]), st.sampled_from([0, 1, 2, 7])
    for _ in range(data.draw(st.integers(1, 12))):
        peer, kind, number = data.draw(peers), data.draw(kinds), data.draw(st.integers(0, 5))
        message = data.draw(
            st.sampled_from(
                [
                    said("request_list", kind, peer=peer),
                    said("request_int", number, kind, peer=peer),
                    said("count", number + 1, kind, peer=peer),
                    sent(wire_item(number, kind=kind), peer),
                    said("ack", number, kind, peer=peer),
                    said("set_current", number, peer=peer),
                ]
            )
        )
        exchange.ask(message)
    plan = exchange.store.mission
    assert plan == before or len(plan) == len({item.place.latitude_deg for item in plan})
    # And once everybody is silent, it is free again
    exchange.link.now_us += TIMEOUT_US + RETRY_US
    exchange.step()
    exchange.step()
    assert exchange.transfer.state is TransferState.IDLE and not exchange.store.uploading


@pytest.mark.parametrize(
    ("item", "result"),
    [
        (wire_item(0, frame=1), MissionResult.UNSUPPORTED_FRAME),
        (wire_item(0, command=82), MissionResult.UNSUPPORTED),
        (wire_item(0, commands.DO_CHANGE_SPEED), MissionResult.UNSUPPORTED),
        (wire_item(0, commands.WAYPOINT, frame=commands.FRAME_MISSION), MissionResult.UNSUPPORTED),
        (wire_item(0, commands.RALLY_POINT), MissionResult.ERROR),
        (wire_item(0, commands.FENCE_CIRCLE_INCLUSION), MissionResult.ERROR),
    ],
)
def test_items_that_px4_refuses(item, result):
    exchange = Exchange()
    assert exchange.upload([item]) == result
    assert exchange.store.mission == () and exchange.transfer.state is TransferState.IDLE


def test_a_fence_has_three_corners_at_least():
    for corners, result in ((2, MissionResult.ERROR), (3, MissionResult.ACCEPTED)):
        fence = [wire_item(i, commands.FENCE_POLYGON_INCLUSION, params=(corners, 0, 0, 0)) for i in range(corners)]
        assert Exchange().upload(fence, MissionType.FENCE) == result


@pytest.mark.parametrize(
    ("sent", "stored"),
    [
        (wire_item(0, params=(5.0, 2.0, 3.0, -90.0)), (5.0, 2.0, 0.0, 270.0)),
        (wire_item(0, commands.LOITER_TIME, params=(5.0, 2.0, 3.0, 4.0)), (5.0, 1.0, 3.0, 1.0)),
        (wire_item(0, commands.LAND, params=(1.0, 0.0, 3.0, 10.0)), (0.0, 0.0, 0.0, 10.0)),
        (wire_item(0, commands.DO_CHANGE_SPEED, frame=2, params=(2.0, 3.0, 0.0, 0.0)), (2.0, 3.0, 0.0, 0.0)),
    ],
)
def test_what_px4_keeps_of_an_items_parameters(sent, stored):
    exchange = Exchange()
    assert exchange.upload([sent]) == MissionResult.ACCEPTED
    assert exchange.store.mission[0].params[:4] == pytest.approx(stored)


def test_a_count_of_nothing_clears_and_so_does_clear_all():
    for message in (said("count", 0, MISSION), said("clear_all", MISSION), said("clear_all", 255)):
        exchange = Exchange()
        exchange.upload(SQUARE)
        changes = exchange.store.mission_changes
        acks = of_type(exchange.ask(message), "MISSION_ACK")
        assert [ack.type for ack in acks] == [MissionResult.ACCEPTED]
        assert exchange.store.mission == () and exchange.store.mission_changes > changes


@pytest.mark.parametrize("begin", [receiving, sending])
def test_silence_ends_a_transfer_after_five_seconds(begin):
    exchange = begin()
    if begin is sending:
        exchange.ask(said("request_int", 0, MISSION))
    start_us = exchange.now_us
    while exchange.transfer.state is not TransferState.IDLE:
        exchange.step()
    assert exchange.now_us - start_us == pytest.approx(TIMEOUT_US, abs=2 * STEP_US)
    assert exchange.upload(SQUARE) == MissionResult.ACCEPTED


@pytest.mark.parametrize(
    ("begin", "message"),
    [
        (receiving, said("clear_all", MISSION)),
        (receiving, sent(wire_item(0), STRANGER)),
        (receiving, said("ack", MissionResult.CANCELLED, MISSION, peer=STRANGER)),
        (sending, said("count", 2, MISSION)),
        (sending, said("request_list", MISSION, peer=STRANGER)),
        (sending, said("request_int", 0, MISSION, peer=STRANGER)),
        (sending, said("ack", 0, MISSION, peer=STRANGER)),
        (sending, said("clear_all", MISSION)),
    ],
)
def test_a_transfer_is_not_disturbed(begin, message):
    exchange = begin()
    state, items = exchange.transfer.state, exchange.store.mission
    exchange.ask(message)
    assert (exchange.transfer.state, exchange.store.mission) == (state, items)
    assert exchange.transfer._next == 0


def test_only_one_link_receives_at_a_time():
    first = receiving()
    second = Exchange(first.store)
    ack = second.ask(said("count", 2, MISSION, peer=STRANGER))[0]
    assert ack.type == MissionResult.ERROR
    # And the other link still gets its list
    assert first.upload([wire_item(0), wire_item(1), wire_item(2)]) == MissionResult.ACCEPTED
