"""`s2c2a bench`: how fast it is here."""

from pathlib import Path

from s2c2a.cli.console import Arm, RecipeName, print_table, progress_bar


def bench(arm: Arm = "twin_arm", recipe: RecipeName = "best", repeats: int = 1000, out: Path | None = None) -> None:
    """Time sensing, planning, control, the whole tick, collecting and training: median and 99th percentile.

    Args:
        arm: a preset or an arm file.
        recipe: whose networks and planner to time.
        repeats: of what is short.
        out: also write the timings to this JSON file.
    """
    import json
    from dataclasses import asdict

    from s2c2a.arm import load_arm
    from s2c2a.evaluation.report import versions
    from s2c2a.experiments.bench import step_timings, work_timings
    from s2c2a.strategies import recipe_from

    spec, chosen = load_arm(arm), recipe_from(recipe)
    with progress_bar() as progress:
        work, networks = work_timings(spec, chosen, progress)
    timings = step_timings(networks, repeats) + work
    rows = [(t.what, _time(t.median), _time(t.percentile_99) if t.repeats > 1 else "", str(t.repeats)) for t in timings]
    print_table(f"{spec.name}, recipe {recipe}", ("what", "median", "99th percentile", "repeats"), rows)
    if out:
        text = json.dumps({"timings_s": [asdict(timing) for timing in timings], "versions": versions()}, indent=1)
        out.write_text(text + "\n", encoding="utf-8")
        print(f"written: {out}")


def _time(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds >= 1 else f"{1e3 * seconds:.3f} ms"
