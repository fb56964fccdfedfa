"""The driver's supply: whether it can drive the largest current through the coil when that is hot."""

from __future__ import annotations

from mrdamper.errors import InputError
from mrdamper.models.card import ModelCard
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K
from mrdamper.thermal.materials import COPPER_PER_K


def check_supply(supply_V: float, resistance_ohm: float, largest_A: float, hottest_degC: float) -> None:
    """Raise ``InputError`` where a supply has fewer volts than the coil needs.

    Parameters
    ----------
    resistance_ohm : of the coil at ``hottest_degC``
    """
    needed = resistance_ohm * largest_A
    if needed > supply_V:
        raise InputError(
            place="driver",
            found=f"its supply has {supply_V:.3g} V, which drive {supply_V / resistance_ohm:.3g} A at most "
            f"through the coil of {resistance_ohm:.3g} ohm at {hottest_degC:g} degC",
            expected=f"at least {needed:.3g} V for {largest_A:g} A",
            remedy="Give it that supply, or ask for less current or temperature",
        )


def check_card_supply(
    card: ModelCard, supply_V: float | None, *, largest_A: float, hottest_degC: float | None = None
) -> None:
    """Refuse a supply that is known and too low for a card's coil, or that cannot be judged.

    Without ``hottest_degC`` the hottest temperature of the card's data counts, 20 degC where they have none.
    """
    if supply_V is None:
        return
    actuation = card.damper.actuation
    cold = None if actuation is None else actuation.resistance_20_ohm
    if cold is None or card.damper.command_unit != "A":
        raise InputError(
            place="card",
            found=f"--supply {supply_V:g}, and the card does not know its coil's resistance",
            expected="a card in amperes with it",
            remedy="Identify with --coil-resistance OHM on runs whose current steps",
        )
    if hottest_degC is None:
        known = card.envelope.temperature
        hottest_degC = (REFERENCE_K if known is None else known[1]) - ZERO_CELSIUS_K
    warm = cold * (1.0 + COPPER_PER_K * (hottest_degC + ZERO_CELSIUS_K - REFERENCE_K))
    check_supply(supply_V, warm, largest_A, hottest_degC)
