"""The job behind ``mrdamper fluid``: rheometer tables in, laws with standard errors and a fluid file out.

What the tables do not hold (a yield stress, a density) is taken from another fluid, with its sources; the
answer says which. Nothing is printed here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.rheometer import RheometerTable, read_rheometer
from mrdamper.errors import InputError
from mrdamper.models.fluids.carlson import field_strength, saturation_stress
from mrdamper.models.fluids.fluid import Fluid, Origin
from mrdamper.models.fluids.fluid_file import find_fluid, fluid_to_toml
from mrdamper.models.fluids.rheometer import FittedParameter
from mrdamper.models.fluids.viscosity_fit import ViscosityFit, ViscosityStudy, fit_viscosity
from mrdamper.models.fluids.yield_fit import YieldFit, YieldStudy, fit_yield_stress
from mrdamper.models.temperature import TemperatureFactor
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.outputs import atomic_output
from mrdamper.schema import Json

__all__ = ["FluidStudy", "fluid", "study_tables"]


@dataclass(frozen=True, slots=True)
class FluidStudy:
    """What rheometer tables say: the fits of what they hold, the fluid made of them, and notes."""

    fluid: Fluid
    like: Fluid
    viscosity: ViscosityStudy | None
    yield_stress: YieldStudy | None
    notes: tuple[str, ...]


def fluid(
    paths: Sequence[str | Path],
    *,
    out: Path | None = None,
    like: str = "paper",
    particle_fraction: float | None = None,
) -> Json:
    """Fit the laws of rheometer tables; with ``out`` write fluid.toml and fluid.svg there.

    Parameters
    ----------
    paths : tables of viscosity, of yield stress, or of both; several of one kind are taken together
    out : folder for the files
    like : preset or file of the fluid that gives what the tables do not hold
    particle_fraction : volume fraction of iron [-], which leads from flux density to field strength; that
        of ``like`` when not given
    """
    study = study_tables(paths, like=like, particle_fraction=particle_fraction)
    if out is not None:
        from mrdamper.report.figures.fluid import draw_fluid

        with atomic_output(out) as beside:
            (beside / "fluid.toml").write_text(fluid_to_toml(study.fluid), encoding="utf-8")
            picture = draw_fluid(study.viscosity, study.yield_stress, study.fluid.name)
            (beside / "fluid.svg").write_text(picture, encoding="utf-8")
    return {
        "fluid": study.fluid.name,
        "tables": [str(path) for path in paths],
        "viscosity": None if study.viscosity is None else _viscosity(study.viscosity),
        "yield_stress": None if study.yield_stress is None else _yield(study.yield_stress, study.fluid),
        "like": study.like.name,
        "valid_degC": _celsius(study.fluid.valid_K),
        "notes": list(study.notes),
        "file": None if out is None else str(out / "fluid.toml"),
        "picture": None if out is None else str(out / "fluid.svg"),
    }


def study_tables(
    paths: Sequence[str | Path], *, like: str = "paper", particle_fraction: float | None = None
) -> FluidStudy:
    """Read rheometer tables and fit what they hold."""
    base = find_fluid(like)
    if particle_fraction is not None:
        stated = Origin("given with the rheometer tables", "A")
        origins = {**base.origins, "properties.particle_fraction": stated}
        base = replace(base, particle_fraction=particle_fraction, origins=origins)
    tables = [read_rheometer(path) for path in paths]
    notes = [note for table in tables for note in table.notes]
    viscosity = _study_viscosity(tables)
    yields = _study_yield(tables, base, notes, assumed=particle_fraction is None)
    name = Path(paths[0]).stem
    fitted = _fluid_of(name, base, viscosity, yields, tables)
    notes += [*(() if viscosity is None else viscosity.notes), *(() if yields is None else yields.notes)]
    if fitted.valid_K != base.valid_K:
        low, high = _celsius(fitted.valid_K)
        notes.append(f"the laws hold no further than the tables: {low:g} to {high:g} degC")
    taken = [
        word for word, study in (("the viscosity", viscosity), ("the yield stress", yields)) if study is None
    ]
    kept = ", ".join([*taken, "density and heat properties"])
    notes.append(f"{kept}: not in the tables, taken from {base.name!r} with its sources")
    return FluidStudy(fitted, base, viscosity, yields, tuple(notes))


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
                + (f" (of {base.name!r}; ⟦--particle-fraction⟧ gives another)" if assumed else "")
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
            f"{place}: a field of {most:g} T; expected at most 5 T. Check the unit in the header (field_mT, "
            "field_T, field_kA_m)"
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


# ------------------------------------------------------------------------------------------- the answer


def _viscosity(study: ViscosityStudy) -> Json:
    best, used = study.best, study.used
    kelvin, measured = study.temperature_K, study.viscosity_Pa_s
    left_out = zip(kelvin[~used], measured[~used], best.value(kelvin[~used]), strict=True)
    return {
        **_viscosity_law(best),
        "points": int(np.count_nonzero(used)),
        "temperature_degC": _celsius((kelvin[used][0], kelvin[used][-1])),
        "left_out": [
            {
                "temperature_degC": round(float(at) - ZERO_CELSIUS_K, 6),
                "viscosity_Pa_s": float(value),
                "law_Pa_s": _finite(law),
            }
            for at, value, law in left_out
        ],
        "laws": [_viscosity_law(fit) for fit in study.fits],
    }


def _viscosity_law(fit: ViscosityFit) -> Json:
    return {"law": fit.factor.kind, **_law(fit)}


def _yield(study: YieldStudy, made: Fluid) -> Json:
    best = study.best
    kelvin = study.temperature_K[study.used]
    field = study.field_A_m[study.used]
    return {
        **_yield_law(best),
        "points": int(np.count_nonzero(study.used)),
        "temperature_degC": _celsius((float(kelvin.min()), float(kelvin.max()))),
        "field_A_m": [float(field.min()), float(field.max())],
        "particle_fraction": made.particle_fraction,
        "carrier_constant": best.field_law.saturation_Pa / saturation_stress(made.particle_fraction),
        "laws": [_yield_law(fit) for fit in study.fits],
    }


def _yield_law(fit: YieldFit) -> Json:
    return {"law": fit.name, **_law(fit)}


def _law(fit: ViscosityFit | YieldFit) -> Json:
    fall, error = fit.fall_percent()
    return {
        "numbers": {
            number.name: {
                "value": number.value,
                "unit": number.unit,
                "standard_error": _finite(number.standard_error),
            }
            for number in fit.parameters
        },
        "rms_percent": fit.rms_percent,
        "aicc": _finite(fit.aicc),
        "fall_20_to_100_degC_percent": _finite(fall),
        "fall_standard_error_percent": _finite(error),
        "limit": fit.limit or None,
    }


def _finite(value: float) -> float | None:
    """Return a number that JSON can hold, None for what is not finite."""
    return float(value) if math.isfinite(value) else None


def _celsius(ends_K: tuple[float, float]) -> list[float]:
    return [round(float(end) - ZERO_CELSIUS_K, 6) for end in ends_K]
