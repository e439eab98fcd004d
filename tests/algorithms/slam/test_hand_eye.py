"""The pose of a laser on a robot, from motions of both that are known."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from mapcli.algorithms.slam.hand_eye import BLOCKS, Motions, jackknife, solve


def motions(
    mount: complex,
    yaw: float,
    *,
    scale: float = 1.0,
    noise_m: float = 0.0,
    turning: float = 0.5,
    seed: int = 7,
) -> Motions:
    """Of a robot that drives and turns at random, with wheels that count 1 / scale metres for one
    and a tenth too much of all turns."""
    rng = np.random.default_rng(seed)
    turns = rng.uniform(-turning, turning, 20 * BLOCKS)
    way = rng.uniform(0.0, 0.3, len(turns)) * np.exp(0.5j * turns)  # along an arc
    noise = rng.normal(0.0, noise_m, (len(turns), 2)) @ (1, 1j)
    # The definition: where the laser is in the robot's frame, after and before, in its own axes.
    laser = (way + np.exp(1j * turns) * mount - mount) * cmath.exp(-1j * yaw) + noise
    counted = 1.1 * turns
    robot = np.abs(way) / scale * np.exp(0.5j * counted)
    return Motions(laser, robot, turns, counted, np.tile(1e-6 * np.eye(2), (len(turns), 1, 1)))


@pytest.mark.parametrize(
    ("mount", "yaw_deg"),
    [(0j, 0.0), (0.3 + 0j, 0.0), (-0.2 + 0.1j, 180.0), (0.1j, -90.0), (0.4 - 0.2j, 33.0)],
)
@pytest.mark.parametrize("scale", [1.0, 0.9])
def test_without_noise_it_is_exact(mount: complex, yaw_deg: float, scale: float) -> None:
    some = motions(mount, math.radians(yaw_deg), scale=scale)
    found, counted, unexplained = solve(some)
    assert found[:2] == pytest.approx((mount.real, mount.imag), abs=1e-9)
    assert math.cos(found[2] - math.radians(yaw_deg)) == pytest.approx(1.0)
    assert counted == pytest.approx(scale)
    assert unexplained == pytest.approx(0.0, abs=1e-9)
    assert jackknife(some) == pytest.approx(np.zeros(3), abs=1e-9)


def test_errors_are_those_of_the_noise() -> None:
    """Of the place: noise / sqrt(sum of the squared turns), but for the weights of a robust fit."""
    drives = [motions(0.3 + 0j, 0.0, noise_m=0.01, seed=seed) for seed in range(20)]
    off = np.array([solve(one).pose for one in drives]) - (0.3, 0.0, 0.0)
    errors = np.sqrt(np.mean([jackknife(one) ** 2 for one in drives], axis=0))
    turns = drives[0].turns
    expected = 0.01 / math.sqrt(float((np.abs(np.exp(1j * turns) - 1) ** 2).sum()))
    assert errors[0] == pytest.approx(expected, rel=0.3)
    assert errors == pytest.approx(np.sqrt((off**2).mean(axis=0)), rel=0.4)


def test_slipping_wheels_count_little() -> None:
    some = motions(0.3 + 0j, 0.0, noise_m=0.002)
    robot = some.robot.copy()
    robot[::8] += 0.2
    found = solve(some._replace(robot=robot)).pose
    assert found == pytest.approx((0.3, 0.0, 0.0), abs=0.01)


def test_motions_that_scans_do_not_tell_count_little() -> None:
    some = motions(0.3 + 0j, 0.0, noise_m=0.002)
    laser, variances = some.laser.copy(), some.variances.copy()
    laser[::2] = some.robot[::2]  # as if it were in the middle, where nothing else is known
    variances[::2] = np.eye(2)
    found = solve(some._replace(laser=laser, variances=variances)).pose
    assert found == pytest.approx((0.3, 0.0, 0.0), abs=0.01)


def test_straight_ahead_nothing_is_known_of_the_place() -> None:
    errors = jackknife(motions(0.3 + 0j, 0.0, noise_m=0.005, turning=1e-3))
    assert errors[0] > 0.1
    assert errors[2] < math.radians(1)


def test_turns_that_agree() -> None:
    some = motions(0j, 0.0)
    assert some.agreeing_turns() == pytest.approx(1.0)
    assert some._replace(turns=-some.turns).agreeing_turns() == 0.0
