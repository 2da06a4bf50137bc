"""The result of a sizing for people: tables, and what they mean in plain sentences."""

from __future__ import annotations

from collections.abc import Sequence

from gantryctl.engineering.report.text import TextTable, decimals, figure
from gantryctl.engineering.sizing import equations as eq
from gantryctl.engineering.sizing.checks import Fit, usable_torque_nm, wrap_margin_deg
from gantryctl.engineering.sizing.loading import is_reference_sheet
from gantryctl.engineering.sizing.paper_figures import printed_acceleration_rad_s2, printed_torque_nm
from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.engineering.sizing.train import over_angle
from gantryctl.units import behind, deg


def first_table(sheet: Sheet) -> TextTable:
    """Equations (1) to (3): the load inertia alone; for the reference sheet also as the paper rounds them."""
    m, ratio, inertia = sheet.motion, sheet.gears.ratio, sheet.load.inertia_kg_m2
    speed = eq.motor_speed_r_min(m.speed_max_r_min, ratio)
    acc = eq.mean_acceleration_rad_s2(m.speed_max_r_min, m.sizing_time_s)
    exact = eq.motor_torque_nm(inertia, acc, ratio)
    names = (
        "(1) motor speed n1 = i n2, r/min",
        "acceleration alpha2, rad/s2",
        "(2) motor torque T1 = J alpha2/i, N m",
        "(3) power P = T1 n1/9550, kW",
    )
    figures = (f"{speed:.6g}", f"{acc:.6g}", f"{exact:.5g}", f"{eq.power_kw(exact, speed):.5g}")
    if not is_reference_sheet(sheet):
        return TextTable("Load inertia alone", ("", ""), tuple(zip(names, figures, strict=True)))
    rounded = printed_torque_nm(sheet)
    printed = (
        f"{speed:.0f}",
        f"{printed_acceleration_rad_s2(sheet):g}",
        f"{rounded:g}",
        f"{eq.power_kw(rounded, speed):.2f}",
    )
    heads = ("", "as printed", "exact")
    return TextTable(
        "The paper's equations: load inertia only", heads, tuple(zip(names, printed, figures, strict=True))
    )


def complete_table(fitted: Fit) -> TextTable:
    """The complete torque by parts: the sizing case and a normal move."""
    train = fitted.train
    sizing, normal = train.parts(train.sizing_acc_rad_s2), train.parts(train.normal_acc_rad_s2)
    accs = (train.sizing_acc_rad_s2, train.normal_acc_rad_s2)
    together = [train.largest_nm(acc) for acc in accs]
    places = decimals(together, 1)
    rows: list[tuple[str, ...]] = [
        (a.name, f"{a.torque_nm:.{places}f}", f"{b.torque_nm:.{places}f}")
        for a, b in zip(sizing, normal, strict=True)
    ]
    rows.append(("together", *(f"{torque:.{places}f}" for torque in together)))
    rows.append(
        ("efficiency of the transmission, %", *(f"{100.0 * train.efficiency(acc):.0f}" for acc in accs))
    )
    heads = (f"motor torque, N m ({fitted.motor.name})", *(f"at {deg(acc):.4g}\ndeg/s2" for acc in accs))
    return TextTable("What they leave out: the largest torque, at the highest speed", heads, tuple(rows))


def angle_table(fitted: Fit) -> TextTable:
    """The eccentric moment over the angle."""
    heads = ("angle, deg", "moment\nkN m", "hold\nN m", "turn out\nN m", "turn back\nN m", "normal acc\nN m")
    found = over_angle(fitted.train)
    moment = decimals([row.against_knm for row in found], 1)
    motor = decimals([torque for row in found for torque in row[2:]], 1)
    rows = tuple(
        (
            f"{row.angle_deg:g}",
            f"{row.against_knm:.{moment}f}",
            *(f"{torque:.{motor}f}" for torque in row[2:]),
        )
        for row in found
    )
    return TextTable("Over the angle: eccentric moment and motor torque", (*heads, "sizing acc\nN m"), rows)


def further_table(fitted: Fit) -> TextTable:
    """Day, reducer, brake, encoder, energy."""
    rows = (*_day_rows(fitted), *_reducer_rows(fitted), *_holding_rows(fitted), *_energy_rows(fitted))
    return TextTable(f"Further ({fitted.motor.name})", ("", ""), rows)


Rows = tuple[tuple[str, str], ...]


def _day_rows(fitted: Fit) -> Rows:
    day = fitted.duty
    return (
        ("one cycle: moving; whole", f"{day.moving_s:.0f} s; {day.cycle_s:.0f} s"),
        (
            "r.m.s. torque: of a cycle; of the day",
            f"{figure(day.cycle_rms_nm, 1)} N m; {figure(day.day_rms_nm, 1)} N m",
        ),
    )


def _reducer_rows(fitted: Fit) -> Rows:
    """A step of the acceleration swings the load up to twice as far as its steady value."""
    train, gears = fitted.train, fitted.train.sheet.gears
    cases = {"normal move": train.normal_acc_rad_s2, "sizing case": train.sizing_acc_rad_s2}
    reducer = tuple(
        (
            f"reducer, {name}: rigid; swinging after a step",
            f"{figure(train.reducer_nm(acc) / 1e3, 1)} kN m; {figure(train.reducer_nm(acc, 2.0) / 1e3, 1)} kN m",
        )
        for name, acc in cases.items()
    )
    rated, momentary = gears.torque_rated_nm / 1e3, gears.torque_momentary_nm / 1e3
    usable = usable_torque_nm(train.sheet, fitted.motor)
    return (
        *reducer,
        ("reducer, given: rated; momentary", f"{figure(rated, 1)} kN m; {figure(momentary, 1)} kN m"),
        (
            "highest torque: motor; behind this reducer",
            f"{fitted.motor.motor.torque_max_nm:g} N m; {usable:g} N m",
        ),
    )


def _holding_rows(fitted: Fit) -> Rows:
    train, motor, encoder = fitted.train, fitted.motor, fitted.motor.encoder
    step = eq.encoder_step_deg(encoder.counts_per_turn, train.ratio)
    fine = eq.encoder_step_deg(encoder.lines * encoder.interpolation, train.ratio)
    turns = eq.encoder_range_turns(encoder.turns, train.ratio)
    wrap = wrap_margin_deg(train.sheet, motor)
    reserve = f", {motor.brake.torque_nm / train.hold_nm:.1f} times" if train.hold_nm else ""
    return (
        (
            "quick stop, at least",
            f"{deg(train.quick_dec_rad_s2):.2f} deg/s2, {_whole(train.quick_stop_nm)} N m",
        ),
        ("holding: needed; brake", f"{figure(train.hold_nm, 1)} N m; {motor.brake.torque_nm:g} N m{reserve}"),
        ("encoder range; wrap beyond travel", f"{turns:.2f} turns of the axis; {wrap:.1f} deg each side"),
        ("encoder step at the axis; interpolated", f"{step:.3g} deg; {fine:.2g} deg"),
    )


def _energy_rows(fitted: Fit) -> Rows:
    day, efficiency = fitted.duty, fitted.motor.motor.efficiency
    back = (
        f"{figure(efficiency * day.returned_j / 1e3, 1)} kJ; {figure(efficiency * day.returned_mean_w, 0)} W"
    )
    return (
        ("energy of motion at the highest speed", f"{figure(fitted.train.kinetic_energy_j / 1e3, 1)} kJ"),
        ("regeneration, electrical: per cycle; mean of the day", back),
        (
            "regeneration, largest: braking as in the sizing case",
            f"{figure(efficiency * fitted.train.braking_power_w / 1e3, 1)} kW",
        ),
    )


def motors_table(fits: Sequence[Fit]) -> TextTable:
    """Which motors fit."""
    heads = ("motor", "rated\nkW", "rated\nN m", "highest\nN m", "rated\nr/min", "rotor\nkg m2")
    rows = []
    for fitted in fits:
        p, tightest = fitted.motor.motor, fitted.tightest
        plate = (p.power_rated_kw, p.torque_rated_nm, p.torque_max_nm, p.speed_rated_r_min, p.inertia_kg_m2)
        answer = ("yes" if fitted.fits else "NO", tightest.name, f"{100.0 * tightest.part:.0f}")
        rows.append((fitted.motor.name, *(f"{value:g}" for value in plate), *answer))
    return TextTable("Motors", (*heads, "fits", "tightest", "used\n%"), tuple(rows))


def sentences(shown: Fit, fits: Sequence[Fit]) -> list[str]:
    """The complete torque against the paper's, the reducer, and why motors do not fit."""
    found = [_torque(shown), _acceleration(shown), *_reducer(shown)]
    for fitted in fits:
        if fitted.fits:
            tightest = fitted.tightest
            found.append(
                f"{fitted.motor.name} fits; the tightest is {tightest.name}: {tightest.used:.4g} of "
                f"{tightest.limit:.4g}{behind(tightest.unit)}."
            )
        else:
            found.append(f"{fitted.motor.name} does not fit: {'; '.join(fitted.reasons)}.")
    if not any(fitted.fits for fitted in fits):
        found.append("No motor fits; choose a larger one, or ask for less.")
    return found


def _torque(shown: Fit) -> str:
    train, motor = shown.train, shown.motor
    speed = eq.motor_speed_r_min(train.sheet.motion.speed_max_r_min, train.ratio)
    alone = eq.motor_torque_nm(train.sheet.load.inertia_kg_m2, train.sizing_acc_rad_s2, train.ratio)
    complete = train.largest_nm(train.sizing_acc_rad_s2)
    rated = motor.torque_at_nm(motor.motor.torque_rated_nm, speed)
    how = "within" if complete <= rated else "above"
    return (
        f"The sizing case takes {_whole(complete)} N m, not the {_whole(alone)} N m of its inertia: {how} the "
        f"{_whole(rated)} N m that {motor.name} gives continuously at {speed:.0f} r/min"
        + (
            f"; for {train.sheet.motion.sizing_time_s:g} s it needs its overload of {motor.motor.torque_max_nm:g} N m."
            if complete > rated
            else "."
        )
    )


def _whole(torque_nm: float) -> str:
    """A torque with three digits at least."""
    return f"{torque_nm:.0f}" if torque_nm >= 100.0 else f"{torque_nm:.3g}"


def _acceleration(shown: Fit) -> str:
    train = shown.train
    ratio = train.sizing_acc_rad_s2 / train.normal_acc_rad_s2
    return (
        f"Normal moves accelerate with {deg(train.normal_acc_rad_s2):.4g} deg/s2, {ratio:.3g} times less than the "
        f"sizing case, and take at most {_whole(train.largest_nm(train.normal_acc_rad_s2))} N m."
    )


def _reducer(shown: Fit) -> list[str]:
    train, gears = shown.train, shown.train.sheet.gears
    found = []
    # 35.2 kN m are the estimate for the reference machine; the sizing case swings it to 34 to 37 kN m on the full
    # plant.
    swinging = train.reducer_nm(train.sizing_acc_rad_s2, 2.0)
    if swinging > gears.torque_momentary_nm:
        found.append(
            f"As a step the sizing acceleration would swing the reducer up to {figure(swinging / 1e3, 0)} kN m, above "
            f"its momentary {figure(gears.torque_momentary_nm / 1e3, 1)} kN m: it needs a jerk limit. The reducer and "
            "the base are the limit, not the motor."
        )
    usable = usable_torque_nm(train.sheet, shown.motor)
    if usable < shown.motor.motor.torque_max_nm:
        found.append(
            f"The drive must limit {shown.motor.name} to {usable:.4g} N m: its {shown.motor.motor.torque_max_nm:g} N m "
            "would break the reducer."
        )
    return found
