"""A vehicle that is restarted while it is guarded: by its own reboot, on the ground."""

from dataclasses import replace

import pytest

from companion.guard.config import GuardConfig
from companion.guard.states import State
from companion.link.streams import StreamMonitor
from companion.reflex.detector import Phase
from tests.guard.attached_air import AttachedAir
from tests.guard.flying import EPOCH_US, Air

REBOOT = 246


def links(air: Air | AttachedAir) -> list[str]:
    return [event.text for event in air.events if event.kind == "link"]


@pytest.mark.slow
@pytest.mark.parametrize("attached", [False, True])
def test_a_vehicle_that_restarts_between_flights_is_asked_for_its_streams_again_and_guarded(attached):
    # Given a guard that stands by; the last thing it saw was a contact, in which the vehicle lost its power
    air = AttachedAir() if attached else Air()
    air.until(lambda: air.state is State.STANDING_BY, 10.0)
    core = air.guard.core
    assert core is not None
    core.monitor.state = replace(core.monitor.state, phase=Phase.CONTACT, last_loud_boot_us=10**12)
    # When the vehicle is restarted, and sends what it sends by default
    air.command(REBOOT, 1)
    air.until(lambda: air.state is State.CONNECTING, 8.0)
    assert links(air) == ["the vehicle was silent: its streams are asked for again"]
    # Then it is asked again, and its detector begins anew
    air.until(lambda: air.state is State.STANDING_BY, 30.0)
    rates = [event.data for event in air.events if event.kind == "streams"]
    assert len(rates) == 2 and rates[1]["HIGHRES_IMU"] == pytest.approx(250, abs=10)
    assert core.monitor.state.phase is not Phase.CONTACT
    if isinstance(air, AttachedAir):
        # And the next flight's hit is answered: this ends when the guard holds
        air.fly_into_the_wall()


def test_a_guard_that_waits_begins_where_nobody_is_or_a_vehicle_without_a_position():
    # Given a vehicle that is heard after a minute, and a computer that was up before it
    air = Air(GuardConfig.model_validate({"companion": {"link": {"wait": True}}}))
    for second in range(60):
        air.guard.step(b"", EPOCH_US - 60_000_000 + second * 1_000_000)
    core = air.guard.core
    assert core is not None and not air.guard.finished
    # And whose satellites are not there yet
    core.flight.streams.streams = tuple(
        replace(one, min_hz=1000.0) if one.message_id.name == "LOCAL_POSITION_NED" else one
        for one in core.flight.streams.streams
    )
    air.run(12.0)
    assert air.state is State.CONNECTING
    assert [text.partition(":")[0] for text in links(air)] == ["not guarded by now"]
    # Then it stands by once they are
    core.flight.streams.streams = StreamMonitor(core.flight.mission.companion.streams).streams
    air.until(lambda: air.state is State.STANDING_BY, 10.0)


@pytest.mark.slow
def test_a_vehicle_without_a_position_after_its_restart_is_asked_until_it_has_one(monkeypatch):
    air = AttachedAir()
    air.until(lambda: air.state is State.STANDING_BY, 10.0)
    # Given a vehicle that was restarted and waits for its satellites
    hear = air.guard.hear
    monkeypatch.setattr(
        air.guard, "hear", lambda name, *rest: hear("" if name == "LOCAL_POSITION_NED" else name, *rest)
    )
    air.command(REBOOT, 1)
    air.until(lambda: air.state is State.CONNECTING, 8.0)
    # When that takes some time, then it is told why nothing is guarded, once
    air.run(8.0)
    assert air.state is State.CONNECTING
    (told,) = links(air)[1:]
    assert told.startswith("not guarded by now: LOCAL_POSITION_NED arrives at 0.0 Hz")
    # And the guard goes on when it has found them
    monkeypatch.undo()
    air.until(lambda: air.state is State.STANDING_BY, 10.0)
