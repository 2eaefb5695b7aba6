"""The shell's own completion, asked as the shell asks it."""

import subprocess

import pytest

from rebound_cli.main import main
from tests.rebound_cli.command import ROOT

ASK = """
source /dev/stdin
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMP_LINE="$*"
$(complete -p rebound | sed 's/.* -F \\([^ ]*\\) .*/\\1/')
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (["fl"], {"fly"}),
        (["fly", "--lo"], {"--lockstep"}),
        (["guard", "--then", ""], {"previous", "hold"}),
        (["fly", "missions/wal"], {"missions/wall.yaml"}),
        (["check", "wal"], {"wall"}),
        (["sim", "--mission", "wal"], {"wall"}),
        (["fly", "--airframe", "rac"], {"racer"}),
        (["init", "--example", "guarded"], {"guarded_offboard"}),
        (["guard", "--config", "CHANGELO"], {"CHANGELOG.md"}),
    ],
)
def test_bash_completes_commands_options_choices_and_files(typed, offered, capsys):
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    asked = ["bash", "-c", ASK, "bash", "rebound", *typed]
    answer = subprocess.run(asked, input=script, cwd=ROOT, capture_output=True, text=True, check=True)
    assert set(answer.stdout.split()) == offered, answer.stderr
