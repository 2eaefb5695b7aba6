"""The fixture `rebound_vehicle`, for whoever has this package installed. Costs nothing until a test asks for it.

    @pytest.mark.rebound(airframe="rigid", speed=5)        # or parametrize(..., indirect=True) with dictionaries
    def test_it(rebound_vehicle): ...

On a failed test the report says with which seed and setup, what happened, and where the recorded truth is.
"""

from collections.abc import Callable, Generator, Iterator
from dataclasses import fields
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from sim_vehicle.bench.bench import LockstepVehicle
    from sim_vehicle.shell.background import RunningVehicle

# With what writes its truth, and where folders are made for that.
_FLOWN: "pytest.StashKey[tuple[RunningVehicle | LockstepVehicle, Callable[[Path], None], pytest.TempPathFactory]]"
_FLOWN = pytest.StashKey()
# A report is read by a person: the last words matter.
_MOST_EVENTS = 60


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("rebound", "the simulated vehicle")
    group.addoption(
        "--rebound-seed", type=int, metavar="N", help="seed of every simulated vehicle that does not state one"
    )
    group.addoption(
        "--rebound-speed", type=float, metavar="N", help="speed of every vehicle on sockets that does not state one"
    )


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers",
        "rebound(lockstep=False, speed=1.0, seed=1, airframe='foldable', obstacles=(), ...): how rebound_vehicle "
        "begins; everything that start_vehicle takes",
    )


@pytest.fixture
def rebound_vehicle(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> "Iterator[RunningVehicle | LockstepVehicle]":
    """A simulated PX4: on real sockets, or in memory with `lockstep=True`; it ends with the test."""
    options = _options(request)
    if options.pop("lockstep", False):
        from sim_vehicle.bench.bench import LockstepVehicle
        from sim_vehicle.shell.truth_file import save_truth

        options.pop("speed", None)
        vehicle = LockstepVehicle(**options)
        request.node.stash[_FLOWN] = vehicle, lambda path: save_truth(path, vehicle.recorded, 0), tmp_path_factory
        yield vehicle
        return
    from sim_vehicle.shell.background import start_vehicle

    with start_vehicle(**options) as running:
        request.node.stash[_FLOWN] = running, running.save_truth, tmp_path_factory
        yield running


def _options(request: pytest.FixtureRequest) -> dict[str, Any]:
    """The command line's, laid over by the marks, from the class's inwards, and by the parameter."""
    options: dict[str, Any] = {}
    for name in ("seed", "speed"):
        value = request.config.getoption(f"--rebound-{name}")
        if value is not None:
            options[name] = value
    for mark in reversed(list(request.node.iter_markers("rebound"))):
        if mark.args:
            raise pytest.UsageError("the mark rebound takes settings by name, e.g. rebound(lockstep=True).")
        options.update(mark.kwargs)
    options.update(getattr(request, "param", None) or {})
    _check_names(options)
    return options


def _check_names(options: dict[str, Any]) -> None:
    from sim_vehicle.bench.bench import Setup

    names = ["lockstep", "streams", *(field.name for field in fields(Setup))]
    names += [] if options.get("lockstep") else ["links"]
    for name in options:
        if name not in (*names, "speed"):
            near = get_close_matches(name, names, n=1)
            meant = f"did you mean {near[0]}? There are" if near else "there are"
            raise pytest.UsageError(f"the mark rebound has no setting {name!r}: {meant} {', '.join(names)}, speed.")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Tell of the vehicle's flight where the test on it has failed."""
    report = yield
    flown = item.stash.get(_FLOWN, None)
    if report.when == "call" and report.failed and flown is not None:
        vehicle, save_truth, folders = flown
        path = folders.mktemp("rebound") / "truth.npz"
        save_truth(path)
        report.sections.append(("rebound vehicle", f"{_told(vehicle)}\ntruth: {path}"))
    return report


def _told(vehicle: "RunningVehicle | LockstepVehicle") -> str:
    """What a person needs to see why, and to see it again."""
    setup, truth, events = vehicle.setup, vehicle.truth, vehicle.timeline
    airframe = setup.airframe if isinstance(setup.airframe, str) else setup.airframe.name
    north, east, down = truth.position_ned_m
    lines = [
        f"seed {setup.seed} (again: --rebound-seed {setup.seed}), airframe '{airframe}'",
        f"at {truth.time_boot_s:.3f} s: {truth.mode}, {'armed' if truth.is_armed else 'disarmed'}, at "
        f"({north:.2f}, {east:.2f}, {down:.2f}) m NED, {truth.speed_m_s:.2f} m/s, {len(truth.hits)} hits",
    ]
    if len(events) > _MOST_EVENTS:
        lines.append(f"... {len(events) - _MOST_EVENTS} earlier events")
    lines += [str(event) for event in events[-_MOST_EVENTS:]]
    return "\n".join(lines)
