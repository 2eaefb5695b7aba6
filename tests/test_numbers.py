"""Where the numbers of detection and recovery live: in two files, each number with its reason."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

COMPANION = Path(__file__).parent.parent / "companion"
CONFIGS = [COMPANION / "reflex" / "config.py", COMPANION / "motion" / "config.py"]
# Nothing, one, two, a half; microseconds and seconds, metres and centimetres; what only rounding makes.
FREE = {0, 1, 2, 0.5, 1e6, 1e-6, 0.5e-6, 1e3, 100, 1e-9}
# Those that a derivation gives.
DERIVED = {
    "reflex/velocity_jump.py": {3},  # axes; Student's t by degrees of freedom
    "reflex/filter_bank.py": {3},  # axes
    "reflex/impact.py": {4},  # a beginning that is known by two windows: half of half a window
    "reflex/monitor.py": {3},  # shown decimals
    "reflex/health.py": {3, 3600},  # shown decimals; seconds an hour
    "flight/damage.py": {3},  # shown decimals
}
# A damaged motor decides no hit and no recovery.
OTHERS = {"motors.py"}
FLIGHT = ("after_hit", "damage", "recovering")


def sources() -> Iterator[Path]:
    for room in ("motion", "reflex"):
        yield from (path for path in sorted((COMPANION / room).glob("*.py")) if path not in CONFIGS)
    yield from (COMPANION / "flight" / f"{name}.py" for name in FLIGHT)


def numbers(path: Path) -> set[float]:
    constants = (node.value for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Constant))
    return {value for value in constants if type(value) in (int, float)}


@pytest.mark.parametrize("path", [path for path in sources() if path.name not in OTHERS], ids=lambda path: path.stem)
def test_a_number_outside_the_two_files_is_a_unit_or_is_derived(path: Path) -> None:
    derived = DERIVED.get(path.relative_to(COMPANION).as_posix(), set())
    assert numbers(path) - FREE == derived


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.parent.name)
def test_every_number_has_its_reason(path: Path) -> None:
    module, lines = ast.parse(path.read_text()), path.read_text().splitlines()
    # A comment above it, or above the number that it shares one with.
    missing = [
        ast.unparse(node) for node in module.body if isinstance(node, ast.Assign) and not lines[node.lineno - 2].strip()
    ]
    for settings in (node for node in module.body if isinstance(node, ast.ClassDef)):
        for field, text in zip(settings.body, [*settings.body[1:], None], strict=True):
            if isinstance(field, ast.AnnAssign) and isinstance(field.value, ast.Constant):
                is_text = isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
                missing += [] if is_text else [f"{settings.name}.{ast.unparse(field.target)}"]
    assert missing == []
