"""`rebound init`: a copy of a mission that ships with the program, for somebody to change."""

import json
import re
import shlex
from argparse import Namespace

from companion.errors import ConfigurationError
from rebound_cli.documents import write_text
from rebound_cli.shipped import shipped_missions


def run_init(options: Namespace) -> int:
    """Raises ConfigurationError for a file that is there or a mission that is not."""
    missions = shipped_missions()
    if options.list:
        print("\n".join(missions))
        return 0
    if options.file is None:
        raise ConfigurationError("Which file? Such as: rebound init my-mission.yaml")
    if options.file.exists():
        raise ConfigurationError(f"{options.file} is there already: nothing was written.")
    if options.model not in missions:
        there = ", ".join(missions)
        raise ConfigurationError(f"No mission {options.model!r} ships with the program; there are {there}.")
    text = missions[options.model].read_text(encoding="utf-8")
    # The schema lies beside the original.
    text = re.sub(r"^# yaml-language-server:.*\n", "", text)
    name = json.dumps(re.sub("[^A-Za-z0-9._-]+", "-", options.file.stem))
    text = re.sub(rf"^name: {options.model}$", f"name: {name}", text, flags=re.MULTILINE)
    options.file.parent.mkdir(parents=True, exist_ok=True)
    write_text(options.file, text)
    print(f"{options.file} is a copy of the mission '{options.model}'. Change it, then:")
    file = shlex.quote(str(options.file))
    print(f"    rebound check {file}    # says and draws what it would do")
    print(f"    rebound fly {file}      # flies it with the simulated vehicle")
    return 0
