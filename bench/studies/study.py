"""What every study does: its cases are flown, and what their rows show becomes a page in a folder of `build/`."""

import hashlib
import os
import subprocess
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from bench.fly.campaign import Json, Results, run_campaign
from companion.errors import ConfigurationError
from rebound_cli import __version__
from rebound_cli.inputs.inputs import load_world
from rebound_cli.results.run_folder import RunFolderError


@dataclass(frozen=True, slots=True)
class Shown:
    """Sections by their headings, what is said on the terminal, pictures by their files, and rows for a file."""

    parts: Mapping[str, str]
    said: str = ""
    rows: pd.DataFrame | None = None
    figures: Mapping[str, Figure] = field(default_factory=dict)
    is_met: bool = True
    """Whether the command ends with 0."""


def run_study(
    options: Namespace,
    name: str,
    title: str,
    cases: Sequence[Any],
    work_out: Callable[[Any], Json],
    show: Callable[[Results], Shown],
) -> int:
    """Fly the cases and write the page of that name; 1 where a case failed to be flown."""
    page = page_path(options.out, name)
    results = run_campaign(_record_name(options, name), cases, work_out, options.jobs)
    shown = show(results)
    write_page(page, title, options.typed, shown)
    print("\n".join(filter(None, (shown.said, *results.failures))))
    return 0 if shown.is_met and not results.failures else 1


def own_airframe(options: Namespace) -> str | None:
    """The one that was asked for by name or file, looked over as `rebound fly` does it. Raises ReboundError."""
    if options.airframe is None:
        return None
    if options.vehicles == "drawn":
        raise ConfigurationError("--airframe is the vehicle, and --vehicles drawn draws it: leave one of them out.")
    load_world(None, (), options.airframe, None)
    return str(options.airframe)


def _record_name(options: Namespace, name: str) -> str:
    """Rows of an airframe's file belong to what is in it, not to where it lies."""
    own = Path(getattr(options, "airframe", None) or "")
    return f"{name}-{own.stem}-{hashlib.sha256(own.read_bytes()).hexdigest()[:8]}" if own.is_file() else name


def seeds_of(options: Namespace, count: int) -> range:
    """So many, from the first that was asked for."""
    return range(options.first_seed, options.first_seed + count)


def page_path(out: Path | None, name: str) -> Path:
    """The page, in a folder that is made or refused before hours are flown for it. Raises RunFolderError."""
    folder = out or Path("build") / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunFolderError(f"The folder {folder} cannot be made: {error.strerror}.") from error
    if not os.access(folder, os.W_OK):
        raise RunFolderError(f"{folder} cannot be written to.")
    return folder / f"{name}.md"


def write_page(path: Path, title: str, command: str, shown: Shown) -> None:
    """Sections after what measured them and at which commit; pictures; the rows as JSON, one a line."""
    sections = [f"## {head}\n\n{text}" if head else text for head, text in shown.parts.items()]
    for name, figure in shown.figures.items():
        figure.savefig(path.parent / name)
        sections.append(f"![{name.removesuffix('.png')}]({name})\n")
    if shown.rows is not None:
        shown.rows.to_json(path.with_suffix(".jsonl"), orient="records", lines=True)
    git = ("git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty")
    commit = subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip() or "no commit"
    head = f"# {title}\n\nMeasured by `{command}` on version {__version__}, {commit}.\n"
    path.write_text("\n".join([head, *sections]), encoding="utf-8")
    print(f"Written to {path}.")
