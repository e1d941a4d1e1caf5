"""Control loop with a minimal robot and driver: pace, stages, limits, and rest."""

import os
import signal

import numpy as np
import pytest

from s2c2a.errors import ControllerError, RobotError, S2C2AError, TargetError
from s2c2a.goals import PREVIEW, Goal
from s2c2a.runtime import CommandLimits, Loop, Patience, StepRequest
from s2c2a.runtime.border import check_goal
from s2c2a.spaces import Reading, Stage
from s2c2a.tasks import Task
from s2c2a.tasks.scenes import HalfSpace, goals_beside

RUN, HOLD, RELEASE, IDLE, FAULT = (
    Stage.RUN,
    Stage.HOLD,
    Stage.RELEASE,
    Stage.IDLE,
    Stage.FAULT,
)
DISABLED = StepRequest(enabled=False)
GOAL = Goal.of(3)


def sizes_of(puppet):
    """Rates and accelerations of commands, relative to their limits."""
    limits = CommandLimits.of(puppet.arm)
    commands = np.array([limits.rest, *puppet.sent])
    changes = np.diff(commands, axis=0)
    turns = np.diff(changes, axis=0, prepend=np.zeros((1, *limits.rest.shape)))
    return limits.change_sizes(changes) / limits.step_limit, limits.change_sizes(
        turns
    ) / limits.acceleration_limit


def run_steps(loop, count):
    """Records of some steps of an enabled loop."""
    return [loop.tick(StepRequest()) for _ in range(count)]


def steps_to_rest(actor):
    """Number of steps from the driver's target to rest."""
    degrees = actor.share * actor.arm.modules[0].bend_limit_deg
    return np.ceil(degrees / actor.arm.step_limit_deg)


def at_rest(puppet):
    return np.allclose(puppet.sent[-1], puppet.geometry.action_neutral, atol=1e-12)


@pytest.mark.parametrize("computing", [0.0, 0.06])
def test_steps_begin_a_control_period_apart_however_long_computing_takes(
    loop, actor, puppet, clock, computing
):
    actor.before_step = lambda number: clock.let_pass(computing)
    steps = run_steps(loop, 20)
    np.testing.assert_allclose(puppet.moments, 0.1 * np.arange(20) + computing)
    np.testing.assert_allclose([step.moment for step in steps], 0.1 * np.arange(20))
    assert [step.number for step in steps] == list(range(20))
    assert loop.late_steps == 0


def test_a_late_step_is_counted_and_missed_steps_are_skipped(
    loop, actor, puppet, clock
):
    actor.before_step = lambda number: clock.let_pass(0.35 if number == 2 else 0.0)
    steps = [loop.tick(StepRequest()) for _ in range(6)]
    np.testing.assert_allclose(
        [step.moment for step in steps], [0.0, 0.1, 0.2, 0.55, 0.6, 0.7]
    )
    np.testing.assert_allclose(
        [step.late for step in steps], [0, 0, 0, 0.25, 0, 0], atol=1e-12
    )
    assert loop.late_steps == 1


def test_a_driver_starts_once_and_gets_the_reading_and_the_goal_of_every_step(
    loop, actor
):
    goals = [Goal.of(3).with_position([0.0, 0.0, 0.1 * step]) for step in range(3)]
    steps = [loop.tick(StepRequest(goal)) for goal in goals]
    assert len(actor.starts) == 1
    times = [step.reading.time for step in steps]
    assert actor.starts[0].time == times[0]
    assert [reading.time for reading, _ in actor.steps] == times
    np.testing.assert_array_equal(
        [goal.positions for _, goal in actor.steps], [goal.positions for goal in goals]
    )
    assert [step.diagnostics["planned"][0, 0] for step in steps] == [1.0, 2.0, 3.0]
    assert [step.stage for step in steps] == [RUN] * 3


def test_a_disabled_arm_stays_at_rest_and_its_driver_is_not_called(loop, actor, puppet):
    assert {loop.tick(DISABLED).stage for _ in range(5)} == {IDLE}
    assert actor.steps == actor.starts == []
    assert at_rest(puppet)


def test_an_arm_that_is_disabled_holds_with_an_empty_goal(loop, actor):
    for _ in range(3):
        loop.tick(StepRequest(Goal.of(3).with_position([0.1, 0.0, 0.5])))
    step = loop.tick(
        StepRequest(Goal.of(3).with_position([0.3, 0.0, 0.5]), enabled=False)
    )
    assert step.stage is HOLD
    assert actor.steps[-1][1].position_weights.max() == 0
    assert len(actor.starts) == 1


def test_a_driver_that_exceeds_limits_is_slowed_and_informed_of_the_sent_command(
    loop, actor, puppet
):
    steps = [loop.tick(StepRequest()) for _ in range(12)]
    change, turn = sizes_of(puppet)
    assert change.max() == pytest.approx(1.0)
    assert turn.max() <= 1 + 1e-9
    np.testing.assert_allclose(actor.corrected, puppet.sent[: len(actor.corrected)])
    assert len(actor.corrected) == steps_to_rest(actor) - 1  # the last step arrives
    np.testing.assert_allclose(
        steps[-1].action,
        actor.share * actor.geometry.action_scale[:, None] * actor.towards_x,
    )


@pytest.mark.parametrize("share", [np.nan, np.inf, 1e300])
def test_a_driver_without_sense_moves_nothing_faster_than_the_limits(
    loop, actor, puppet, share
):
    for _ in range(5):
        loop.tick(StepRequest())
    actor.share = share
    with np.errstate(invalid="ignore", over="ignore"):
        for _ in range(20):
            assert loop.tick(StepRequest()).stage is RUN
    change, turn = sizes_of(puppet)
    assert np.isfinite(puppet.sent).all()
    assert max(change.max(), turn.max()) <= 1 + 1e-9
    assert len(actor.corrected) >= 20


def nan_cables(begin, count):
    """Fault injection: NaN cables from a step on, for a number of steps."""
    numbers = iter(range(10_000))

    def corrupt(reading: Reading) -> Reading:
        if begin <= next(numbers) < begin + count:
            return Reading(reading.time, {"cables": np.full((3, 3), np.nan)})
        return reading

    return corrupt


def test_after_a_short_fault_the_arm_continues_where_it_held(puppet, actor, clock):
    loop = Loop(puppet, actor, clock, faults=nan_cables(4, 5))
    loop.open()
    steps = [loop.tick(StepRequest()) for _ in range(15)]
    assert [step.stage for step in steps] == [RUN] * 4 + [HOLD] * 5 + [RUN] * 6
    assert {step.fault for step in steps[4:9]} == {"'cables' is not finite"}
    assert {step.fault for step in steps[9:]} == {""}
    assert [len(step.diagnostics) for step in steps] == [1] * 4 + [0] * 5 + [1] * 6
    np.testing.assert_array_equal(puppet.sent[4:9], [puppet.sent[3]] * 5)
    assert len(actor.starts) == 1
    assert sizes_of(puppet)[0].max() <= 1 + 1e-9


def test_after_a_long_fault_the_arm_rests_and_stays_stopped_until_it_is_opened(
    puppet, actor, clock
):
    patience = Patience(unsound=10, alone=10)
    loop = Loop(puppet, actor, clock, faults=nan_cables(4, 40), patience=patience)
    loop.open()
    steps = [loop.tick(StepRequest()) for _ in range(60)]
    stages = [step.stage for step in steps]
    assert stages[:14] == [RUN] * 4 + [HOLD] * 10
    assert stages[14:18] == [RELEASE] * 4  # 16 deg
    assert set(stages[18:]) == {FAULT}
    assert {step.fault for step in steps[4:]} == {"'cables' is not finite"}
    assert at_rest(puppet)
    change, turn = sizes_of(puppet)
    assert max(change.max(), turn.max()) <= 1 + 1e-9
    loop.open()
    assert loop.tick(StepRequest()).stage is RUN
    assert loop.fault == ""
    assert len(actor.starts) == 2


def test_an_arm_without_operator_holds_then_rests_and_can_run_again_at_once(
    puppet, actor, clock
):
    loop = Loop(puppet, actor, clock, patience=Patience(unsound=10, alone=5))
    loop.open()
    stages = [loop.tick(StepRequest()).stage for _ in range(3)]
    stages += [
        loop.tick(StepRequest(enabled=False, operator_present=False)).stage
        for _ in range(15)
    ]
    count = int(steps_to_rest(actor))
    assert stages == [RUN] * 3 + [HOLD] * 6 + [RELEASE] * count + [IDLE] * (9 - count)
    assert loop.tick(StepRequest()).stage is RUN
    assert len(actor.starts) == 2


def test_a_release_needs_no_sound_reading(puppet, actor, clock):
    loop = Loop(puppet, actor, clock, faults=nan_cables(5, 1000))
    loop.open()
    for _ in range(5):
        loop.tick(StepRequest())
    # one more than the distance takes, to reverse
    assert [step.stage for step in loop.to_rest()] == [RELEASE] * 6 + [IDLE]
    assert at_rest(puppet)


def test_an_arm_whose_sensors_never_become_sound_does_not_start(puppet, actor, clock):
    loop = Loop(puppet, actor, clock, faults=nan_cables(0, 1000))
    loop.open()
    stages = [loop.tick(StepRequest()).stage for _ in range(14)]
    assert stages == [Stage.START] * 10 + [FAULT] * 4
    assert actor.starts == []
    assert at_rest(puppet)


def interrupt(number):
    if number == 7:
        raise KeyboardInterrupt


def fail(number):
    if number == 7:
        raise OSError("cable torn")


@pytest.mark.parametrize("fault", [fail, interrupt])
@pytest.mark.parametrize("where", ["before_read", "before_send", "before_step"])
def test_after_any_error_a_real_arm_moves_to_rest_within_limits_and_is_closed(
    puppet, actor, clock, where, fault
):
    calls = iter(range(100))
    faulty = actor if where == "before_step" else puppet
    setattr(faulty, where, lambda number: fault(next(calls)))
    expected = (RobotError, ControllerError, KeyboardInterrupt)
    with pytest.raises(expected), Loop(puppet, actor, clock) as loop:
        run_steps(loop, 20)
    assert 6 <= len(actor.steps) <= 8
    assert at_rest(puppet)
    assert puppet.notes == ["open", "close"]
    assert sizes_of(puppet)[0].max() <= 1 + 1e-9
    assert np.diff(puppet.moments).min() == pytest.approx(0.1, abs=0.1 + 1e-9)
    assert np.median(np.diff(puppet.moments[-6:])) == pytest.approx(0.1)


@pytest.mark.usefixtures("interruptible")
def test_interrupts_during_the_return_to_rest_do_not_leave_the_arm_bent(
    puppet, actor, clock
):
    def interrupt_twice(number):
        if number == 8:
            puppet.before_send = lambda sent: os.kill(os.getpid(), signal.SIGINT)
            raise KeyboardInterrupt

    actor.before_step = interrupt_twice
    with pytest.raises(KeyboardInterrupt), Loop(puppet, actor, clock) as loop:
        run_steps(loop, 20)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert at_rest(puppet)
    assert puppet.notes == ["open", "close"]


def test_an_error_outside_the_loop_moves_the_arm_to_rest_too(puppet, actor, clock):
    with pytest.raises(ZeroDivisionError), Loop(puppet, actor, clock) as loop:
        1 / (run_steps(loop, 8)[-1].late)
    assert at_rest(puppet)
    assert puppet.notes == ["open", "close"]


def test_the_path_to_rest_after_a_long_wait_is_paced(puppet, actor, clock):
    with Loop(puppet, actor, clock) as loop:
        run_steps(loop, 8)
        clock.let_pass(60.0)
    assert at_rest(puppet)
    np.testing.assert_allclose(np.diff(puppet.moments[8:]), 0.1)


def test_a_robot_that_fails_for_good_is_closed(puppet, actor, clock):
    def disconnect(number):
        if number >= 7:
            raise OSError("cable torn")

    puppet.before_send = disconnect
    with (
        pytest.raises(
            RobotError, match=r"Puppet\.send failed in step 7: OSError: cable torn"
        ),
        Loop(puppet, actor, clock) as loop,
    ):
        run_steps(loop, 20)
    assert puppet.notes == ["open", "close"]


def test_a_robot_that_does_not_open_is_closed(puppet, actor, clock):
    puppet.before_read = lambda number: (_ for _ in ()).throw(OSError("no power"))
    expected = r"Puppet\.open failed in step 0: OSError: no power"
    with pytest.raises(RobotError, match=expected), Loop(puppet, actor, clock):
        pass
    assert puppet.notes == ["open", "close"]
    assert puppet.sent == []


def test_closing_a_loop_that_was_never_opened_moves_nothing(puppet, actor, clock):
    Loop(puppet, actor, clock).close()
    assert (puppet.notes, puppet.sent) == (["close"], [])


def test_after_an_error_every_tick_repeats_it_until_the_arm_is_opened_again(
    loop, puppet
):
    puppet.before_send = fail
    with pytest.raises(RobotError, match="cable torn"):
        run_steps(loop, 20)
    assert loop.phase.stage is FAULT
    puppet.before_send = lambda number: None
    with pytest.raises(S2C2AError, match="cable torn"):
        loop.tick(StepRequest())
    assert list(loop.to_rest()) == []
    loop.open()
    assert loop.tick(StepRequest()).stage is RUN


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        (Goal.of(4), r"positions of shape \(4, 3\), .* begin with Goal.of\(3\)"),
        *(
            (GOAL._replace(**{name: value}), f"{name} of shape .* begin with Goal.of")
            for name, value in Goal.of(4)._asdict().items()
            if value.shape != getattr(GOAL, name).shape
        ),
        (GOAL._replace(obstacles=np.zeros((1, 3))), r"obstacles of shape \(1, 3\)"),
        (GOAL._replace(change_weight=np.ones(3)), r"change_weight of shape \(3,\)"),
        (
            GOAL._replace(preview=np.full((PREVIEW, 3, 6), 300)),
            "the preview of the goal has a coordinate of 300 m",
        ),
        (
            GOAL.with_obstacles([[0.2, 0, 0.3]], [30]),
            "an obstacle, by its radius, .* in meters",
        ),
        (
            GOAL.with_obstacles([[200, 0, 300]], [30]),
            "an obstacle, by its radius, .* in meters",
        ),
        (
            Goal.of(3).with_position([300, 0, 0]),
            r"300 m, and .* at most 0.6 m; .* meters",
        ),
    ],
)
def test_a_goal_that_is_none_for_the_arm_is_refused_and_the_next_one_goes_on(
    loop, goal, words
):
    run_steps(loop, 2)
    with pytest.raises(TargetError, match=words):
        loop.tick(StepRequest(goal))
    assert run_steps(loop, 1)[0].stage is RUN
    with pytest.raises(TargetError):
        next(iter(Task("far", (Goal.of(3), goal)).shown_goals(loop.arm)))


def test_what_is_no_goal_is_refused_where_it_is_given(loop):
    for position in (np.array([0.1, 0, 0.5]), [0.1, 0, 0.5], "circle"):
        for gives in (StepRequest, lambda goal: check_goal(goal, loop.arm)):
            with pytest.raises(TargetError, match=r"Goal.of\(3\).with_position"):
                gives(position)
        with pytest.raises(TargetError, match=r"Goal.of\(3\).with_position"):
            Task("positions", (GOAL, position))


@pytest.mark.parametrize("request_", [[0.1, 0, 0.5], GOAL, None, "circle"])
def test_a_step_asked_for_by_something_else_is_refused_and_the_next_one_goes_on(
    loop, request_
):
    with pytest.raises(TargetError, match=r"needs StepRequest\(goal\), got "):
        loop.tick(request_)
    assert run_steps(loop, 1)[0].stage is RUN


def test_far_obstacles_and_walls_as_large_spheres_are_goals(loop):
    solids = [[0, 0, 900], [0, 51, 0], [0, 0, -50]], [0.1, 50, 49.9]
    wall = HalfSpace(point=(0, 0, -3), normal=(0, 0, 1)).rows()
    goals = [GOAL.with_obstacles(*solids), *goals_beside([GOAL], wall)]
    for goal in goals:
        assert loop.tick(StepRequest(goal)).goal is not None


def test_a_driver_for_another_arm_or_with_a_missing_sensor_is_refused(
    puppet, actor, clock, make_arm
):
    actor.sensors = ("cables", "flex")
    with pytest.raises(
        S2C2AError, match="needs flex; the robot provides cables, warmth"
    ):
        Loop(puppet, actor, clock)
    actor.sensors, actor.arm = ("cables",), make_arm(2)
    with pytest.raises(S2C2AError, match=r"\(2, 3\); 'twin_arm' has \(3, 3\)"):
        Loop(puppet, actor, clock)


def test_a_driver_without_a_method_is_refused(puppet, actor, clock, monkeypatch):
    for method in ("sent", "diagnostics"):
        monkeypatch.delattr(type(actor), method)
    with pytest.raises(S2C2AError, match=r"Actor has no `sent`, `diagnostics`"):
        Loop(puppet, actor, clock)


def test_a_command_of_another_shape_names_the_controller(loop, actor, monkeypatch):
    monkeypatch.setattr(actor, "act", lambda plan, estimate: np.zeros((3, 4)))
    with pytest.raises(
        S2C2AError, match=r"`act` .* Actor returned shape \(3, 4\).*\(3, 3\)"
    ):
        loop.tick(StepRequest())


def test_another_driver_starts_when_the_arm_next_runs_from_rest(loop, actor, twin):
    before = run_steps(loop, 12)[-1]
    other = type(actor)(twin)
    loop.use(other)
    # the arm is bent, and its cables follow
    assert {step.fault for step in loop.to_rest()} == {before.fault}
    loop.tick(StepRequest())
    assert (len(actor.steps), len(other.starts), len(other.steps)) == (12, 1, 1)


def test_a_sensor_that_is_not_required_may_fail(puppet, actor, clock):
    def corrupt(reading):
        return Reading(
            reading.time, {"cables": reading["cables"], "warmth": np.array(np.nan)}
        )

    loop = Loop(puppet, actor, clock, faults=corrupt)
    loop.open()
    assert {loop.tick(StepRequest()).stage for _ in range(5)} == {RUN}


def test_an_arm_with_old_readings_is_held(puppet, actor, clock):
    loop = Loop(puppet, actor, clock)
    loop.open()
    loop.tick(StepRequest())
    clock.let_pass(0.05)
    old = puppet.read()
    puppet.read = lambda: old
    assert [loop.tick(StepRequest()).stage for _ in range(4)] == [RUN, HOLD, HOLD, HOLD]
    assert "no newer" in loop.fault


@pytest.mark.parametrize("answer", [None, "nonsense", np.full((3, 3), np.nan), 1.0])
def test_an_answer_that_is_no_action_stops_the_arm(puppet, actor, clock, answer):
    send = puppet.send
    puppet.send = lambda action: send(action) if len(puppet.sent) < 3 else answer
    expected = r"Puppet\.send failed in step 3: it returned"
    with pytest.raises(RobotError, match=expected), Loop(puppet, actor, clock) as loop:
        run_steps(loop, 5)


def test_a_reading_that_is_none_stops_the_arm_and_it_is_led_to_rest(
    puppet, actor, clock
):
    read = puppet.read
    puppet.read = lambda: read() if puppet.reads < 4 else None
    expected = r"Puppet\.read failed in step \d: it returned None, not a Reading"
    with pytest.raises(RobotError, match=expected), Loop(puppet, actor, clock) as loop:
        run_steps(loop, 9)
    np.testing.assert_allclose(puppet.sent[-1], puppet.geometry.action_neutral)


def test_a_simulated_robot_that_fails_is_led_to_rest_too(puppet, actor, clock):
    puppet.own_time = True
    puppet.advance = lambda seconds: clock.let_pass(seconds)

    def fail(number):
        if number == 4:
            raise OSError("no answer")

    puppet.before_read = fail
    expected = r"Puppet\.read failed in step \d: OSError: no answer"
    with pytest.raises(RobotError, match=expected), Loop(puppet, actor, clock) as loop:
        run_steps(loop, 9)
    np.testing.assert_allclose(puppet.sent[-1], puppet.geometry.action_neutral)


@pytest.mark.parametrize("method", ["read", "send"])
@pytest.mark.parametrize("seconds", [0.3, 10.0])
def test_a_robot_that_blocks_is_reported_and_held(
    puppet, actor, clock, method, seconds
):
    def block(number):
        if number == 4:
            clock.let_pass(seconds)

    setattr(puppet, f"before_{method}", block)
    with Loop(puppet, actor, clock) as loop:
        steps = [loop.tick(StepRequest()) for _ in range(9)]
    faults = [step.fault for step in steps if step.fault]
    assert faults[0] == f"Puppet.{method} blocked for {seconds:.1f} s"
    held = [step.stage for step in steps if step.fault.startswith("Puppet")]
    assert held == [HOLD]
    # after a long gap, somebody must ask it to resume
    assert steps[-1].stage is (RUN if seconds < 2.0 else HOLD)


def leave_gap(loop, clock, seconds):
    """The record of a step that begins late, of an arm in motion."""
    run_steps(loop, 4)
    clock.let_pass(seconds)
    return loop.tick(StepRequest())


@pytest.mark.parametrize("seconds", [2.5, 30.0, 4e4])
def test_after_a_long_gap_the_arm_is_held_until_it_is_asked_to_resume(
    loop, puppet, actor, clock, seconds
):
    step = leave_gap(loop, clock, seconds)
    held = puppet.sent[-1]
    steps = [step, *run_steps(loop, 20)]
    assert {step.stage for step in steps} == {HOLD}
    assert "the program stood still for" in loop.standstill
    assert {step.fault for step in steps} == {loop.standstill}
    np.testing.assert_array_equal(puppet.sent[-1], held)
    assert len(actor.steps) == 4
    loop.resume()
    assert loop.tick(StepRequest()).stage is RUN
    assert loop.fault == loop.standstill == ""


def test_a_short_gap_needs_nobody(loop, clock):
    assert leave_gap(loop, clock, 1.9).stage is RUN


def test_a_controller_that_takes_too_long_in_motion_moves_nothing(
    loop, puppet, actor, clock
):
    actor.before_step = lambda number: clock.let_pass(30.0 if number == 4 else 0.0)
    run_steps(loop, 4)
    before = puppet.sent[-1]
    assert loop.tick(StepRequest()).stage is HOLD
    np.testing.assert_array_equal(puppet.sent[-1], before)


def test_a_controller_that_compiles_at_rest_may_take_long(loop, actor, clock):
    actor.before_step = lambda number: clock.let_pass(30.0 if number == 0 else 0.0)
    assert {step.stage for step in run_steps(loop, 5)} == {RUN}


def test_an_arm_that_nobody_resumes_goes_to_rest_and_stays_there(loop, puppet, clock):
    leave_gap(loop, clock, 30.0)
    alone = StepRequest(operator_present=False)
    stages = [loop.tick(alone).stage for _ in range(140)]
    assert stages[-1] is IDLE
    assert at_rest(puppet)
    assert {step.stage for step in run_steps(loop, 5)} == {IDLE}


def test_a_computer_that_slept_is_noticed_though_its_clock_stood(
    loop, clock, monkeypatch
):
    run_steps(loop, 4)
    monkeypatch.setattr(clock, "with_sleep", lambda: clock.now() + 600.0)
    assert loop.tick(StepRequest()).stage is HOLD


def test_a_simulation_with_its_own_time_resumes_by_itself(puppet, actor, clock):
    puppet.own_time = True
    loop = Loop(puppet, actor, clock)
    loop.open()
    assert leave_gap(loop, clock, 30.0).stage is RUN


@pytest.mark.parametrize(
    "error", [OSError("noise"), RobotError("noise"), SystemExit(3)]
)
@pytest.mark.parametrize("every", [2, 5])
def test_single_failures_do_not_end_the_way_to_rest(puppet, actor, clock, every, error):
    calls = iter(range(1, 1000))

    def fail(number):
        if next(calls) % every == 0:
            raise error

    with Loop(puppet, actor, clock) as loop:
        run_steps(loop, 8)
        puppet.before_send = fail
    assert at_rest(puppet)
    assert puppet.notes == ["open", "close"]
    assert sizes_of(puppet)[0].max() <= 1 + 1e-9


def test_the_way_to_rest_ends_where_the_robot_fails_for_a_second(puppet, actor, clock):
    def fail(number):
        raise OSError("unplugged")

    with Loop(puppet, actor, clock) as loop:
        run_steps(loop, 8)
        puppet.before_send = fail
        began = clock.now()
    assert clock.now() - began == pytest.approx(1.0, abs=0.15)
    assert puppet.notes == ["open", "close"]
