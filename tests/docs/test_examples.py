"""Every example of the manual: a console is run and its output compared, a command line is parsed, YAML is loaded.

In what a console shows, `...` stands for any text. Other numbers may differ by a quarter: the words may not.
"""

import argparse
import math
import os
import re
import shlex
import subprocess
import sys

import pytest
import yaml

import bench.main
import rebound_cli.main
from companion.guard.config import GuardConfig
from companion.memory.stored import ObstacleFile
from companion.mission.model import Mission
from rebound_cli import __version__
from sim_vehicle.airframe import Airframe, with_base
from sim_vehicle.scene import Scene
from tests.docs.pages import ROOT, blocks, manual, name_of

# Python on these pages is run elsewhere: by tests/sim_vehicle/bench/test_on_sockets.py and tests/clients.
PYTHON_PAGES = {"docs/how-to/testing.md", "docs/tutorials/test-your-program.md", "docs/tutorials/mavsdk.md"}
LANGUAGES = {"sh", "console", "yaml", "python", "text", "mermaid"}
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?")
TOLERANCE, LEAST = 0.25, 0.3
_STAMP = re.compile(r"Measured\s+by\s+`python -m bench ([^`]+)`\s+on\s+version\s+([\w.]*\w)")
_IMAGES = re.compile(r"!\[[^]]*\]\([^)]*\.(?:png|webp)\)")


def consoles(path):
    """Of a page's consoles each command with what it is to print, in their order."""
    found = []
    for language, text in blocks(path):
        if language == "console":
            for line in text.splitlines():
                if line.startswith("$ "):
                    found.append((line[2:], []))
                else:
                    found[-1][1].append(line)
    return [(command, "\n".join(lines)) for command, lines in found]


def command_lines(path):
    """Every line of a page that somebody is to type, without its comment, its `sudo` and where its output goes."""
    for language, text in blocks(path):
        if language == "sh":
            for line in re.sub(r"\\\n", " ", text).splitlines():
                words = shlex.split(line.partition(" > ")[0], comments=True)
                yield words[1:] if words[:1] == ["sudo"] else words
    for command, _ in consoles(path):
        yield shlex.split(command)


def differs(expected, printed):
    """How what was printed differs from what the page shows; None where it does not."""
    if not expected.strip():
        return None
    parts = re.split(r"(^\.\.\.$|\.\.\.)", expected.strip(), flags=re.MULTILINE)
    pattern, numbers = "", []
    for part in parts:
        if part == "...":
            pattern += r"[\s\S]*?"
            continue
        last = 0
        for found in _NUMBER.finditer(part):
            pattern += re.escape(part[last : found.start()]) + r"(-?\d+(?:\.\d+)?)"
            numbers.append(float(found[0]))
            last = found.end()
        pattern += re.escape(part[last:])
    match = re.fullmatch(pattern, printed.strip())
    if match is None:
        return f"expected\n{expected}\n\nprinted\n{printed}"
    pairs = zip(numbers, map(float, match.groups()), strict=True)
    wrong = [pair for pair in pairs if not math.isclose(*pair, rel_tol=TOLERANCE, abs_tol=LEAST)]
    return f"expected and printed: {wrong}" if wrong else None


@pytest.mark.slow
@pytest.mark.parametrize("path", [path for path in manual() if consoles(path)], ids=name_of)
def test_a_console_prints_what_the_page_shows(path, tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "120"}
    for command, expected in consoles(path):
        program, *words = shlex.split(command)
        assert program == "rebound", command
        done = subprocess.run(
            [sys.executable, "-m", "rebound_cli", *words],
            cwd=tmp_path,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=600,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}"
        assert differs(expected, done.stdout) is None, f"{command}\n{differs(expected, done.stdout)}"


def parsed(words):
    """Whether a command line of ours can be read; None of other programs."""
    program = words[0].rpartition("/")[2] if words else ""
    if program == "rebound":
        rebound_cli.main.build_parser().parse_args(words[1:])
    elif program == "python" and words[1:3] == ["-m", "bench"]:
        bench.main.build_parser().parse_args(words[3:])
    elif program == "make" and words[1] != "px4_sitl":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        unknown = [word for word in words[1:] if "=" not in word and word not in targets]
        if unknown:
            raise argparse.ArgumentError(None, f"make has no target {unknown}")
    else:
        return None
    return True


@pytest.mark.parametrize("path", manual(), ids=name_of)
def test_every_command_line_can_be_read(path):
    for words in command_lines(path):
        try:
            parsed(words)
        except (SystemExit, argparse.ArgumentError) as error:
            pytest.fail(f"{shlex.join(words)}: {error}")


def load(text):
    """By the keys that it has: a mission, a world, an airframe, a map or a guard's settings."""
    data = yaml.safe_load(text)
    if "items" in data:
        data.pop("sim", None)
        return Mission.model_validate(data)
    if "sim" in data:
        return Scene.model_validate(data["sim"])
    if "based_on" in data:
        return Airframe.model_validate(with_base(data))
    return ObstacleFile.model_validate(data) if "patches" in data else GuardConfig.model_validate(data)


@pytest.mark.parametrize("path", manual(), ids=name_of)
def test_every_yaml_can_be_loaded(path):
    for language, text in blocks(path):
        if language == "yaml":
            load(text)


def test_every_block_says_what_it_is_and_python_is_run_somewhere():
    for path in manual():
        languages = {language for language, _ in blocks(path)}
        assert languages <= LANGUAGES, path
        assert "python" not in languages or name_of(path) in PYTHON_PAGES, path


@pytest.mark.parametrize("path", manual(), ids=name_of)
def test_a_picture_and_a_measured_figure_name_their_command_and_are_of_this_release(path):
    # A release with another number is red until its pictures and figures are made anew
    text = path.read_text(encoding="utf-8")
    for command, version in _STAMP.findall(text):
        bench.main.build_parser().parse_args(shlex.split(command))
        assert version == __version__, f"run `python -m bench {command}` and write its version"
    assert not re.search(r"Measured\s+by\s+`", _STAMP.sub("", text)), "a stamp that says no version"
    sections = re.split(r"^#+ ", text, flags=re.MULTILINE)
    assert [part[:40] for part in sections if _IMAGES.search(part) and not _STAMP.search(part)] == []
