"""`mapcli similarity-table`: the chapter's examples, all forms of output, windows, bad input."""

from __future__ import annotations

import io
import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import FIXTURES, modules_loaded_by, run
from PIL import Image

from mapcli import load_map, load_perception
from mapcli.model.perception import GridPerceptions, ScanPerception
from mapcli.pictures.similarity import OBSTACLE

CORNER, SCAN, GRIDS = "corner.txt", "corner-scan.yaml", "corner-grids.yaml"
POINTS, LANDMARKS = "landmarks-map.yaml", "landmarks.yaml"

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (CORNER, SCAN, GRIDS, POINTS, LANDMARKS):
        shutil.copy(FIXTURES / name, tmp_path)
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def table(capsys: Capture) -> Callable[..., dict[str, Any]]:
    def made(*arguments: str) -> dict[str, Any]:
        assert run("similarity-table", *arguments, "--format", "json") == 0
        return dict(json.loads(capsys.readouterr().out))

    return made


Table = Callable[..., dict[str, Any]]

# --- Sect. 9.5


@pytest.mark.parametrize("perception", [SCAN, GRIDS])
def test_the_corner(table: Table, perception: str) -> None:
    """The robot is in the right cell and turned 15 degrees clockwise; all others score less."""
    found = table(CORNER, perception)
    assert found["format"] == "mapcli.similarity-table"
    assert [entry["file"] for entry in found["input"]] == [perception, CORNER]
    assert found["rows"] == ["intended", "up", "down", "left", "right"]
    assert found["columns"] == [0, -15, 15]
    values = np.array(found["values"])
    assert values.shape == (5, 3)
    best = values[0, 1]
    assert np.sort(values.ravel())[-2] < best
    assert found["best"] == {
        "position": "intended", "turn_deg": -15, "score": best,
        "pose": {"x": 6.5, "y": 3.5, "theta": pytest.approx(math.radians(75), abs=1e-6)},
        "overlap": found["overlap"][0][1],
    }  # fmt: skip
    assert found["ties"] == []
    # Everything that both know agrees.
    assert best == found["overlap"][0][1]


def test_the_grids_are_the_scans_written_out() -> None:
    """Fig. 9.20: of each of the fifteen, the part of five rows of eight cells."""
    from mapcli.algorithms.similarity.candidate_poses import CandidateFrame, neighbour_candidates
    from mapcli.algorithms.similarity.grid_table import scan_perception_map

    grid = load_map(CORNER).grid
    scan, written = load_perception(SCAN), load_perception(GRIDS)
    assert isinstance(scan, ScanPerception)
    assert isinstance(written, GridPerceptions)
    candidates = neighbour_candidates(scan.steps, scan.turns_deg)
    assert len(written.candidates) == 15
    for candidate in written.candidates:
        place = candidates.names.index(candidate.position)
        turn = candidates.turns_deg.index(candidate.turn_deg)
        pose = candidates.pose(CandidateFrame(scan.intended_pose.pose(grid)), place, turn)
        perceived = scan_perception_map(grid, scan, pose)
        assert candidate.cells.shape == (5, 8)
        for (row, column), value in np.ndenumerate(candidate.cells):
            v, u = grid.rows - 1 - (row + 1) - perceived.bottom, column + 2 - perceived.left
            inside = 0 <= v < perceived.values.shape[0] and 0 <= u < perceived.values.shape[1]
            assert value == (perceived.values[v, u] if inside else 0)


@pytest.mark.parametrize("similarity", ["agreement", "jaccard", "correlation", "l1", "l2"])
def test_other_functions_find_the_corner_too(table: Table, similarity: str) -> None:
    found = table(CORNER, SCAN, "--similarity", similarity)
    assert (found["best"]["position"], found["best"]["turn_deg"]) == ("intended", -15)
    assert found["best"]["score"] == (0 if similarity in ("l1", "l2") else 1)


def test_the_table_for_people(capsys: Capture) -> None:
    assert run("similarity-table", CORNER, SCAN) == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert (
        said.out
        == """\
Similarity product: S, the sum of products (higher is better)

                   intended heading    15 deg clockwise    15 deg counter-clockwise
intended position                47                  59 *                        43
up one cell                      42                  42                          42
down one cell                    35                  41                          37
left one cell                    46                  47                          41
right one cell                   42                  47                          37

  best      intended position, 15 deg clockwise: 59
  pose      x 6.5, y 3.5, heading 75 deg (cell 4,6)
  next      intended position, intended heading: 47
"""
    )


def test_csv_and_markdown(capsys: Capture) -> None:
    assert run("similarity-table", CORNER, SCAN, "--format", "csv") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["position\\turn_deg,0,-15,15", "intended,47,59,43"]
    assert run("similarity-table", CORNER, SCAN, "--format", "markdown") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[2] == "| intended position | 47 | **59** | 43 |"


def test_the_map_after_the_update(capsys: Capture) -> None:
    """Fig. 9.22: unknown cells that were perceived are known now, others stay."""
    assert run("similarity-table", "-q", CORNER, SCAN, "--update", "after.txt") == 0
    assert capsys.readouterr().out == ""
    before, after = load_map(CORNER).grid, load_map("after.txt").grid
    # The sensor reaches one row below the map, which grows (Sect. 9.7).
    assert (after.rows, after.columns, after.origin.y) == (before.rows + 1, before.columns, -1)
    kept = after.cells[:-1]
    changed = (kept != before.cells) & ~(np.isnan(kept) & np.isnan(before.cells))
    assert np.isnan(before.cells[changed]).all()
    assert [list(cell) for cell in np.argwhere(changed & (kept == 1))] == [
        [0, 2], [0, 3], [0, 9], [0, 10]]  # fmt: skip
    assert run("similarity-table", "-q", CORNER, GRIDS, "--update", "grids.txt") == 0
    assert load_map("grids.txt").grid.cells.shape == before.cells.shape


def test_probabilities_that_agree_stay(tmp_path: Path) -> None:
    Path("m.txt").write_text("0.2 0.9 ? 0.6\n")
    Path("p.yaml").write_text(
        "kind: grids\ncandidates:\n- {position: intended, turn_deg: 0, rows: ['-1 1 1 -1']}\n"
    )
    assert run("similarity-table", "-q", "m.txt", "p.yaml", "--update", "-") == 0
    assert (
        run("similarity-table", "-q", "m.txt", "p.yaml", "--low", "0.7", "--update", "n.txt") == 0
    )
    assert load_map("n.txt").grid.cells[0].tolist() == pytest.approx([0.2, 0.9, 1, 0.6])


# --- Activity 9.4


def test_the_landmarks(table: Table, capsys: Capture) -> None:
    """With bearings in radians ((0, 1), -15 deg) wins, as the book says; the obstacle at (3, 0)
    seen from there is at (3, 0) again, and elsewhere from the intended pose."""
    found = table(POINTS, LANDMARKS, "--locate", "3.16228,-3.43495")
    assert (found["similarity"], found["better"]) == ("l1", "lower")
    assert found["best"]["pose"] == {"x": 0, "y": 1, "theta": pytest.approx(-0.261799)}
    assert found["best"]["score"] == pytest.approx(1.717, abs=5e-4)
    assert sorted(np.ravel(found["values"]))[1] == pytest.approx(1.874, abs=5e-4)
    assert found["values"][1][0] == pytest.approx(1.874, abs=5e-4)
    (located,) = found["located"]
    assert located["from_best"] == pytest.approx({"x": 3, "y": 0}, abs=1e-4)
    assert located["from_intended"] == pytest.approx({"x": 3.1566, "y": -0.1895}, abs=1e-4)


def test_with_bearings_in_degrees_another_pose_wins(table: Table) -> None:
    found = table(POINTS, LANDMARKS, "--bearing-weight", "57.29578")
    assert found["best"]["pose"] == {"x": -1, "y": 0, "theta": 0}
    assert found["best"]["score"] == pytest.approx(27.99, abs=5e-3)
    assert found["values"][1][1] == pytest.approx(30.52, abs=6e-3)


def test_a_new_obstacle_goes_into_the_points_map(capsys: Capture) -> None:
    located = ("--locate", "3.16228,-3.43495", "--update", "after.yaml")
    assert run("similarity-table", POINTS, LANDMARKS, *located) == 0
    text = capsys.readouterr().out
    assert "  x 3.000, y 0.000 from the best pose\n" in text
    assert "  x 3.157, y -0.189 from the intended pose\n" in text
    from mapcli.formats.documents.world import read_world

    points = read_world(Path("after.yaml").read_bytes(), "after.yaml").points
    assert points == pytest.approx(np.array([[2, 2], [2, 0], [2, -2], [3, 0]]), abs=1e-4)


def test_bearings_are_compared_across_the_half_turn(table: Table) -> None:
    Path("m.yaml").write_text("points: [[-2, 0.01]]\n")
    Path("p.yaml").write_text(
        "kind: landmarks\npose: {x: 0, y: 0, theta: 0}\nmeasured: [[2, -179.9]]\nturns_deg: 0\n"
    )
    assert table("m.yaml", "p.yaml")["values"][0][0] < 0.01


# --- windows


def test_a_window(table: Table, capsys: Capture) -> None:
    options = ("--window-xy", "2", "--window-theta-deg", "30", "--step-theta-deg", "5")
    found = table(CORNER, SCAN, *options)
    assert found["rows"] == [2, 1, 0, -1, -2]
    assert found["columns"] == [-2, -1, 0, 1, 2]
    assert found["peak"]["position"] == "intended"
    assert found["peak"]["turn_deg"] == -15
    assert found["values"][2][2] == 59 == found["peak"]["score"]
    assert found["second_peak"]["score"] < 59
    assert 0 < found["second_share"] < 1
    covariance = np.array(found["covariance"])
    np.testing.assert_allclose(covariance, covariance.T)
    assert (np.linalg.eigvalsh(covariance) > -1e-12).all()
    assert run("similarity-table", CORNER, SCAN, *options) == 0
    assert "  peak      59 at x 6.5, y 3.5, heading 75 deg\n" in capsys.readouterr().out


def test_a_corridor_is_uncertain_along_it_and_two_equal_rooms_are_ambiguous(table: Table) -> None:
    corridor = ["#" * 30, *["." * 30] * 3, "#" * 30]
    Path("corridor.txt").write_text("\n".join(corridor) + "\n")
    beams = [[b, 1.5 / abs(math.sin(math.radians(b)))] for b in (*range(30, 151, 5),
             *range(-150, -29, 5))]  # fmt: skip
    text = "kind: scan\npose: {cell: [2, 15], heading_deg: 0}\nrange_max: 5\nbeams: "
    Path("scan.yaml").write_text(text + json.dumps(beams) + "\n")
    window = ("--window-xy", "4", "--window-theta-deg", "0")
    covariance = table("corridor.txt", "scan.yaml", *window)["covariance"]
    assert covariance[0][0] > 4 * covariance[1][1]
    room = ["#####", "#...#", "#...#", "#...#", "#####"]
    Path("rooms.txt").write_text("\n".join(r + "?????" + r for r in room) + "\n")
    beams = [[b, 1.5 / max(abs(math.cos(math.radians(b))), abs(math.sin(math.radians(b))))]
             for b in range(-180, 180, 5)]  # fmt: skip
    text = "kind: scan\npose: {cell: [2, 4], heading_deg: 0}\nrange_max: 5\nbeams: "
    Path("scan.yaml").write_text(text + json.dumps(beams) + "\n")
    found = table("rooms.txt", "scan.yaml", "--window-xy", "8", "--window-theta-deg", "0")
    assert found["peak"]["pose"]["x"] == 2.5
    assert found["second_peak"]["pose"]["x"] == 12.5
    assert found["second_share"] == 1


def test_a_window_of_landmarks(table: Table) -> None:
    options = ("--window-xy", "1", "--step-xy", "0.25", "--window-theta-deg", "20",
               "--similarity", "l2")  # fmt: skip
    found = table(POINTS, LANDMARKS, *options)
    assert found["peak"]["score"] <= 0.802
    assert len(found["values"]) == 9


# --- pictures


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [(CORNER, SCAN), (CORNER, GRIDS), (POINTS, LANDMARKS),
     (CORNER, SCAN, "--window-xy", "2"), (POINTS, LANDMARKS, "--window-xy", "0.5")],
)  # fmt: skip
def test_pictures(arguments: tuple[str, ...]) -> None:
    for name in ("a.png", "b.png"):
        assert run("similarity-table", "-q", *arguments, "--png", name) == 0
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()
    pixels = np.asarray(Image.open(io.BytesIO(Path("a.png").read_bytes())).convert("RGB"))
    assert min(pixels.shape[:2]) > 200
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 10


# --- what is loaded


def test_small_maps_load_nothing_heavy() -> None:
    heavy = {"numba", "scipy", "PIL", "rich", "rosbags", "mcap", "gtsam", "shapely"}
    for pair in ((CORNER, SCAN), (POINTS, LANDMARKS), (CORNER, GRIDS)):
        files = [str(FIXTURES / name) for name in pair]
        assert not modules_loaded_by("similarity-table", *files) & heavy


def test_compiled_and_plain_tables_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    from mapcli.algorithms.similarity import grid_table
    from mapcli.algorithms.similarity.candidate_poses import CandidateWindow

    grid, scan = load_map(CORNER).grid, load_perception(SCAN)
    assert isinstance(scan, ScanPerception)
    candidates = CandidateWindow(3, 45, None, 5).candidates(1.0)
    both = []
    for large in (math.inf, 0):
        monkeypatch.setattr(grid_table, "COMPILED_FROM", large)
        both.append(grid_table.scan_table(grid, scan, candidates, "product"))
    np.testing.assert_array_equal(both[0].values, both[1].values)
    np.testing.assert_array_equal(both[0].overlap, both[1].overlap)


# --- bad input

PLACE = "pose: {cell: [4, 6], heading_deg: 90}\nrange_max: 5\n"


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (f"kind: scan\n{PLACE}beams: []", "line 4: beams: no beams"),
        (f"kind: scan\n{PLACE}", "beams: key is missing"),
        ("kind: sonar", "line 1: kind: 'sonar'; expected scan, grids, landmarks, readings"),
        (f"kind: scan\n{PLACE}beams: [[0, far]]", "line 4: beams[0]: 'far' is not a number"),
        (f"kind: scan\n{PLACE}beams: [[0, 1], [0, .nan]]", "beams[1]: '.nan' is not a number"),
        (f"kind: scan\n{PLACE}beams: [[0, 1, 2]]", "beams[0]: a list of 3"),
        (f"kind: scan\n{PLACE.replace('5', '-5')}beams: [[0, 1]]", "range_max: is -5"),
        ("kind: scan\npose: {cell: [9, 6], heading_deg: 90}\nrange_max: 5\nbeams: [[0, 1]]",
         "pose: cell 9,6 is outside the map; expected a place in its 8 rows and 12 columns"),
        ("kind: scan\npose: {x: -1, y: 6, theta: 0}\nrange_max: 5\nbeams: [[0, 1]]",
         "pose: x -1, y 6 (cell 1,-1) is outside the map"),
        ("kind: scan\npose: {x: 1, y: 6, theta: 0, theta_deg: 0}\nrange_max: 5\nbeams: [[0, 1]]",
         "theta_deg and theta are both given"),
        ("kind: scan\npose: {cell: [0, 0], heading_deg: 90}\nrange_max: 5\nbeams: [[0, 2]]",
         "does not overlap what the map knows at any candidate pose, so nothing can be concluded"),
        ("kind: grids\ncorner: [0, 0]\ncandidates:\n"
         "- {position: a, turn_deg: 0, rows: ['1 0', '1']}",
         "line 4: rows[1]: 1 cells; expected 2 as in the row before"),
        ("kind: grids\ncorner: [0, 0]\ncandidates:\n- {position: a, turn_deg: 0, rows: ['1 0']}\n"
         "- {position: b, turn_deg: 0, rows: ['1 0', '1 1']}",
         "line 5: rows: 2 rows of 2; expected 1 rows of 2 cells, as in the first candidate"),
        ("kind: grids\ncandidates:\n- {position: a, turn_deg: 0, rows: ['1 0']}",
         "candidates: 1 rows of 2 cells; expected 8 rows of 12 as in the map, or `corner"),
        ("kind: grids\ncorner: [7, 11]\ncandidates:\n- {position: a, turn_deg: 0, rows: ['1 0']}",
         "corner: 1 rows of 2 cells from 7,11 on do not lie in the map"),
        ("kind: grids\ncandidates:\n- {position: a, turn_deg: 0, rows: ['1 0.5']}",
         "cell '0.5'; expected -1, 0, 1 or ? (or cells: probability)"),
        ("kind: landmarks\npose: {x: 0, y: 0, theta: 0}\nmeasured: [[1, 2]]",
         "corner.txt: is a text map; draw it with mapcli render, or go on with it with mapcli "
             "slam-replay LOG --known; expected a points map for landmarks"),
        ("kind: [scan", "broken YAML"),
        ("", "is empty; expected a perception"),
    ],
)  # fmt: skip
def test_bad_input(text: str, error: str, capsys: Capture) -> None:
    Path("p.yaml").write_text(text + "\n")
    assert run("similarity-table", CORNER, "p.yaml") == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("Error: ")
    assert error in said.err
    assert said.err.count("\n") == 1


def test_another_number_of_landmarks(capsys: Capture) -> None:
    text = "kind: landmarks\npose: {x: 0, y: 0, theta: 0}\nmeasured: [[1, 2]]\n"
    Path("p.yaml").write_text(text)
    assert run("similarity-table", POINTS, "p.yaml") == 1
    assert "1 readings; expected 3, one for each point of the map" in capsys.readouterr().err
    Path("p.yaml").write_text(text.replace("[[1, 2]]", "[null, null, null]"))
    assert run("similarity-table", POINTS, "p.yaml") == 1
    assert "nothing can be concluded" in capsys.readouterr().err


GRIDS_TEXT = """kind: grids
candidates:
- {position: intended, turn_deg: 0, rows: ['1 -1']}
- {position: up, turn_deg: 0, rows: ['1 -1']}
"""


def test_all_ties_are_named(table: Table, capsys: Capture) -> None:
    Path("m.txt").write_text("1 0\n")
    Path("p.yaml").write_text(GRIDS_TEXT + "- {position: down, turn_deg: 15, rows: ['1 ?']}\n")
    assert run("similarity-table", "m.txt", "p.yaml") == 0
    note = ("Note: a tie at 2: intended position, intended heading; up one cell, intended heading; "
            "the first is taken\n")  # fmt: skip
    assert capsys.readouterr().err == note
    found = table("m.txt", "p.yaml")
    assert found["values"] == [[2, None], [2, None], [None, 1]]
    assert found["best"]["position"] == "intended"
    assert [tie["position"] for tie in found["ties"]] == ["up"]


def test_when_all_score_the_same_nothing_is_concluded(table: Table, capsys: Capture) -> None:
    Path("m.txt").write_text("1 1\n")
    Path("p.yaml").write_text(GRIDS_TEXT)
    assert run("similarity-table", "m.txt", "p.yaml") == 0
    said = capsys.readouterr()
    assert "best      none: nothing can be concluded" in said.out
    assert said.err == "Note: both candidates score 0: nothing can be concluded\n"
    assert table("m.txt", "p.yaml")["best"] is None
    assert run("similarity-table", "m.txt", "p.yaml", "--update", "after.txt") == 1
    assert not Path("after.txt").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        (CORNER,),
        (CORNER, SCAN, SCAN),
        (CORNER, GRIDS, "--window-xy", "1"),
        (POINTS, LANDMARKS, "--update", "x.yaml"),
        (CORNER, SCAN, "--update", "x.jpg"),
        (CORNER, SCAN, "--similarity", "cosine"),
        (CORNER, SCAN, "--format", "json", "--png", "-"),
        ("-", "-"),
    ],
)
def test_wrong_usage(arguments: tuple[str, ...], capsys: Capture) -> None:
    assert run("similarity-table", *arguments) == 2
    assert "Error: " in capsys.readouterr().err


def test_inputs_are_not_overwritten(capsys: Capture) -> None:
    assert run("similarity-table", CORNER, SCAN, "--update", CORNER) == 1
    assert "is one of the inputs to be read" in capsys.readouterr().err


def test_json_perceptions(table: Table) -> None:
    """JSON is read as well, with tabs; cells may be probabilities, rows lists."""
    content = {"kind": "grids", "cells": "probability", "candidates": [
        {"position": "intended", "turn_deg": 0, "rows": [[0.9, None, 0.2]]},
        {"position": "up", "turn_deg": 0, "rows": ["?.#"]}]}  # fmt: skip
    Path("p.json").write_text(json.dumps(content, indent="\t"))
    Path("m.txt").write_text("1 1 0\n")
    assert table("m.txt", "p.json")["values"] == [[2], [-2]]


def test_where_a_map_lies_makes_no_difference(table: Table) -> None:
    """The same map turned by 30 degrees and moved, at half the resolution, and the same scan."""
    cells = "".join(line for line in Path(CORNER).read_text().splitlines(keepends=True)
                    if not line.startswith("#"))  # fmt: skip
    yaw = math.radians(30)
    Path("turned.txt").write_text(f"resolution: 0.5\norigin: 7, -3, {yaw!r}\n{cells}")
    scan = load_perception(SCAN)
    assert isinstance(scan, ScanPerception)
    beams = [[math.degrees(b), None if math.isinf(r) else r / 2] for b, r in scan.beams.tolist()]
    x = 7 + 0.5 * (6.5 * math.cos(yaw) - 3.5 * math.sin(yaw))
    y = -3 + 0.5 * (6.5 * math.sin(yaw) + 3.5 * math.cos(yaw))
    Path("p.json").write_text(json.dumps({
        "kind": "scan", "pose": {"x": x, "y": y, "theta": yaw + math.pi / 2}, "range_max": 2.5,
        "beams": beams}))  # fmt: skip
    found = table("turned.txt", "p.json")
    assert found["values"] == table(CORNER, SCAN)["values"]
    assert found["best"]["pose"] == pytest.approx(
        {"x": x, "y": y, "theta": yaw + math.radians(75)}, abs=1e-5
    )


def test_a_laser_off_the_robots_centre(table: Table) -> None:
    """A laser one cell ahead of the robot, in the book's corner."""
    text = Path(SCAN).read_text()
    moved = text.replace("{cell: [4, 6], heading_deg: 90}", "{x: 6.5, y: 2.5, theta_deg: 90}")
    assert moved != text
    laser = "laser: {x: 1, y: 0, theta_deg: 0}\n"
    Path("p.yaml").write_text(moved.replace("steps: 1\n", f"{laser}steps: 0\nturns_deg: 0\n")
                              .replace("turns_deg: [0, -15, 15]\n", ""))  # fmt: skip
    # At the intended heading the laser is where it is in the table's first entry.
    assert table(CORNER, "p.yaml")["values"] == [[47]]


# --- Limits and pipelines


def test_limits(capsys: Capture, table: Table) -> None:
    """The robot of Sect. 9.5 is in the intended cell, turned by 15 degrees; 59 beats 47."""
    summary = table(CORNER, SCAN)["summary"]
    assert summary == {
        "candidates": 15, "score": 59, "overlap": 59, "ties": 0, "margin": 12, "distance": 0,
        "turn_deg": -15, "at_border": False,
    }  # fmt: skip
    arguments = ("similarity-table", "-q", CORNER, SCAN)
    assert run(*arguments, "--fail-if", "ties>0", "--fail-if", "margin<12") == 0
    assert run(*arguments, "--fail-if", "turn_deg!=0") == 3
    expected = f"{SCAN}: turn_deg is -15; expected not turn_deg!=0 (--fail-if)"
    assert capsys.readouterr().err == f"Error: {expected}\n"


def test_limits_on_a_window(table: Table) -> None:
    summary = table(CORNER, SCAN, "--window-xy", "1")["summary"]
    assert summary["ties"] == 5  # six headings score 59
    assert summary["margin"] == 12
    assert not summary["at_border"]


@pytest.mark.parametrize("similarity", ["product", "l1"])
def test_where_nothing_can_be_concluded_no_limit_on_the_score_is_met(similarity: str) -> None:
    Path("hall.txt").write_text("\n".join(["0 " * 11] * 11))
    Path("here.yaml").write_text(
        "kind: scan\npose: {cell: [5, 5], heading_deg: 90}\nrange_max: 2\nbeams: [[0, null]]\n"
        "no_return: clear\nturns_deg: [0]\n"
    )
    arguments = ("similarity-table", "-q", "hall.txt", "here.yaml", "--similarity", similarity)
    limits = {"product": "score<-1000", "l1": "score>1000"}[similarity], "distance>9", "margin<=0"
    for limit in limits:
        assert run(*arguments, "--fail-if", limit) == 3, limit


@pytest.mark.parametrize("form", ["table", "json", "csv", "markdown"])
def test_quiet_prints_what_was_asked_for_and_nothing_else(capsys: Capture, form: str) -> None:
    assert run("similarity-table", CORNER, SCAN, "--format", form) == 0
    loud = capsys.readouterr()
    assert run("similarity-table", "-q", CORNER, SCAN, "--format", form) == 0
    assert capsys.readouterr() == (loud.out, "")
    assert loud.out
    assert run("similarity-table", "-q", CORNER, SCAN) == 0
    assert capsys.readouterr() == ("", "")


def test_all_candidates_in_one_picture() -> None:
    """Figs. 9.19 and 9.20: fifteen perception maps, five rows of three, the best with its score."""
    assert run("similarity-table", "-q", CORNER, SCAN, "--png", "all.png", "--candidates") == 0
    with Image.open("all.png") as image:
        width, height = image.size
        cells = np.asarray(image.convert("RGB"))
    obstacles = (cells == OBSTACLE).all(axis=2)
    assert all(
        part.any()
        for row in np.array_split(obstacles, 5)
        for part in np.array_split(row, 3, axis=1)
    )
    assert width < height


def test_candidates_need_a_picture_and_a_map(capsys: Capture) -> None:
    assert run("similarity-table", CORNER, SCAN, "--candidates") == 2
    assert "--candidates needs --png, and a scan or perception maps" in capsys.readouterr().err
