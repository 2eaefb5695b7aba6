"""Documents of which a part is made anew: what stands between `<!-- generated: NAME -->` and `<!-- end -->`."""

import re
from pathlib import Path

from companion.errors import ReboundError

_END = "<!-- end -->"


class MarkedPartError(ReboundError):
    """A document that cannot be read, or without the one place for a part."""


def with_part(text: str, name: str, content: str) -> str:
    """The document with the part made anew and all else as it is. Raises MarkedPartError."""
    start = f"<!-- generated: {name} -->"
    marked = re.compile(rf"({re.escape(start)}\n).*?({re.escape(_END)})", re.DOTALL)
    changed, found = marked.subn(lambda match: match[1] + content + match[2], text)
    if found != 1:
        raise MarkedPartError(
            f"The document has {found} places for the {name}, not one: give it a line `{start}` and, after it, a line "
            f"`{_END}`."
        )
    return changed


def checked_text(path: Path, name: str, title: str | None = None) -> str:
    """The text of a document that has a place for the part; a new one, by default under the part's name, where there
    is no file.

    Commands ask before they fly for hours. Raises MarkedPartError.
    """
    if not path.exists():
        return f"# {title or name}\n\n<!-- generated: {name} -->\n{_END}\n"
    try:
        text = path.read_text(encoding="utf-8")
        with_part(text, name, "")
    except OSError as error:
        raise MarkedPartError(f"{path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise MarkedPartError(f"{path} is no text in UTF-8.") from error
    except MarkedPartError as error:
        raise MarkedPartError(f"{path}: {error}") from error
    return text


def write_part(path: Path, name: str, content: str, title: str | None = None) -> None:
    """Make the part anew in the file. Raises MarkedPartError as `checked_text` does, OSError."""
    text = with_part(checked_text(path, name, title), name, content)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
