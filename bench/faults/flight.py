"""One flight into a wall with a fault, through the loop of real flights in virtual time, and what became of it."""

import json
import math
import os
import random
import shutil
import tempfile
import traceback
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.campaign.plan import Json
from bench.faults.air import Air, Branched, Hung, Injector, Killed, Landing
from bench.faults.fault import COMPLETED, FAILED, HANDED_OVER, KILLED, Fault
from bench.faults.injectors import Rewritten
from bench.random_missions.crashes import AIRBORNE_M, crashes, heights_m, tilts_deg
from bench.random_missions.flight import JudgedFlight
from bench.random_missions.generator import AIRFRAMES
from companion.companion import Companion, StepResult
from companion.mission.model import Mission
from companion.shell.tlog import may_be_logged, read_tlog
from rebound_cli.background import Background
from rebound_cli.inputs import resolved, with_guards
from rebound_cli.live.interrupts import Interrupts
from rebound_cli.live.realtime import ConfirmAtOnce, FlightFaultError, Loop, fly_realtime
from rebound_cli.replay.recording import read_recording, reproduce
from rebound_cli.results import run_folder
from rebound_cli.results.run_folder import FlightRecorder
from rebound_cli.results.truth_match import FlightTruth
from rebound_cli.simulation.lockstep import EPOCH_US
from sim_vehicle.airframe import load_built_in
from sim_vehicle.bench.changeable import ChangeableVehicle
from sim_vehicle.scene import Scene
from sim_vehicle.truth import Hit

SPEEDS_M_S, MOST_SLANT_DEG = (1.0, 2.0), 30.0
HEIGHT_M, WALL_M = 1.0, 2.0
# The mission takes 20 s; links that are cut are given up after some seconds.
LIMIT_S = 60.0
# What an aborted flight leaves hovers, or comes down by itself from this height within 12 s.
LEFT_ALONE_S, KILLED_FOR_S = 1.5, 12.0
# The slowest hit that a detector's bars promise to find.
NOTICED_M_S = 0.5
# From the touch to the event: a contact of 0.12 s, the slowest stream's 50 ms, and a link that holds packets back.
FOUND_WITHIN_S = 0.5
# A bounce of the same touch.
SAME_TOUCH_S = 0.25
STANDS_M = 0.03
# So many flights of each row end on the ground; of the others the vehicle's own landing is not waited for.
TO_THE_GROUND = 1
# A flight decided again costs as much as flown: only the first of each row is.
DECIDED_AGAIN = 1
CLIPPED_PART = 0.001


class Noting(FlightRecorder):
    """Keeps the vehicle's time of every event: the companion's own clock may be what is wrong."""

    def __init__(self, folder: Path, writer: Background | None, air: Air) -> None:
        super().__init__(folder, writer)
        self.folder, self._air = folder, air
        self.told_s: list[float] = []
        self.counted = 0

    def record(self, now_us: int, result: StepResult) -> None:
        self.told_s += [self._air.now_s] * len(result.events)
        self.counted += sum(map(may_be_logged, result.received_frames)) + len(result.sent_frames)
        super().record(now_us, result)

    def move_to(self, folder: Path, writer: Background | None) -> None:
        """Go on in a copy of the folder, as only a process that was forked may."""
        shutil.copytree(self.folder, folder, dirs_exist_ok=True)
        for file, name in (
            (self._tlog._file, run_folder.TLOG_NAME),
            (self._events_file, run_folder.EVENTS_NAME),
            (self._inputs_file, run_folder.INPUTS_NAME),
        ):
            descriptor = os.open(folder / name, os.O_WRONLY | os.O_APPEND)
            os.dup2(descriptor, file.fileno())
            os.close(descriptor)
        self.folder = self._folder = folder
        if writer is not None:
            self.writer, self._do = writer, writer.give


def mission_of(number: int) -> Mission:
    """Up, into a wall that nobody knows of, and down."""
    chance = random.Random(number)
    speed, slant = round(chance.uniform(*SPEEDS_M_S), 2), math.radians(chance.uniform(-MOST_SLANT_DEG, MOST_SLANT_DEG))
    go_to = {"position_ned_m": [7, 0, -HEIGHT_M], "speed_m_s": speed, "acceleration_m_s2": 2.0}
    wall = {
        "point_ned_m": [WALL_M, 0, -2.5],
        "normal_ned": [-math.cos(slant), -math.sin(slant), 0],
        "width_m": 20,
        "height_m": 5,
    }
    data: dict[str, Any] = {
        "name": "faults",
        "items": [{"takeoff": {"height_m": HEIGHT_M}}, {"go_to": go_to}, {"land": {}}],
        "on_collision": {"then": "land"},
        "on_interrupt": "hold",
        "fence": {"radius_m": 12, "max_height_m": 4},
        "companion": {"streams": {"window_s": 0.5}},
        "sim": {"walls": [wall], "airframe": AIRFRAMES[number % 2], "seed": 1 + number},
    }
    return Mission.model_validate(with_guards(data, load_built_in(AIRFRAMES[number % 2])))


def fly(number: int, fault: Fault) -> Json:
    """One flight of a fault from its take-off."""
    with tempfile.TemporaryDirectory() as name:
        return _Flight(number, fault, Path(name)).flown()


def fly_from_one_take_off(number: int, faults: Sequence[Fault], take: Callable[[str, Json], object]) -> None:
    """The same flight up to its first item, and from there on once with each fault, in a process each.

    `take` is given each fault's name and what became of its flight.
    """
    with tempfile.TemporaryDirectory() as name:
        _Flight(number, Fault("none", "link", "", lambda _: Injector()), Path(name)).branched(faults, take)


class _Flight:
    def __init__(self, number: int, fault: Fault, folder: Path) -> None:
        self.number, self.fault = number, fault
        self.mission = mission_of(number)
        scene = Scene.model_validate(self.mission.sim or {})
        self.airframe = load_built_in(scene.airframe)
        self.injector = fault.inject(self._chance())
        vehicle = ChangeableVehicle(self.airframe, scene, scene.seed, 0, {})
        self.interrupts, self.companion = Interrupts(), Companion(self.mission)
        self.air = Air(vehicle, self.companion, self.interrupts, self.injector, self._chance(), LIMIT_S)
        self.air.to_the_ground = number < TO_THE_GROUND
        self._begin()
        self.fault_text, self.ended = "", ""
        run_folder.write_yaml(folder / run_folder.RESOLVED_NAME, resolved(self.mission, None))
        run_folder.write_json(folder / run_folder.VERSIONS_NAME, {})
        run_folder.write_json(folder / run_folder.SUMMARY_NAME, {})
        self.recorder = Noting(folder, self.injector.writer(), self.air)

    def _chance(self) -> random.Random:
        return random.Random(f"{self.fault.name} {self.number}")

    def branched(self, faults: Sequence[Fault], take: Callable[[str, Json], object]) -> None:
        """Fly to the first item; then each fault's flight is a child of this process."""
        writes: int | None = None

        def branch() -> None:
            nonlocal writes
            for fault in faults:
                reads, writes = os.pipe()
                child = os.fork()
                if child == 0:
                    os.close(reads)
                    self._become(fault)
                    return
                os.close(writes)
                with os.fdopen(reads) as pipe:
                    text = pipe.read()
                os.waitpid(child, 0)
                take(fault.name, json.loads(text or '{"complaints": ["the flight broke off"]}'))
            raise Branched

        self.air.branch = branch
        try:
            self._fly()
            result = self._judged()
        except Branched:
            return
        except BaseException:
            result = {"complaints": [traceback.format_exc()], "outcome": "broken"}
        assert writes is not None, "only a child gets here"
        with os.fdopen(writes, "w") as pipe:
            pipe.write(json.dumps(result))
        shutil.rmtree(self.recorder.folder, ignore_errors=True)
        os._exit(0)

    def _become(self, fault: Fault) -> None:
        """From here on this is a flight with that fault."""
        self.fault = fault
        self.injector = self.air.injector = fault.inject(self._chance())
        self.air.chance = self._chance()
        self.recorder.move_to(Path(tempfile.mkdtemp()), self.injector.writer())
        self._begin()

    def _begin(self) -> None:
        vehicle = self.air.vehicle
        if not self.fault.expected.has_wall:
            vehicle.remove(vehicle.obstacles)
        self.injector.begin(self.air)

    def flown(self) -> Json:
        self._fly()
        return self._judged()

    def _fly(self) -> None:
        air, console = self.air, self.injector.console()
        try:
            loop = Loop(self.companion, air, _clock(air), self.recorder, console, self.interrupts)
            fly_realtime(self.companion, loop, ConfirmAtOnce())
        except FlightFaultError as error:
            self.fault_text = str(error)
        except (Killed, Hung, Landing) as end:
            self.ended = {Killed: KILLED, Hung: "hung", Landing: COMPLETED}[type(end)]
        self.injector.end()
        self.killed_at_s = air.now_s
        air.alone({KILLED: KILLED_FOR_S, COMPLETED: 0.0}.get(self.ended, LEFT_ALONE_S))
        if self.ended == KILLED:
            # What a killed process had in memory is gone; what it had given to the system is not.
            self.recorder._tlog._pending.clear()
        self.recorder.close()

    # --- judging

    def _judged(self) -> Json:
        flown, expected = self._flown(), self.fault.expected
        touches = [hit for hit in flown.truth.hits if hit.closing_speed_m_s >= 0.0]
        told_s = [at for at, event in zip(self.recorder.told_s, flown.events, strict=True) if event.kind == "detection"]
        first = next((hit for hit in touches if hit.closing_speed_m_s >= NOTICED_M_S), None)
        blind_until_us = self._blind_until_us(first)
        unseen = blind_until_us is not None
        if first is not None and blind_until_us is not None:
            touches.append(replace(first, ended_at_boot_us=max(first.ended_at_boot_us, blind_until_us)))
        is_found = first is not None and any(_is_of(first, at_s) for at_s in told_s)
        beside = [at_s for at_s in told_s if not any(_is_of(hit, at_s) for hit in touches) and self._is_up(flown, at_s)]
        counted_false = max(0, len(beside) - flown.report.unconfirmed)
        outcome = self.ended or flown.report.outcome
        again = [hit.closing_speed_m_s for hit in touches if first is not None and _is_later(hit, first)]
        complaints = [f"{cause}: {details}" for cause, details in crashes(flown) if self._counts(cause) and not unseen]
        complaints += [f"setpoint outside: {self.air.outside[0]}"] if self.air.outside else []
        complaints += self._authority() + self._log()
        outcomes = (*expected.outcomes, HANDED_OVER) if unseen else expected.outcomes
        complaints += [f"{outcome}: {flown.report.reason}"] if outcome not in outcomes else []
        complaints += ["hit not found"] if expected.finds and first is not None and not is_found else []
        complaints += [f"{counted_false} false hits counted"] if counted_false > expected.false_hits else []
        if self.fault_text and FAILED not in expected.outcomes:
            complaints.append(self.fault_text)
        return {
            "complaints": complaints,
            "outcome": outcome,
            "hit": first is not None,
            "found": is_found,
            "unseen": unseen,
            "false": counted_false,
            "unconfirmed": flown.report.unconfirmed,
            "tilt_deg": round(float(tilts_deg(flown.truth.series["attitude_wxyz"]).max()), 1),
            "ground_m_s": self._ground_m_s(flown),
            "again_m_s": round(max(again, default=0.0), 2),
            "after_told": self.air.after_told,
        }

    def _blind_until_us(self, hit: Hit | None) -> float | None:
        """When the fault's end lets a hit be seen that it hid; None for one that it did not hide."""
        if hit is None or not self.fault.expected.blinds:
            return None
        assert isinstance(self.injector, Rewritten), "what hides a hit rewrites the sensor's messages"
        when = self.injector.when
        return 1e6 * when.ended_s(self.air) if when.is_on_at(self.air, 1e-6 * hit.contact_at_boot_us) else None

    def _counts(self, cause: str) -> bool:
        """A landing that PX4 or a pilot flies may come at any time."""
        return cause != "touched the ground" or not self.air.has_left_offboard

    def _flown(self) -> JudgedFlight:
        truth = self.air.vehicle.truth
        # By the vehicle's clock, whatever the companion's showed.
        events = [
            replace(event, time_us=round(EPOCH_US + at_s * 1e6))
            for event, at_s in zip(self.recorder.events, self.recorder.told_s, strict=True)
        ]
        frame, scene = self.airframe.geometry, Scene.model_validate(self.mission.sim or {})
        return JudgedFlight(
            self.mission,
            self.companion.report(),
            events,
            FlightTruth(truth.hits, truth.series(), EPOCH_US, truth.faults),
            standing_m=frame.foot_depth_m,
            arm_m=frame.motor_radius_m,
            guard_m=frame.guard_radius_m,
            obstacles={obstacle.name: obstacle for _, obstacle in scene.obstacles()},
        )

    def _authority(self) -> list[str]:
        air = self.air
        found = [f"{air.after_told} setpoints or commands after the pilot was heard"] if air.after_told else []
        return found + (["the pilot was overruled"] if air.is_overruled else [])

    def _log(self) -> list[str]:
        """Whether the log can be read, is whole, and is decided again to the bit."""
        if self.recorder.writer is not None and self.recorder.writer.loss is not None:
            # A disk that takes nothing has no log; that it is told is the row's own affair.
            is_told = any(event.kind == "lost" for event in self.recorder.events)
            return [] if is_told else ["nobody was told of the log's gaps"]
        events = (self.recorder.folder / run_folder.EVENTS_NAME).read_text(encoding="utf-8").splitlines()
        if len(events) != len(self.recorder.events):
            return [f"log lost: {len(self.recorder.events) - len(events)} events"]
        stamps = [stamp for stamp, _ in read_tlog(self.recorder.folder / run_folder.TLOG_NAME)]
        if self.ended == KILLED:
            # TlogWriter hands on twice a second.
            late_s = self.killed_at_s - (stamps[-1] - EPOCH_US) * 1e-6
            return [f"log lost: the last {late_s:.1f} s"] if late_s > 0.6 else []
        # Noise that looks like a header may hide the packet after it from who reads the file.
        if abs(len(stamps) - self.recorder.counted) > self.recorder.counted * CLIPPED_PART:
            return [f"log lost: {self.recorder.counted - len(stamps)} of {self.recorder.counted} packets"]
        if self.number < DECIDED_AGAIN and not self.fault_text and self._is_reproducible():
            difference = reproduce(read_recording(self.recorder.folder)).first_difference
            return [] if difference is None else [f"decided otherwise from the log: {difference}"]
        return []

    def _is_reproducible(self) -> bool:
        """A fault inside the program is in no log."""
        return not any(event.kind == "fault" for event in self.recorder.events)

    def _is_up(self, flown: JudgedFlight, at_s: float) -> bool:
        """Whether the vehicle is off the ground then."""
        time_us = flown.truth.series["time_boot_us"]
        index = min(int(np.searchsorted(time_us, at_s * 1e6)), len(time_us) - 1)
        return bool(heights_m(flown)[index] > STANDS_M)

    @staticmethod
    def _ground_m_s(flown: JudgedFlight) -> float | None:
        """Speed down at the first touch of the ground; None where it stays up."""
        height_m = heights_m(flown)
        airborne = np.flatnonzero(height_m > AIRBORNE_M)
        if not len(airborne):
            return None
        touching = np.flatnonzero(height_m[airborne[0] :] < STANDS_M)
        if not len(touching):
            return None
        return round(float(flown.truth.series["velocity_ned_m_s"][airborne[0] + touching[0], 2]), 2)


def _clock(air: Air) -> Any:
    """The air is the clock, too."""
    return air


def _is_of(hit: Hit, at_s: float) -> bool:
    return at_s - 1e-6 * hit.contact_at_boot_us >= 0.0 and at_s - 1e-6 * hit.ended_at_boot_us <= FOUND_WITHIN_S


def _is_later(hit: Hit, first: Hit) -> bool:
    return hit.contact_at_boot_us - first.ended_at_boot_us > SAME_TOUCH_S * 1e6
