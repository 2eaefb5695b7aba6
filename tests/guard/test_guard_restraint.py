"""When a guard is not to act, or not to go on: another's failsafe, a program that has died, no position, the ground."""

from companion.guard.config import GuardConfig
from companion.guard.states import State
from companion.mission.config import CompanionConfig
from companion.px4_mode import OFFBOARD
from tests.guard.attached_air import AttachedAir
from tests.guard.flying import MANUAL_POSITION, Air
from tests.guard.test_guard_flights import pilot, pushed_into_the_wall

RETURN_WITHOUT_STATION = {"NAV_DLL_ACT": 2.0, "COM_DL_LOSS_T": 5.0}
LOCAL_POSITION_NED = 32


def test_a_failsafe_that_flies_is_not_taken_over_from():
    """AUTO.RTL may be guarded; while a failsafe has chosen it, the vehicle's own judgement goes first."""
    air = Air(parameters=RETURN_WITHOUT_STATION)
    air.take_off()
    air._next_beat_s = float("inf")
    air.until(lambda: air.vehicle_mode() == "AUTO.RTL", 15.0)
    air.run(1.2)
    assert air.state is State.STANDING_BY
    assert "standing by: a failsafe flies" in air.told("standing_by")


def test_a_program_whose_setpoints_end_is_left_to_px4s_failsafe():
    """Setpoints of the guard's would keep the vehicle in the OFFBOARD of a program that has died."""
    air = AttachedAir()
    air.until(lambda: air.state is State.STANDING_BY, 10.0)
    air.run(2.0)
    air.command(400, 1)
    air.run(0.5)
    air.command(22)
    air.until(lambda: air.state is State.WATCHING, 20.0)
    air.run(3.0)
    air.set_velocity((0.0, 0.2, 0.0))
    air.run(0.3)
    air.set_mode(6)
    air.until(lambda: air.mode == OFFBOARD, 1.0)
    air.run(0.5)
    assert air.state is State.WATCHING
    air.set_velocity(None)
    ended_s = air.time_s
    air.until(lambda: air.mode != OFFBOARD, 3.0)
    assert air.setpoints("guard", ended_s) == []


def test_a_position_that_ends_while_the_guard_holds_has_the_vehicle_given_back_to_hold():
    air = Air(GuardConfig(then="previous"))
    stick = pushed_into_the_wall(air)
    stick[0] = 0.0
    air.until(lambda: air.state is State.RECOVERING, 1.0)
    hears = air.guard.step

    def without_position(received, now_us):
        kept = b""
        while received:
            size = 12 + received[1]
            kept += b"" if received[7] == LOCAL_POSITION_NED else received[:size]
            received = received[size:]
        return hears(kept, now_us)

    air.guard.step = without_position
    began_s = air.time_s
    air.until(lambda: air.state is State.GIVING_BACK, 2.0)
    silence_s = CompanionConfig().link.position_silence_s
    assert abs(air.time_s - began_s - silence_s) < 0.1
    air.until(lambda: air.vehicle_mode() == "AUTO.LOITER", 1.0)
    assert "no LOCAL_POSITION_NED" in air.told("link")[0]


def test_below_the_height_of_the_ground_nothing_is_a_hit():
    air = Air(GuardConfig(companion=CompanionConfig(min_detection_height_m=4.0)))
    stick = pilot(air)
    air.take_off()
    air.mode(MANUAL_POSITION)
    air.until(lambda: air.vehicle_mode() == "POSCTL", 2.0)
    stick[0] = 0.3
    air.until(lambda: air.position()[0] > 3.6, 20.0)
    air.run(1.0)
    assert air.state is State.WATCHING and air.told("detection") == []


def test_a_com_of_loss_t_that_is_longer_than_a_setpoint_is_safe_is_told():
    air = Air(parameters={"COM_OF_LOSS_T": 3.0})
    air.run(5.0)
    assert any("COM_OF_LOSS_T is 3 s" in text for text in air.told("unattended"))
