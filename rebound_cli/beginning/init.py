"""`rebound init`: a copy of a mission or an example that ships with the program, for somebody to change."""

import json
import re
import shlex
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path

from companion.errors import ConfigurationError
from companion.shell.files import write_new
from rebound_cli.inputs.documents import suggestion
from rebound_cli.inputs.shipped import shipped_examples, shipped_missions


def run_init(options: Namespace) -> None:
    """Raises ConfigurationError for a file that is there or a mission or an example that is not."""
    missions, examples = shipped_missions(), shipped_examples()
    if options.list:
        print("\n".join([*missions, *(f"--example {name}" for name in examples)]))
    elif options.example is not None:
        if options.model is not None:
            raise ConfigurationError("--from is a mission, --example an example: leave one of them out.")
        example = _named(options.example, "example", examples)
        file = options.file or Path(example.name)
        _write(file, example.read_text(encoding="utf-8"))
        print(f"{file} is a copy of the example '{options.example}'.")
    elif options.file is None:
        raise ConfigurationError("Which file? Such as: rebound init my-mission.yaml")
    else:
        model = options.model or "wall"
        _copy_mission(options.file, model, _named(model, "mission", missions))


def _named(name: str, kind: str, shipped: Mapping[str, Path]) -> Path:
    if name not in shipped:
        there = ", ".join(shipped)
        raise ConfigurationError(
            f"No {kind} {name!r} ships with the program{suggestion(name, shipped)} There are {there}."
        )
    return shipped[name]


def _copy_mission(file: Path, model: str, mission: Path) -> None:
    text = mission.read_text(encoding="utf-8")
    # The schema lies beside the original.
    text = re.sub(r"^# yaml-language-server:.*\n", "", text)
    name = json.dumps(re.sub("[^A-Za-z0-9._-]+", "-", file.stem))
    _write(file, re.sub(rf"^name: {model}$", f"name: {name}", text, flags=re.MULTILINE))
    print(f"{file} is a copy of the mission '{model}'. Change it, then:")
    quoted = shlex.quote(str(file))
    print(f"    rebound check {quoted}    # says and draws what it would do")
    print(f"    rebound fly {quoted}      # flies it with the simulated vehicle")


def _write(file: Path, text: str) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    try:
        write_new(file, text.encode())
    except FileExistsError:
        raise ConfigurationError(f"{file} is there already: nothing was written.") from None
