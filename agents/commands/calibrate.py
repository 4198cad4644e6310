"""`llrp calibrate`: what a Thymio's units are in metres, from a drive of one metre, ten turns and a tape measure."""

import argparse
import math

from agents.commands import options

_STRAIGHT_M_S = 0.1
_SPIN_RAD_S = 2.0
_PAPER_M = 0.10
_MIDDLE = 2


def configure(parser: argparse.ArgumentParser) -> None:
    """Its words."""
    options.add_config(parser, "configs/thymio.toml")
    options.add_port(parser)
    parser.add_argument("--metres", type=float, default=1.0, help="how far it drives straight on (default 1)")
    parser.add_argument("--turns", type=float, default=10.0, help="how often it turns on the spot (default 10)")
    parser.epilog = (
        "It asks what to measure, and prints the [thymio] table to put into your robot's file.\n\n"
        "example:\n  llrp calibrate --port /dev/ttyACM0"
    )


def run(arguments: argparse.Namespace) -> int:
    """Drive, ask, compute, print."""
    print(
        f"Calibration of a Thymio: {arguments.metres:g} m straight on, {arguments.turns:g} turns on the spot, and "
        "something white before its nose.\nIt stops when you press Ctrl-C.\n",
        flush=True,
    )
    options.need_thymio()
    from agents.robots.thymio import calibration, proximity

    settings = options.load_configuration(arguments).thymio
    straight_units, turns_rad = round(_STRAIGHT_M_S / settings.speed_unit_m_s), arguments.turns * 2 * math.pi
    spin_units = round(_SPIN_RAD_S * settings.track_m / 2 / settings.speed_unit_m_s)

    _wait(
        f"1. Lay a tape measure on the floor, {arguments.metres + 0.3:g} m free, the robot at its beginning along it."
    )
    straight = calibration.roll(
        settings.port,
        straight_units,
        straight_units,
        lambda leg: (leg.left + leg.right) / 2 * settings.speed_unit_m_s >= arguments.metres,
    )
    ahead_m = _ask("   How far did it get along the tape, in metres? ")
    aside_m = _ask("   And how far off the tape, in metres, left positive? ")

    _wait("2. Mark where it looks: a line along its side. It turns to the left.")
    spin = calibration.roll(
        settings.port,
        -spin_units,
        spin_units,
        lambda leg: (leg.right - leg.left) * settings.speed_unit_m_s / settings.track_m >= turns_rad,
    )
    past_deg = _ask(f"   How many degrees is it past {arguments.turns:g} whole turns (negative: short of them)? ")
    turned_rad = turns_rad + math.radians(past_deg)
    found = calibration.solve(straight, ahead_m, aside_m, spin, turned_rad)
    _wait(f"3. Stand something white upright, exactly {100 * _PAPER_M:g} cm before the middle of its front.")
    value = calibration.feel(settings.port, _MIDDLE)
    half_m = proximity.half_m(_PAPER_M, value, settings.proximity_peak)
    print(
        "\nPut this into your robot's file:\n\n[thymio]\n"
        f"speed_unit_m_s = {found.speed_unit_m_s:.7f}\n"
        f"left_scale = {found.left_scale:.4f}\nright_scale = {found.right_scale:.4f}\n"
        f"track_m = {found.track_m:.4f}\n"
        f"proximity_half_m = {half_m:.4f}"
    )
    return 0


def _wait(what: str) -> None:
    print(what)
    _answer("   Enter, and it begins. ")


def _ask(what: str) -> float:
    while True:
        answer = _answer(what)
        try:
            value = float(answer.replace(",", "."))
        except ValueError:
            value = math.nan
        if math.isfinite(value):
            return value
        print(f"   {answer!r} is no number; expected such as 0.97")


def _answer(what: str) -> str:
    try:
        return input(what)
    except EOFError:
        raise ValueError("calibrate asks questions: run it in a terminal") from None
