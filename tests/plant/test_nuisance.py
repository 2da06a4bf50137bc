"""Sound machines: random plants within +-20 %, random moves, keys, stops and quick stops; no alarm nobody caused."""

from __future__ import annotations

import random

import pytest

from gantryctl.image import Mode
from gantryctl.program import PowerPhase
from gantryctl.units import rad
from plant.plant_rig import CHECK_NM, SCANS_MS, PlantRig, machine_at


def random_rig(rng: random.Random) -> PlantRig:
    def near(value: float) -> float:
        return value * rng.uniform(0.8, 1.2)

    roller, motor = near(1.0), near(1.0)
    moment_nm = rng.choice([near(16_000.0), near(16_000.0), CHECK_NM])
    machine = machine_at(
        rng.choice(SCANS_MS),
        moment_nm,
        **{
            "plant.load.inertia_kg_m2": near(2.18e6),
            "plant.transmission.rest_stiffness_nm_per_rad": near(1.5e9),
            "plant.transmission.damping_ratio": near(0.025),
            "plant.transmission.backlash_mm": near(0.05),
            "plant.roller_friction.coulomb_nm": roller * 6000.0,
            "plant.roller_friction.breakaway_nm": roller * 6800.0,
            "plant.motor_friction.coulomb_nm": motor * 5.5,
            "plant.motor_friction.breakaway_nm": motor * 6.5,
        },
    )
    return PlantRig(machine, rng.uniform(-120.0, 120.0))


def act(rig: PlantRig, rng: random.Random) -> None:
    """One thing that an operator may do, to its end."""
    speed = rad(rng.choice([0.6, 1.0, 3.0, 6.0]))
    what = rng.choice(["move", "keys", "taps", "stop", "power", "quick"])
    if what in ("move", "stop", "quick"):
        target = max(-170.0, min(170.0, rig.motor_deg + rng.uniform(-25.0, 25.0)))
        rig.say(move=True, target_rad=rad(target), speed_rad_s=speed)
        rig.say(move=False)
        rig.run(rng.uniform(0.1, 6.0))
        if what == "stop":
            rig.say(stop=True)
            rig.run(0.2)
            rig.say(stop=False)
        elif what == "quick":
            rig.say(quick_stop=True)
            rig.say(quick_stop=False)
            rig.until(lambda: rig.phase is PowerPhase.OFF, 10.0)
            rig.run(2.0)
            assert rig.codes == ["INT-06"]
            assert rig.axis.reset() is None
            rig.run(0.1)
            rig.say(power=False)
            rig.power_up(0.2)
    elif what in ("keys", "taps"):
        rig.say(mode=Mode.CONTINUOUS, speed_rad_s=speed)
        forward = rig.motor_deg < 0.0
        # Taps at the rate of the load's swing.
        on_s, off_s, times = (rng.uniform(0.1, 3.0), 1.0, 1) if what == "keys" else (0.35, 0.15, 8)
        for _ in range(times):
            left_s = on_s
            while left_s > 0.0:
                rig.say(lease=rig.op.command.lease + 1, forward=forward, reverse=not forward)
                rig.run(0.03)
                left_s -= 0.03
            rig.say(forward=False, reverse=False)
            rig.run(off_s)
    else:
        rig.until(lambda: rig.axis.at_rest, 60.0)
        rig.say(power=False)
        rig.run(2.0)
        rig.power_up(0.2)
    rig.until(lambda: rig.axis.at_rest, 60.0)
    assert not rig.codes
    assert not rig.engine.output.horn


def run_seed(seed: int, acts: int) -> None:
    rng = random.Random(seed)
    rig = random_rig(rng)
    rig.power_up(0.5)
    for _ in range(acts):
        act(rig, rng)


@pytest.mark.parametrize("seed", range(8))
def test_no_alarm_that_nobody_caused(seed):
    run_seed(seed, 6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 300))
def test_no_alarm_that_nobody_caused_in_many_runs(seed):
    run_seed(seed, 12)
