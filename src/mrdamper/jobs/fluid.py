"""The job ``fluid``: rheometer tables in; laws with standard errors and the fluid made of them out.

What the tables do not hold (a yield stress, a density) is taken from another fluid, with its sources; the
notes say which.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.rheometer import RheometerTable
from mrdamper.errors import InputError
from mrdamper.jobs.options import FluidOptions
from mrdamper.models.fluids.carlson import field_strength
from mrdamper.models.fluids.fluid import Fluid, Origin
from mrdamper.models.fluids.rheometer import FittedParameter
from mrdamper.models.fluids.viscosity_fit import ViscosityStudy, fit_viscosity
from mrdamper.models.fluids.yield_fit import YieldStudy, fit_yield_stress
from mrdamper.models.temperature import TemperatureFactor
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.progress import Progress, silent

_USUAL = FluidOptions()


@dataclass(frozen=True, slots=True)
class FluidResult:
    """The fits of what rheometer tables hold, the fluid made of them, and notes."""

    fluid: Fluid
    like: Fluid
    viscosity: ViscosityStudy | None
    yield_stress: YieldStudy | None
    notes: tuple[str, ...]


def fluid(
    tables: Sequence[RheometerTable],
    like: Fluid,
    options: FluidOptions = _USUAL,
    *,
    on_progress: Progress = silent,
) -> FluidResult:
    """Fit the laws of rheometer tables.

    Parameters
    ----------
    tables : of viscosity, of yield stress, or of both; several of one kind are taken together
    like : the fluid that gives what the tables do not hold

    Raises
    ------
    InputError
        Tables that no law can be fitted to.
    """
    base, share = like, options.particle_fraction
    if share is not None:
        stated = Origin("given with the rheometer tables", "A")
        origins = {**base.origins, "properties.particle_fraction": stated}
        base = replace(base, particle_fraction=share, origins=origins)
    notes = [note for table in tables for note in table.notes]
    viscosity = _study_viscosity(tables)
    yields = _study_yield(tables, base, notes, assumed=share is None)
    made = _fluid_of(PurePath(tables[0].name).stem, base, viscosity, yields, tables)
    notes += [*(() if viscosity is None else viscosity.notes), *(() if yields is None else yields.notes)]
    if made.valid_K != base.valid_K:
        low, high = (round(end - ZERO_CELSIUS_K, 6) for end in made.valid_K)
        notes.append(f"the laws hold no further than the tables: {low:g} to {high:g} degC")
    taken = [
        word for word, study in (("the viscosity", viscosity), ("the yield stress", yields)) if study is None
    ]
    kept = ", ".join([*taken, "density and heat properties"])
    notes.append(f"{kept}: not in the tables, taken from {base.name!r} with its sources")
    return FluidResult(made, base, viscosity, yields, tuple(notes))


def _study_viscosity(tables: Sequence[RheometerTable]) -> ViscosityStudy | None:
    held = [(table.name, table.viscosity) for table in tables if table.viscosity is not None]
    if not held:
        return None
    kelvin, viscosity = (np.concatenate([columns[k] for _, columns in held]) for k in (0, 1))
    return fit_viscosity(kelvin, viscosity, place=", ".join(name for name, _ in held))


def _study_yield(
    tables: Sequence[RheometerTable], base: Fluid, notes: list[str], *, assumed: bool
) -> YieldStudy | None:
    held = [(table, table.yield_stress) for table in tables if table.yield_stress is not None]
    if not held:
        return None
    fields = []
    for table, (field, _, _) in held:
        if table.field_unit == "T":
            fields.append(_strength(field, base.particle_fraction, table.name))
            notes.append(
                f"{table.name}: flux density is taken to field strength by Carlson's curve for "
                f"{100 * base.particle_fraction:g} % of iron by volume"
                + (f" (of {base.name!r}; --particle-fraction gives another)" if assumed else "")
            )
        else:
            fields.append(field)
    kelvin, stress = (np.concatenate([columns[k] for _, columns in held]) for k in (1, 2))
    place = ", ".join(table.name for table, _ in held)
    return fit_yield_stress(np.concatenate(fields), kelvin, stress, place=place)


def _strength(flux_density_T: FloatArray, particle_fraction: float, place: str) -> FloatArray:
    most = float(np.abs(flux_density_T).max())
    if most > 5.0:
        raise InputError(
            f"a field of {most:g} T",
            place=place,
            expected="at most 5 T",
            remedy="Check the unit in the header (field_mT, field_T, field_kA_m)",
        )
    return field_strength(flux_density_T, particle_fraction)


# ------------------------------------------------------------------------------------------- the fluid


def _fluid_of(
    name: str,
    base: Fluid,
    viscosity: ViscosityStudy | None,
    yields: YieldStudy | None,
    tables: Sequence[RheometerTable],
) -> Fluid:
    """Return the base fluid with the fitted laws in place of its own."""
    made = base
    if viscosity is not None:
        best = viscosity.best
        kelvin = viscosity.temperature_K[viscosity.used]
        covered = (float(kelvin[0]), float(kelvin[-1]))
        held = [table for table in tables if table.viscosity is not None]
        source = _source(held, kelvin, f"{best.factor.kind} law")
        made = replace(
            made,
            viscosity_Pa_s=best.viscosity_Pa_s,
            viscosity_factor=best.factor,
            viscosity_fitted_K=covered,
            collapse=None,  # it belongs to the other fluid's viscosity
            valid_K=_usable(made.valid_K, best.factor, covered),
            origins={
                **{n: o for n, o in made.origins.items() if not n.startswith(("viscosity.", "collapse."))},
                **_origins("viscosity", best.parameters, source),
            },
        )
    if yields is not None:
        form = yields.best
        kelvin = yields.temperature_K[yields.used]
        held = [table for table in tables if table.yield_stress is not None]
        source = _source(held, kelvin, "Carlson's law times a linear factor")
        made = replace(
            made,
            yield_field=form.field_law,
            yield_factor=form.factor,
            valid_K=_usable(made.valid_K, form.factor, (float(kelvin.min()), float(kelvin.max()))),
            origins={
                **{n: o for n, o in made.origins.items() if not n.startswith("yield_stress.")},
                **_origins("yield_stress", form.parameters, source),
            },
        )
    title = f"Fitted to {', '.join(table.name for table in tables)}; the rest as {base.name}"
    return replace(made, name=name, title=title)


def _usable(
    valid_K: tuple[float, float], factor: TemperatureFactor, covered_K: tuple[float, float]
) -> tuple[float, float]:
    """Return the range of use: the other fluid's, or what the table covers where the law ends before."""
    with np.errstate(all="ignore"):
        values = factor.value(np.linspace(*valid_K, 101))
    return valid_K if bool((np.isfinite(values) & (values > 0.0)).all()) else covered_K


def _source(tables: Sequence[RheometerTable], kelvin: FloatArray, law: str) -> str:
    low, high = float(kelvin.min()) - ZERO_CELSIUS_K, float(kelvin.max()) - ZERO_CELSIUS_K
    names = ", ".join(table.name for table in tables)
    return f"{law} fitted to {names}: {kelvin.size} points, {low:.4g} to {high:.4g} degC"


def _origins(section: str, numbers: Sequence[FittedParameter], source: str) -> dict[str, Origin]:
    return {
        f"{section}.{number.name}": Origin(source, "A", number.standard_error)
        if math.isfinite(number.standard_error)
        else Origin(f"{source}; this number was held, or the points leave it open", "B")
        for number in numbers
    }
