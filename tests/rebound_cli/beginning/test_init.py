"""`rebound init`: a mission to begin with, that flies as it is, under its own name."""

import pytest

from rebound_cli.documents import load_document
from rebound_cli.inputs import load_mission_document, mission_from
from rebound_cli.main import main
from tests.rebound_cli.command import ROOT, WALL


def test_the_copy_is_a_mission_of_its_own_name(tmp_path, capsys):
    file = tmp_path / "missions" / "my-first.yaml"
    assert main(["init", str(file)]) == 0
    # Then it says all that the original says, but for its name
    copied, original = load_document(file).data, load_document(WALL).data
    assert copied == original | {"name": "my-first"}
    assert f"rebound fly {file}" in capsys.readouterr().out
    # And leads to no schema that is not there
    assert "schema.json" not in file.read_text()


@pytest.mark.parametrize("stem", ["true", "7 flights", 'a "b": c', "ü"])
def test_whatever_the_file_is_called(stem, tmp_path):
    file = tmp_path / f"{stem}.yaml"
    assert main(["init", str(file), "--from", "square"]) == 0
    assert isinstance(load_document(file).data["name"], str)
    assert mission_from(load_mission_document(file, (), None, None)).items


def test_the_names_to_begin_from_are_listed_and_the_nearest_is_offered(capsys):
    assert main(["init", "--list"]) == 0
    assert {"wall", "square", "guarded_offboard"} <= set(capsys.readouterr().out.split())
    assert main(["init"]) == 1 and "Which file?" in capsys.readouterr().err
    assert main(["sim", "--mission", "wal"]) == 1 and "did you mean wall?" in capsys.readouterr().err


def test_nothing_is_written_over_and_a_model_that_is_not_is_named(tmp_path, capsys):
    file = tmp_path / "mine.yaml"
    assert main(["init", str(file), "--from", "walls"]) == 1
    assert "No mission 'walls' ships with the program; did you mean wall?" in capsys.readouterr().err
    assert not file.exists()
    file.write_text("mine")
    assert main(["init", str(file)]) == 1
    assert file.read_text() == "mine" and str(file) in capsys.readouterr().err


def test_an_example_is_written_under_its_own_name_or_another(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["init", "--example", "guarded_offboard"]) == 0
    assert main(["init", "mine/settings.yaml", "--example", "guard"]) == 0
    for name, original in (("guarded_offboard.py", "guarded_offboard.py"), ("mine/settings.yaml", "guard.yaml")):
        assert (tmp_path / name).read_bytes() == (ROOT / "examples" / original).read_bytes()
    assert main(["init", "--example", "guarded"]) == 1
    assert "No example 'guarded' ships with the program; did you mean guard" in capsys.readouterr().err
