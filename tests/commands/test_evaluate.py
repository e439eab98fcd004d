"""`mapcli evaluate` as a user sees it: report, JSON, picture, limits, usage, bad input."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import FIXTURES, run
from PIL import Image

from mapcli.cli import main
from mapcli.pictures.drawing import WHITE, time_colour

CORRIDOR = str(FIXTURES / "corridor.mcap")

TRUTH = "0 0 0 0\n1 2 0 0\n2 4 0 0\n3 4 2 1.5707963\n"
FOUND = "0 5 5 1.5707963\n1 5 7 1.5707963\n2 5 9 1.5707963\n3 3 9 3.1415926\n"
"""The truth turned by 90 degrees and moved."""
OFF = "0 0 0 0\n1 2 0 0.1\n2 4 0 0\n3 4 2.4 1.5707963\n9 0 0 0\n"


@pytest.fixture(autouse=True)
def _files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    texts = {"truth.txt": TRUTH, "found.txt": FOUND, "off.txt": OFF}
    texts["a.relations"] = "0 1 2 0 0 0 0 0\n2 3 0 2 0 0 0 1.5707963\n7 8 0 0 0 0 0 0\n"
    for name, text in texts.items():
        Path(name).write_text(text)


def evaluate(*arguments: str) -> int:
    return run("evaluate", *arguments)


def document(*arguments: str) -> dict[str, Any]:
    assert evaluate("-q", *arguments, "--json", "e.json") == 0
    return dict(json.loads(Path("e.json").read_text()))


def test_the_report_literally(capsys: pytest.CaptureFixture[str]) -> None:
    """Errors of 0.1, 0, 0.2, 0, 0.1 m across a straight path, which no turn can make smaller."""
    Path("line.txt").write_text("".join(f"{t} {5 - t} 7 3.14159265\n" for t in range(5)))
    ys = (0.1, 0, -0.2, 0, 0.1)
    Path("wavy.txt").write_text("".join(f"{t}.004 {t} {y} 0\n" for t, y in enumerate(ys)))
    assert evaluate("line.txt", "wavy.txt") == 0
    assert capsys.readouterr().out == REPORT


REPORT = """\
      trace  line.txt: 5 poses, 4.0 s
    against  wavy.txt: 5 poses, 4.0 s
   compared  5 of 5 poses, by stamps at most 0.01 s apart; 4.0 s in common
    aligned  by x 5.000 m, y 7.000 m, turn -180.00 deg

                                       rmse      mean    median       std       min       max
             ATE  translation, m     0.1095    0.0800    0.1000    0.0748    0.0000    0.2000
                  rotation, deg       0.000     0.000     0.000     0.000     0.000     0.000
 RPE over 1 pose  translation, m     0.1581    0.1500    0.1500    0.0500    0.1000    0.2000
                  rotation, deg       0.000     0.000     0.000     0.000     0.000     0.000

      worst  0.200 m, 0.00 deg at 2.0 s after the first pose
"""


def test_the_report_on_relations_literally(capsys: pytest.CaptureFixture[str]) -> None:
    assert evaluate("off.txt", "a.relations") == 0
    assert capsys.readouterr().out == REPORT_ON_RELATIONS


REPORT_ON_RELATIONS = """\
      trace  off.txt: 5 poses, 9.0 s
    against  a.relations: 3 relations
   compared  3 of 3 relations; between the trace's poses: interpolated

                                       rmse      mean    median       std       min       max
       relations  translation, m     0.5048    0.3925    0.4000    0.3174    0.0000    0.7775
                  rotation, deg       9.271     6.910     5.730     6.180     0.000    15.000

      worst  0.777 m, 15.00 deg between 7.0 and 8.0 s after the first pose
             0.400 m, 0.00 deg between 2.0 and 3.0 s after the first pose
             0.000 m, 5.73 deg between 0.0 and 1.0 s after the first pose
"""
"""The third relation is between poses: two and a sixth of the way from (4, 2.4) to (0, 0)."""


def test_the_document() -> None:
    found = document("off.txt", "truth.txt", "--delta", "2f")
    assert list(found)[:5] == ["format", "version", "mapcli", "input", "parameters"]
    assert found["format"] == "mapcli.evaluation"
    assert [entry["file"] for entry in found["input"]] == ["off.txt", "truth.txt"]
    assert found["parameters"] == {
        "max_diff_s": 0.01, "interpolate_s": None, "delta": 2.0, "delta_unit": "f", "topic": None,
    }  # fmt: skip
    assert (found["kind"], found["matched"], found["total"]) == ("trajectory", 4, 4)
    assert found["overlap_s"] == 3
    assert found["measures"]["rpe"]["count"] == 1
    assert found["measures"]["ate"]["translation_m"]["max"] == found["summary"]["ate_max"]
    assert [row["stamp_ns"] for row in found["errors"]] == [0, 10**9, 2 * 10**9, 3 * 10**9]
    assert max(r["translation_m"] for r in found["errors"]) == found["summary"]["ate_max"]


def test_documents_of_other_kinds() -> None:
    found = document("off.txt", "a.relations")
    assert (found["kind"], found["aligned"], found["overlap_s"]) == ("relations", None, None)
    assert found["errors"][1] == {
        "from_ns": 2 * 10**9, "to_ns": 3 * 10**9, "translation_m": 0.4, "rotation_deg": 0.0,
    }  # fmt: skip
    Path("k.kitti").write_text("1 0 0 1 0 1 0 2 0 0 1 0\n" * 2 + "1 0 0 1 0 1 0 9 0 0 1 0\n")
    rows = document("k.kitti", "k.kitti")["errors"]
    assert [row["index"] for row in rows] == [0, 1, 2]


@pytest.fixture
def _sides() -> None:
    """Two straight traces, a metre to the left of the truth and three to the right, which
    turns by 10 degrees at its end."""
    Path("line.txt").write_text("0 0 0 0\n1 1 0 0\n2 2 0 0\n")
    Path("left.txt").write_text("0 0 1 0\n1 1 1 0\n2 2 1 0\n")
    Path("right.txt").write_text("0 0 -3 0\n1 1 -3 0\n2 2 -3 0.17453293\n")


@pytest.mark.usefixtures("_sides")
def test_several_traces_literally(capsys: pytest.CaptureFixture[str]) -> None:
    assert evaluate("left.txt", "right.txt", "line.txt") == 0
    assert capsys.readouterr().out == TABLE
    assert evaluate("left.txt", "right.txt", "line.txt", "--common-frame") == 0
    assert capsys.readouterr().out == TABLE_IN_ONE_FRAME
    assert evaluate("off.txt", "truth.txt", "a.relations") == 0
    assert capsys.readouterr().out == TABLE_ON_RELATIONS


TABLE = """\
    against  line.txt: 3 poses, 2.0 s
   compared  poses, by stamps at most 0.01 s apart
    aligned  each by itself
        RPE  over 1 pose

          ATE rmse    mean     max  ATE rmse  RPE rmse  RPE rmse
compared         m       m       m       deg         m       deg  trace
  3 of 3    0.0000  0.0000  0.0000     0.000    0.0000     0.000  left.txt
  3 of 3    0.0000  0.0000  0.0000     5.774    0.0000     7.071  right.txt
"""
TABLE_IN_ONE_FRAME = """\
    against  line.txt: 3 poses, 2.0 s
   compared  poses, by stamps at most 0.01 s apart
    aligned  all by x 0.000 m, y 1.000 m, turn 0.00 deg
        RPE  over 1 pose

          ATE rmse    mean     max  ATE rmse  RPE rmse  RPE rmse
compared         m       m       m       deg         m       deg  trace
  3 of 3    2.0000  2.0000  2.0000     0.000    0.0000     0.000  left.txt
  3 of 3    2.0000  2.0000  2.0000     5.774    0.0000     7.071  right.txt
"""
TABLE_ON_RELATIONS = """\
    against  a.relations: 3 relations
   compared  relations, between the trace's poses: interpolated

            mean     std   mean    std
compared       m       m    deg    deg  trace
  3 of 3  0.3925  0.3174  6.910  6.180  off.txt
  2 of 3  0.0000  0.0000  0.000  0.000  truth.txt
"""


@pytest.mark.usefixtures("_sides")
def test_files_of_several_traces(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("-q", "left.txt", "right.txt", "line.txt")
    files = ("--json", "e.json", "--csv", "e.csv", "--png", "e.png")
    assert evaluate(*words, "--common-frame", *files) == 0
    documents = json.loads(Path("e.json").read_text())
    assert [found["summary"]["ate_rmse"] for found in documents] == [2, 2]
    assert [found["aligned"]["y"] for found in documents] == [1, 1]
    assert documents[0]["parameters"]["common_frame"] is True
    assert [e["file"] for e in documents[0]["input"]] == ["left.txt", "right.txt", "line.txt"]
    head, *rows = (line.split(",") for line in Path("e.csv").read_text().splitlines())
    for row, found in zip(rows, documents, strict=True):
        values = dict(zip(head, row, strict=True))
        assert values.pop("trace") == found["input"][documents.index(found)]["file"]
        assert {name: float(value) for name, value in values.items()} == found["summary"]
    assert Path("e.png").stat().st_size > 1000
    assert evaluate(*words, "--json", "e.json") == 0
    alone = json.loads(Path("e.json").read_text())
    assert [e["file"] for e in alone[1]["input"]] == ["right.txt", "line.txt"]
    assert alone[0] == document("left.txt", "line.txt")
    assert evaluate(*words, "--fail-if", "ate_rot_max>5") == 3
    assert capsys.readouterr().err.startswith("Error: right.txt: ate_rot_max is 10; expected not")
    assert evaluate("-q", "left.txt", "--csv", "one.csv", "line.txt") == 0
    assert Path("one.csv").read_text().count("\n") == 2
    Path("late.txt").write_text("1000 0 0 0\n1001 0 0 0\n")
    assert evaluate(*words[:2], "late.txt", "line.txt", *files) == 1
    assert capsys.readouterr().err.startswith("Error: late.txt: 0 poses matched")


@pytest.mark.usefixtures("_sides")
def test_traces_of_one_name_are_told_apart_by_their_folders() -> None:
    names = []
    for folder in ("a", "b"):
        Path(folder).mkdir()
        names.append(f"{folder}/left.txt")
        Path(names[-1]).write_text(Path("left.txt").read_text())
    assert evaluate("-q", *names, "line.txt", "--csv", "e.csv") == 0
    rows = Path("e.csv").read_text().splitlines()[1:]
    assert [row.split(",")[0] for row in rows] == names


def test_the_picture_shows_a_colour_for_each_trace() -> None:
    one, two = picture("off.txt", "truth.txt"), picture("off.txt", "found.txt", "truth.txt")
    assert two.shape[1] == one.shape[1] == 1200
    for age in (0.0, 1.0):
        assert (two == time_colour(age)).all(axis=2).sum() > 500
    relations = picture("off.txt", "off.txt", "a.relations")
    assert (relations == time_colour(1.0)).all(axis=2).sum() > 100


@pytest.mark.slow
def test_the_self_check_of_a_recording_in_parts() -> None:
    log = str(FIXTURES / "apartment.mcap")
    for name, *part in (("a.mcap", "--end", "50.1"), ("b.mcap", "--start", "50.1")):
        assert run("import", "-q", log, name, *part) == 0
    whole = document(log, "--self-check", log)
    parts = document(log, "--self-check", "a.mcap", "--self-check", "b.mcap")
    assert parts["summary"] == whole["summary"]
    assert [entry["file"] for entry in parts["input"]] == ["apartment.mcap", "a.mcap", "b.mcap"]


def test_text_gives_way_to_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert evaluate("found.txt", "truth.txt", "--json", "-") == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["summary"]["ate_rmse"] == 0
    assert "ATE" in said.err
    assert evaluate("found.txt", "truth.txt", "-q") == 0
    assert capsys.readouterr() == ("", "")


def picture(*arguments: str) -> np.ndarray:
    assert evaluate("-q", *arguments, "--png", "e.png") == 0
    return np.array(Image.open(io.BytesIO(Path("e.png").read_bytes())))


def test_the_picture_shows_both_paths_and_the_errors() -> None:
    pixels = picture("off.txt", "truth.txt")
    assert pixels.shape[1] == 1200
    drawn = (pixels != WHITE).any(axis=2)
    top, bottom = drawn[: len(drawn) // 2], drawn[len(drawn) // 2 :]
    assert top.sum() > 5000
    assert bottom.sum() > 5000
    same = picture("found.txt", "truth.txt")
    assert same.shape != pixels.shape or (same != pixels).any()
    assert picture("off.txt", "a.relations").shape[1] == 1200


@pytest.mark.parametrize("text", ["0 1 1 0\n1 1 1 0\n", "0 0 0 0\n1 9 0 0\n", "0 0 0 0\n1 0 9 0\n"])
def test_pictures_of_paths_without_width(text: str) -> None:
    Path("thin.txt").write_text(text)
    assert picture("thin.txt", "thin.txt").shape[0] < 2000


def test_the_same_bytes_again() -> None:
    files = []
    for name in ("a", "b"):
        assert (
            evaluate("off.txt", "truth.txt", "--json", f"{name}.json", "--png", f"{name}.png") == 0
        )
        files.append(Path(f"{name}.json").read_bytes() + Path(f"{name}.png").read_bytes())
    assert files[0] == files[1]


def test_limits(capsys: pytest.CaptureFixture[str]) -> None:
    assert evaluate("-q", "found.txt", "truth.txt", "--fail-if", "ate_rmse>0.2") == 0
    assert evaluate("-q", "off.txt", "truth.txt", "--fail-if", "ate_rmse>0.01") == 3
    assert capsys.readouterr().err.startswith("Error: off.txt: ate_rmse is 0.")
    assert evaluate("-q", "off.txt", "a.relations", "--fail-if", "relations_rot_max>14") == 3
    assert evaluate("-q", "off.txt", "truth.txt", "--fail-if", "matched_share<1") == 0


def test_the_self_check_and_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    """The corridor is driven once: there is nothing to check, and that is said."""
    with pytest.raises(SystemExit):
        main(["slam-replay", "-q", CORRIDOR, "--json", "t.json"])
    assert evaluate("t.json", "--self-check", CORRIDOR) == 1
    assert capsys.readouterr().err.startswith("Error: t.json: no place is visited twice: ")


def test_odometry_between_scans(capsys: pytest.CaptureFixture[str]) -> None:
    """The truth of the corridor at three moments only; the odometry tells what is between."""
    from mapcli.formats.documents.load_trajectory import load_trajectory

    truth = load_trajectory(CORRIDOR).trajectory
    assert truth.stamps_ns is not None
    lines = [
        f"{stamp / 1e9:.9f} {x} {y} {theta}"
        for stamp, (x, y, theta) in zip(truth.stamps_ns, truth.poses, strict=True)
    ]
    Path("few.txt").write_text("\n".join([lines[0], lines[len(lines) // 2], lines[-1]]))
    k = len(lines) // 4
    start, between = truth.poses[0], truth.poses[k]
    first, then = (f"{truth.stamps_ns[i] / 1e9:.9f}" for i in (0, k))
    x, y, theta = between - start  # the robot starts with heading 0
    Path("r.relations").write_text(f"{first} {then} {x} {y} 0 0 0 {theta}\n")
    assert start[2] == 0
    straight = document("few.txt", "r.relations")["summary"]["relations_mean"]
    carried = document("few.txt", "r.relations", "--odometry", CORRIDOR)
    assert carried["summary"]["relations_mean"] < 0.05 < straight
    assert "carried on by odometry" in carried["how"]
    assert [entry["file"] for entry in carried["input"]] == ["few.txt", "r.relations",
                                                            "corridor.mcap"]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ("found.txt", "Give either a REFERENCE or --self-check LOG; of several"),
        (
            "found.txt truth.txt --self-check a.mcap",
            "Give either a REFERENCE or --self-check LOG; of several",
        ),
        ("a.txt b.txt c.txt --self-check a.mcap --self-check b.mcap", "of several TRACEs, one LOG"),
        ("found.txt a.relations --common-frame", "--common-frame is for a REFERENCE that is a"),
        ("found.txt truth.txt --odometry a.mcap", "--odometry is for a REFERENCE that ends in"),
        ("- -", "Two inputs cannot both be standard input."),
        ("found.txt truth.txt --delta 0", "'0' is not of the form 10f (poses) or 2m (metres)."),
        ("found.txt truth.txt --delta 1.5f", "'1.5f' is not of the form"),
        ("found.txt truth.txt --fail-if ate>1", "no 'ate' in the summary; expected one of matched"),
        ("found.txt truth.txt --fail-if ate", "expected a limit such as 'ate_rmse>0.2'"),
        (
            "found.txt truth.txt --fail-if relations_mean>1",
            "no 'relations_mean' against traj",
        ),
        ("found.txt truth.txt --json - --png -", "Two results cannot both be written to standard"),
    ],
)
def test_wrong_usage(words: str, problem: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert evaluate(*words.split()) == 2
    assert problem in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ("no.txt truth.txt", "no.txt: no such file"),
        ("found.txt no.txt", "no.txt: no such file"),
        ("found.txt no.relations", "no.relations: no such file"),
        ("found.txt --self-check no.mcap", "no.mcap: no such file"),
        ("one.txt truth.txt", "one.txt: 1 pose matched by stamps at most 0.01 s apart: the trace "
         "has 1 pose from 0.000 to 0.000 s, the reference 4 poses from 0.000 to 3.000 s; expected"),
        ("late.txt truth.txt", "late.txt: 0 poses matched by stamps at most 0.01 s apart: the "
         "trace has 2 poses from 1000.000 to 1001.000 s, the reference"),
        ("late.txt a.relations", "late.txt: covers none of 3 relations: it has 2 poses from 1000"),
        ("found.txt truth.txt --delta 99m", "no two poses are 99 m apart; expected a smaller"),
        ("found.txt truth.txt --topic /pose", "truth.txt: has no topic /pose; expected a log"),
        ("found.txt truth.txt --png truth.txt", "truth.txt: is one of the files to be read"),
    ],
)  # fmt: skip
def test_bad_input(words: str, problem: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("one.txt").write_text("0 0 0 0\n")
    Path("late.txt").write_text("1000 0 0 0\n1001 0 0 0\n")
    assert evaluate(*words.split()) == 1
    said = capsys.readouterr().err
    assert problem in said
    assert said.count("\n") == 1
    assert not Path("e.json").exists()
