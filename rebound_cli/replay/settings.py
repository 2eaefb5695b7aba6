"""The companion's settings for a replay: defaults, a file's `companion:` part, and what the command line changes."""

from collections.abc import Sequence
from pathlib import Path

from companion.mission.config import CompanionConfig
from rebound_cli.documents import Override, apply_override, apply_overrides, empty_document, load_document, validated
from rebound_cli.inputs import load_flown
from rebound_cli.run_folder import GUARD_NAME, RESOLVED_NAME


def companion_settings(path: Path | None, sets: Sequence[str], detector: str | None) -> CompanionConfig:
    """Of the file only the `companion:` part counts. Raises DocumentError."""
    if path is None:
        document = empty_document("no mission file")
    else:
        document = load_flown(path) if path.name in (GUARD_NAME, RESOLVED_NAME) else load_document(path)
    apply_overrides(document, sets)
    if detector is not None:
        apply_override(document, Override(f"--detector {detector}", ("companion", "detector"), detector))
    return validated(CompanionConfig, document, document.data.get("companion") or {}, ("companion",))
