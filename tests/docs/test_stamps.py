"""Pictures and figures of the manual say on which code they were measured."""

import pytest

from bench import stamps
from bench.main import main

PAGE = "# Bumps\n\n## Hits\n\n{stamp}\n\n![hits](hits.png)\n"


@pytest.fixture
def code(tmp_path, monkeypatch):
    """A checkout of one file."""
    monkeypatch.setattr(stamps, "ROOT", tmp_path)
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("# Nothing\n")
    path = tmp_path / "code" / "one.py"
    path.parent.mkdir()
    path.write_text('"""Says."""\n\n\ndef bump(x: int) -> int:\n    """Bump."""\n    return x + 1  # one\n')
    return path


@pytest.mark.parametrize(
    ("change", "is_old"),
    [(("x + 1", "x + 2"), True), (("# one", "# two"), False), (("Bump.", "Bumps."), False), (("Says.", ""), False)],
)
def test_what_the_code_does_makes_a_stamp_old_and_what_it_says_does_not(code, change, is_old):
    text = PAGE.format(stamp=stamps.stamp_text("make bumps", ["code/one.py"]) + ": 3 hits.")
    code.write_text(code.read_text().replace(*change))
    assert [stamp.is_old for stamp in stamps.stamps_in(text)] == [is_old]
    assert bool(list(stamps.complaints("bumps.md", text))) is is_old


def test_only_a_release_fails_on_old_stamps(code, tmp_path, capsys):
    (tmp_path / "docs" / "bumps.md").write_text("## Hits\n\n![hits](hits.png)\n")
    assert main(["stamps"]) == 0
    assert "bumps.md: the section" in capsys.readouterr().out
    assert main(["stamps", "--release"]) == 1
