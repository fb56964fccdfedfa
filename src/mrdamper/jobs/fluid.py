"""The job ``fluid``: fit viscosity and yield-stress laws to rheometer tables, and build a fluid from them.

Properties that the tables do not contain are copied from another fluid. A note lists these properties.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.rheometer import RheometerTable
from mrdamper.errors import InputError
from mrdamper.models.fluids.carlson import field_strength
from mrdamper.models.fluids.fits import Study, fit_viscosity, fit_yield_stress
from mrdamper.models.fluids.fluid import Fluid
from mrdamper.models.temperature import TemperatureFactor
from mrdamper.quantities import to_degC
from mrdamper.results import JobResult


@dataclass(frozen=True, slots=True, repr=False)
class FluidResult(JobResult):
    """The fits of rheometer tables, the resulting fluid, and notes."""

    _job = "fluid"
    fluid: Fluid
    like: Fluid  # fluid that provides the properties missing in the tables
    viscosity: Study | None  # compared fits of the viscosity; None if no table has viscosities
    yield_stress: Study | None  # compared fits of the yield stress; None if no table has yield stresses
    notes: tuple[str, ...]


def fluid(tables: Sequence[RheometerTable], like: Fluid) -> FluidResult:
    """Fit viscosity and yield stress to rheometer tables; return the fits and a fluid with the best laws.

    Parameters
    ----------
    tables : tables of viscosity, of yield stress, or of both; tables of one quantity are fitted together
    like : fluid that provides the properties missing in the tables

    Raises
    ------
    InputError
        If no law can be fitted to the tables.
    """
    notes = [note for table in tables for note in table.notes]
    viscosity = _study_viscosity(tables)
    yields = _study_yield_stress(tables, like, notes)
    fitted, sources = like, []
    if viscosity is not None:
        best, kelvin = viscosity.best, viscosity.temperature_K[viscosity.used]
        sources.append(f"Viscosity: {best.name} law fitted to {kelvin.size} points.")
        fitted = replace(
            fitted,
            viscosity_Pa_s=best.at_reference,
            viscosity_factor=best.factor,
            viscosity_fitted_K=(float(kelvin[0]), float(kelvin[-1])),
            collapse=None,  # ``like.collapse`` is relative to the viscosity of ``like``.
            valid_K=_valid_range(fitted.valid_K, best.factor, kelvin),
        )
        notes += viscosity.notes
    if yields is not None and yields.best.field_law is not None:
        kelvin = yields.temperature_K[yields.used]
        sources.append(f"Yield stress: {yields.best.name} law fitted to {kelvin.size} points.")
        fitted = replace(
            fitted,
            yield_field=yields.best.field_law,
            yield_factor=yields.best.factor,
            valid_K=_valid_range(fitted.valid_K, yields.best.factor, kelvin),
        )
        notes += yields.notes
    if fitted.valid_K != like.valid_K:
        low, high = map(to_degC, fitted.valid_K)
        notes.append(f"the laws are valid in the range of the tables only: {low:.4g} to {high:.4g} degC")
    missing = [name for name, study in (("viscosity", viscosity), ("yield stress", yields)) if study is None]
    kept = ", ".join([*missing, "density", "heat properties"])
    notes.append(f"not in the tables, therefore those of {like.name!r}: {kept}")
    names = ", ".join(table.name for table in tables)
    fitted = replace(
        fitted,
        name=PurePath(tables[0].name).stem,
        title=f"Fitted to {names}; the rest as {like.name}",
        source=" ".join([f"Tables: {names}.", *sources, f"The rest as {like.name}."]),
    )
    return FluidResult(fitted, like, viscosity, yields, tuple(notes))


def _study_viscosity(tables: Sequence[RheometerTable]) -> Study | None:
    found = [(table.name, table.viscosity) for table in tables if table.viscosity is not None]
    if not found:
        return None
    kelvin, viscosity = (np.concatenate([columns[k] for _, columns in found]) for k in (0, 1))
    return fit_viscosity(kelvin, viscosity, place=", ".join(name for name, _ in found))


def _study_yield_stress(tables: Sequence[RheometerTable], like: Fluid, notes: list[str]) -> Study | None:
    found = [(table, table.yield_stress) for table in tables if table.yield_stress is not None]
    if not found:
        return None
    fields = []
    for table, (field, _, _) in found:
        if table.field_unit == "T":
            fields.append(_field_strength(field, like.particle_fraction, table.name))
            iron = f"{100.0 * like.particle_fraction:g} % of iron by volume"
            notes.append(f"{table.name}: flux density is converted to field strength with {iron}")
        else:
            fields.append(field)
    kelvin, stress = (np.concatenate([columns[k] for _, columns in found]) for k in (1, 2))
    place = ", ".join(table.name for table, _ in found)
    return fit_yield_stress(np.concatenate(fields), kelvin, stress, place=place)


def _field_strength(flux_density_T: FloatArray, particle_fraction: float, place: str) -> FloatArray:
    flux_density_max_T = 5.0  # No rheometer reaches a larger value. Such a value indicates a wrong unit.
    largest = float(np.abs(flux_density_T).max())
    if largest > flux_density_max_T:
        raise InputError(
            f"a field of {largest:g} T",
            place=place,
            expected=f"at most {flux_density_max_T:g} T",
            remedy="Check the unit in the header (field_mT, field_T, field_kA_m)",
        )
    return field_strength(flux_density_T, particle_fraction)


def _valid_range(
    valid_K: tuple[float, float], factor: TemperatureFactor, kelvin: FloatArray
) -> tuple[float, float]:
    """Return ``valid_K`` if the fit is positive there, else the measured range [K]."""
    with np.errstate(all="ignore"):
        values = factor.value(np.linspace(*valid_K, 101))
    is_positive = bool((np.isfinite(values) & (values > 0.0)).all())
    return valid_K if is_positive else (float(kelvin.min()), float(kelvin.max()))
