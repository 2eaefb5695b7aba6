"""The rooms' rules: who may import whom, and where the world outside may be touched."""

import argparse
import functools
import graphlib
import importlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import bench.main
import rebound_cli.main
from tests.import_graph import PACKAGES, imported_names, module_imports

ROOT = Path(__file__).parent.parent

# Modules through which code touches the world outside: sockets, ports, clocks, processes, the environment, files.
OUTSIDE = {
    *("socket", "select", "serial", "asyncio", "threading", "subprocess", "signal"),
    *("time", "datetime", "os", "sys", "shutil", "tempfile", "pathlib", "io"),
}
# Built-in airframes and the tables of parameters are read where they lie; compiled kernels in the user's cache.
MAY_READ_FILES = {
    "sim_vehicle/airframe.py",
    "sim_vehicle/parameters/sitl.py",
    "sim_vehicle/parameters/store.py",
    "sim_vehicle/physics/jit.py",
}


def sources(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


imports_of_all = functools.cache(lambda: module_imports(ROOT))


def breaches(packages: tuple[str, ...], forbidden: set[str]) -> list[str]:
    return [
        f"{name(path)} imports {module}"
        for package in packages
        for path in sources(package)
        for module in imported_names(path)
        if module.split(".")[0] in forbidden
    ]


def test_there_is_something_to_check() -> None:
    assert all(len(sources(package)) > 10 for package in PACKAGES)


def test_companion_and_vehicle_never_import_each_other_nor_the_command_line() -> None:
    assert breaches(("companion",), {"sim_vehicle", "rebound_cli"}) == []
    assert breaches(("sim_vehicle",), {"companion", "rebound_cli"}) == []


def test_how_the_reflex_decides_and_believes_stays_behind_its_door() -> None:
    # Values go through the door, and settings; to compare with other detectors the laboratory looks behind it.
    behind = ("classify", "confirmation", "correction", "crash", "free_flight", "fused", "motion_estimator")
    hidden = {f"companion.reflex.{name}" for name in (*behind, "sustained_force", "velocity_jump")}
    found = [
        f"{module} imports {name}"
        for module, names in imports_of_all().items()
        for name in names & hidden
        if module.startswith("companion.") and not module.startswith("companion.reflex.")
    ]
    assert found == []


def test_nothing_that_is_installed_needs_the_laboratory() -> None:
    assert breaches(("companion", "sim_vehicle", "rebound_cli"), {"bench"}) == []


def test_pymavlink_is_imported_only_where_bytes_become_messages() -> None:
    allowed = ("companion/mavlink/", "sim_vehicle/mavlink/", "rebound_cli/logs/dataflash.py")
    allowed += ("bench/fly/commanded.py", "bench/fly/counted.py", "bench/fly/packets.py", "bench/studies/speed.py")
    assert [breach for breach in breaches(PACKAGES, {"pymavlink"}) if not breach.startswith(allowed)] == []


@pytest.mark.parametrize("package", ["companion", "sim_vehicle"])
def test_only_the_shell_touches_the_world_outside(package: str) -> None:
    found = [
        breach
        for breach in breaches((package,), OUTSIDE)
        if not breach.startswith(f"{package}/shell/") and breach.split(" ")[0] not in MAY_READ_FILES
    ]
    assert found == []


def test_no_module_needs_itself_by_way_of_others() -> None:
    # Not even late or for its types alone: two files that need each other are one concept, or hide a third.
    try:
        graphlib.TopologicalSorter(imports_of_all()).prepare()
    except graphlib.CycleError as cycle:
        pytest.fail(" is imported by ".join(cycle.args[1]))


@pytest.mark.parametrize("package", PACKAGES)
def test_no_folder_needs_itself_by_way_of_others(package: str) -> None:
    # The way of the data is the way of the files. A file beside the folders counts as one of them.
    arrows: dict[str, set[str]] = {}
    for module, names in imports_of_all().items():
        room, *inside = module.split(".")
        if room == package and inside:
            below = {name.split(".")[1] for name in names if name.startswith(f"{package}.")}
            arrows.setdefault(inside[0], set()).update(below - {inside[0]})
    try:
        graphlib.TopologicalSorter(arrows).prepare()
    except graphlib.CycleError as cycle:
        pytest.fail(f"in {package}, " + " is imported by ".join(cycle.args[1]))


def test_what_a_text_in_the_code_refers_to_is_there() -> None:
    # "(see room.module)" and "(see module.name)" outlive the module when it is merged into another.
    modules = {part for package in PACKAGES for path in sources(package) for part in path.with_suffix("").parts}
    missing = [
        f"{name(path)}: {reference}"
        for package in PACKAGES
        for path in sources(package)
        for reference in re.findall(r"\(see ([a-z_]+\.[a-z_]+)\b", path.read_text())
        if reference.split(".")[0] not in modules
    ]
    assert missing == []


# Prefixes of PX4's parameters; numbers as px4_custom_mode.h packs them.
OF_PX4 = (
    re.compile(r"\b(?:BAT\d?|CA|CBRK|COM|CP|EKF2|FD|GF|IMU|MC|MIS|MPC|NAV|RTL|SENS|SER|SYS)_[A-Z][A-Z0-9_]+\b"),
    re.compile(r"\bMAV_(?:[0-9nx]_[A-Z]+|PROTO_VER)\b"),
    re.compile(r"\b\d+ << (?:16|24)\b"),
)
OF_ARDUPILOT = re.compile(r"\b(?:ARMING|ATC|BATT|GUID|INS|MOT|PSC|SERIAL[0-9n]|WP)_[A-Z][A-Z0-9_]+\b")
# MAVLink's message; reasons of the numbers of motion are still where the numbers are.
NO_PARAMETER = {"SYS_STATUS"}
ROOMS_OF_NUMBERS = ("companion/autopilot/px4/", "companion/reflex/", "companion/motion/")


def test_one_folder_names_what_is_px4s() -> None:
    found = [
        f"{name(path)}: {word}"
        for path in sources("companion")
        for pattern in OF_PX4
        for word in pattern.findall(path.read_text())
        if word not in NO_PARAMETER and not name(path).startswith(ROOMS_OF_NUMBERS)
    ]
    assert found == []


def test_another_folder_names_what_is_ardupilots() -> None:
    found = [
        f"{name(path)}: {word}"
        for path in sources("companion")
        for word in OF_ARDUPILOT.findall(path.read_text())
        if not name(path).startswith("companion/autopilot/ardupilot/")
    ]
    assert found == []


def test_an_autopilots_folder_is_known_to_the_table_of_autopilots_alone() -> None:
    assert [
        module
        for module, names in imports_of_all().items()
        if module.startswith("companion.")
        and not module.startswith("companion.autopilot.")
        and any(name.startswith(("companion.autopilot.px4", "companion.autopilot.ardupilot")) for name in names)
    ] == []


def commands_of(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield command
                yield from commands_of(command)


@pytest.mark.parametrize("main", [bench.main, rebound_cli.main])
def test_every_command_runs_a_function_that_there_is(main: Any) -> None:
    # Commands name their function in text, to import it late: no type checker sees a wrong one.
    runs = [run for command in commands_of(main.build_parser()) if (run := command.get_default("run"))]
    assert len(runs) > 5
    for module, function in (run.args for run in runs):
        assert callable(getattr(importlib.import_module(module), function)), function
