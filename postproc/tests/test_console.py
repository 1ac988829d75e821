"""The command: files, exit codes, messages."""

import runpy
import sys
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from spurflex_postproc import output
from spurflex_postproc.cli import main
from spurflex_postproc.figures import FIGURES


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--list"]) == 0
    assert [row.split()[0] for row in capsys.readouterr().out.splitlines()] == list(FIGURES)


def test_figure_2(curve_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "new" / "figures"
    assert main(["2", str(curve_file), "--output", str(folder), "--mesh-axis"]) == 0
    assert names(folder) == ["figure2.pdf", "figure2.png"]
    assert (folder / "figure2.pdf").read_bytes().startswith(b"%PDF")
    assert (folder / "figure2.png").read_bytes().startswith(b"\x89PNG")
    out = capsys.readouterr().out
    assert "93.9 % of 571 points settled" in out
    assert "+0.0 %" in out


def test_figure_9(map_file: Path, tmp_path: Path) -> None:
    assert main(["9", str(map_file), "--output", str(tmp_path)]) == 0
    stems = ("figure9_map", "figure9_surface")
    assert names(tmp_path) == [f"{stem}.{kind}" for stem in stems for kind in ("pdf", "png")]
    assert all((tmp_path / f"{stem}.pdf").stat().st_size < 1e6 for stem in stems)


def test_same_bytes_again(curve_file: Path, tmp_path: Path) -> None:
    for folder in ("a", "b"):
        assert main(["2", str(curve_file), "--output", str(tmp_path / folder)]) == 0
    for kind in ("pdf", "png"):
        first, second = ((tmp_path / f / f"figure2.{kind}").read_bytes() for f in "ab")
        assert first == second
        assert b"CreationDate" not in first


@pytest.mark.parametrize("number", ["2", "9"])
def test_unusable_file(number: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "notes.h5"
    path.write_text("not a result")
    assert main([number, str(path), "--output", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert err == f"spurflex-figures: {path}: is not an HDF5 file\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "arguments", [[], ["2"], ["77", "x.h5"], ["2", "x.h5", "--stiffness", "-1"], ["--nonsense"]]
)
def test_wrong_usage(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    assert "usage:" in capsys.readouterr().err


def test_folder_cannot_be_made(
    curve_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    assert main(["2", str(curve_file), "--output", str(tmp_path / "file")]) == 1
    assert "cannot write" in capsys.readouterr().err


@pytest.mark.parametrize("fault", [OSError("disk full"), KeyboardInterrupt()])
def test_interrupted_write_leaves_the_old_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: BaseException
) -> None:
    for kind in output.FORMATS:
        (tmp_path / f"f.{kind}").write_text("old")
    whole = Figure.savefig

    def broken(self: Figure, path: Path, *, format: str, **rest: object) -> None:
        whole(self, path, format=format, **rest)
        if format == "png":
            raise fault

    monkeypatch.setattr(Figure, "savefig", broken)
    with pytest.raises(type(fault)):
        output.save(Figure(), tmp_path, "f")
    assert names(tmp_path) == ["f.pdf", "f.png"]
    assert (tmp_path / "f.pdf").read_text() == "old"


def test_module_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["spurflex-figures", "--list"])
    with pytest.raises(SystemExit) as caught:
        runpy.run_module("spurflex_postproc", run_name="__main__")
    assert caught.value.code == 0
