"""Every fault of pose tracking, from an emulator to checked states, in simulated time.

The rows of the table in `docs/concepts/safety.md`; versions and connections are tested with the
trackers.
"""

from collections import Counter
from typing import NamedTuple

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.lab.emulation.plant import FramePose
from s2c2a.lab.emulation.pose_datagrams import DatagramOptions, PoseDatagrams
from s2c2a.lab.tracking import DropReason, ModuleEnds, UdpTracker
from s2c2a.lab.tracking.datagrams import DatagramError
from s2c2a.lab.tracking.frame_jumps import FrameJumps
from s2c2a.lab.tracking.frozen_bodies import RESPONSE, FrozenBodies
from s2c2a.lab.tracking.plausibility import StateCheck

RATE = 100.0  # Hz
BEGIN = 0.5  # s
FIRST = 50  # frame of the fault
MISFIT = "does not fit the base"
UP = np.array([0.0, 0.0, 0.0, 1.0])
GEOMETRY = ArmGeometry.of(load_arm("twin_arm"))


def arm_poses(length):
    """Poses of a straight arm of three modules."""
    heights = {"base": 0.0} | {f"end-{k}": k * length for k in (1, 2, 3)}
    return {
        name: FramePose(np.array([0.0, 0.0, height]), UP)
        for name, height in heights.items()
    }


class Step(NamedTuple):
    """What a control step sees."""

    number: int
    age: float
    lost: list[int]
    reasons: tuple[str, ...]
    frozen: list[int]
    jump: np.ndarray | None


class Run:
    """One second of a stream with faults that begin after a half."""

    def __init__(self, *faults, seconds=1.0, length=0.2, noise=0.0, base="base"):
        options = DatagramOptions(rate=RATE, faults=faults, noise=noise)
        poses = arm_poses(length)
        server = PoseDatagrams(list(poses), options)
        server._send_frame = self._receive
        self.tracker = UdpTracker()
        self.dropped = Counter()
        self.steps = []
        self._check = StateCheck([length] * 3, np.deg2rad([50.0] * 3))
        self._ends = ModuleEnds.of(3, base=base)
        self._frozen = FrozenBodies(self._ends, GEOMETRY)
        self._jumps = FrameJumps(3 * length)
        command = GEOMETRY.action_neutral.copy()
        for step in range(round(seconds * RATE)):
            now = (step + 0.5) / RATE
            # cables of the second module move a little in each step
            command[1, 0] += 0.01 * GEOMETRY.action_scale[1]
            self._frozen.sent(command, now)
            server.serve(now, lambda: poses)
            self.steps.append(self._see(now))
        server.close()

    def _receive(self, content, now):
        try:
            self.tracker._handle(content, "sender", now)
        except DatagramError as error:
            self.dropped[error.reason] += 1

    def _see(self, now):
        frame = self.tracker.latest()
        if frame is None:
            return Step(-1, np.inf, [], (), [], None)
        tracked = self._ends.states(frame)
        checked = self._check(tracked, now)
        lost = np.flatnonzero(np.isnan(checked.states).any(axis=1)) + 1
        frozen = np.flatnonzero(self._frozen.find(frame)) + 1
        jump = self._jumps.find(tracked, now)
        age = now - frame.arrival_time
        reasons = checked.reasons
        return Step(frame.number, age, lost.tolist(), reasons, frozen.tolist(), jump)

    @property
    def oldest(self):
        """Largest age of a frame [frames]."""
        return max(step.age for step in self.steps) * RATE

    def loses_from_the_first_frame_on(self, rows):
        before = {tuple(step.lost) for step in self.steps[:FIRST]}
        after = {tuple(step.lost) for step in self.steps[FIRST + 1 :]}
        return before == {()} and after == {tuple(rows)}


def test_without_faults_every_step_has_a_new_frame():
    run = Run()
    assert run.tracker.counts.accepted == 100
    assert run.oldest == pytest.approx(0, abs=1e-6)
    assert not run.dropped


def test_after_lost_frames_the_newest_one_stays_and_ages():
    run = Run("0.5 lost 1", "0.6 lost 0")
    assert run.oldest == pytest.approx(10, abs=1)
    assert run.steps[-1].age == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("fault", ["0 late 0.05 0.3", "0 reordered 0.3"])
def test_frames_that_come_late_never_replace_newer_ones(fault):
    run = Run(fault)
    assert run.dropped[DropReason.LATE] > 5
    numbers = [step.number for step in run.steps]
    assert numbers == sorted(numbers)


def test_duplicated_frames_are_dropped():
    run = Run("0 duplicated 0.5")
    assert run.dropped[DropReason.DUPLICATE] > 20
    assert run.tracker.counts.accepted == 100


@pytest.mark.parametrize(
    ("fault", "rows", "reasons"),
    [
        ("swapped end-1 end-2", [1, 2], ("out of reach", MISFIT, "")),
        ("flipped end-1", [1], (MISFIT, "", "")),
        ("flipped end-2", [2], ("", MISFIT, "")),
        ("flipped end-3", [3], ("", "", MISFIT)),
        ("flipped base", [1, 2, 3], (MISFIT,) * 3),
        ("hidden end-2", [2], ("", "", "")),
        ("hidden base", [1, 2, 3], ("", "", "")),
    ],
)
def test_wrong_bodies_are_missing_from_the_first_frame_on(fault, rows, reasons):
    run = Run(f"0.5 {fault}")
    assert run.loses_from_the_first_frame_on(rows)
    assert run.steps[-1].reasons == reasons


@pytest.mark.parametrize(("body", "rows"), [("end-1", []), ("end-2", [2])])
def test_a_frozen_body_is_found_when_its_cables_have_moved(body, rows):
    run = Run(f"0.5 frozen {body}", seconds=2.0, noise=1e-4)
    answered = FIRST + round(RATE * RESPONSE)
    assert all(step.frozen == [] for step in run.steps[:answered])
    # a change of 0.1 of the action range, after the time to answer
    assert all(step.frozen == rows for step in run.steps[answered + 15 :])


def test_a_knocked_camera_is_found_once_if_no_base_is_tracked():
    run = Run("0.5 knocked 0.0058", noise=1e-4, base=None)
    jumps = [step.jump for step in run.steps if step.jump is not None]
    np.testing.assert_allclose(jumps, [[0.0058, 0.0, 0.0]], atol=5e-4)
    with_base = Run("0.5 knocked 0.0058", noise=1e-4)
    assert all(step.jump is None for step in with_base.steps)


def test_after_a_restart_frames_are_accepted_again():
    run = Run("0.5 restart 1.2", seconds=2.0)
    assert run.tracker.counts.restarts == 1
    assert run.oldest == pytest.approx(120, abs=3)
    assert run.steps[-1].age == pytest.approx(0, abs=1e-6)
    assert run.steps[-1].lost == []


def test_a_wrong_unit_of_a_long_arm_drops_the_frames():
    run = Run("0.5 millimeters")
    assert run.dropped[DropReason.IMPLAUSIBLE] == 50
    assert run.oldest == pytest.approx(50, abs=1)


def test_a_wrong_unit_of_a_short_arm_is_out_of_reach():
    run = Run("0.5 millimeters", length=0.03)
    assert run.loses_from_the_first_frame_on([1, 2, 3])
    assert run.steps[-1].reasons == ("out of reach",) * 3


def test_a_drifting_clock_has_no_effect():
    run = Run("0 drift 50", seconds=3.0)
    assert run.tracker.counts.accepted == 300
    assert run.oldest == pytest.approx(0, abs=1e-6)
    assert not run.dropped


def test_frames_without_a_key_or_with_absurd_numbers_are_dropped():
    run = Run("0 incomplete 0.2", "0 absurd 0.2")
    assert run.dropped[DropReason.MALFORMED] > 5
    assert run.dropped[DropReason.IMPLAUSIBLE] > 5
    assert run.tracker.counts.accepted > 40
    assert all(not step.lost for step in run.steps)
