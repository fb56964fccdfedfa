"""A damper along a run that comes in batches: state goes over from one to the next, memory stays that of one.

The force is that of the whole run, sample by sample and bit by bit, whatever the borders of the batches:
a sample is answered once no later one can change the piece of motion that it belongs to. Only the usual
form (``record``) of the kernel's laws; the per-sample form has no need of it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.models.actuation import Actuation, Applied
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import require_temperature, reversed_valve

__all__ = ["CarriedRun"]


class CarriedRun:
    """A damper along one run that comes in batches: the force of the whole run, sample by sample.

    Parameters
    ----------
    longest_step : longest step of the implicit laws [s]
    patience : samples that may be held back while the motion rests inside its dead band. Past that they are
        answered as the motion's going on has them; should it turn back after all, the force of those samples
        alone is off, by what a travel of the dead band makes of it.

    Raises
    ------
    InputError
        A law in Python, which has no carried form; a patience below one sample.
    """

    def __init__(
        self, damper: Damper, *, longest_step: float = core.LONGEST_STEP, patience: int = 1_000_000
    ) -> None:
        if damper.law.kernel is None:
            raise InputError(f"{damper.law.name}: a law in Python cannot be carried over batches")
        if patience < 1:
            raise InputError(f"patience is {patience} samples; expected 1 or more")
        self._damper, self._law = damper, damper.law.kernel
        self._longest_step, self._patience = longest_step, patience
        self._motion, self._state = np.zeros(core.MOTION_NUMBERS), np.zeros(core.STATE_NUMBERS)
        self._workspace = core.Workspace()
        self._applied: Applied | None = (
            None  # made at the first batch, whose step and dead band are the run's
        )
        self._step = self._dead_band = 0.0
        self._held: list[
            FloatArray
        ] = []  # x, v, a, applied command, temperature from the last settled sample on
        self._taken = self._answered = 0
        self._over = False

    @property
    def taken(self) -> int:
        """Samples given so far."""
        return self._taken

    @property
    def answered(self) -> int:
        """Samples whose force has been returned."""
        return self._answered

    def advance(self, batch: Trajectory) -> FloatArray:
        """Take the run's next samples; return the force [N] of those that are settled by now, shape (m,).

        They follow on the ones returned before. A sample behind the furthest point of the motion so far is
        settled once the motion goes on beyond that point, or turns back by more than the dead band.

        Raises
        ------
        InputError
            A batch of another step or dead band, or after the end; what ``simulate`` refuses.
        """
        if self._over:
            raise InputError("the run is over: finish was called; expected no further batch")
        if self._applied is None:
            self._applied = self._begin(batch.step, batch.dead_band)
        for name, mine in (("step", self._step), ("dead_band", self._dead_band)):
            if getattr(batch, name) != mine:
                raise InputError(
                    f"batch: {name} is {getattr(batch, name)}; expected the first batch's, {mine}"
                )
        require_temperature(self._damper, batch)
        warm = batch.temperature if self._damper.temperature_dependent else None
        new = [batch.displacement, batch.velocity, batch.acceleration, self._applied.on(batch.command)]
        new.append(np.empty(0) if warm is None else warm)
        self._taken += len(batch)
        return self._answer(new, last=False)

    def finish(self) -> FloatArray:
        """Return the force [N] of the samples that are left, shape (m,): the run ends here."""
        if self._over or not self._held:
            self._over = True
            return np.empty(0)
        self._over = True
        return self._answer([np.empty(0)] * len(self._held), last=True)

    def state(self) -> dict[str, FloatArray]:
        """Return all that goes over to the next batch as float64 arrays by name, for ``restored``."""
        numbers = [self._step, self._dead_band, self._taken, self._answered, self._over]
        kept = {"run": np.array(numbers, dtype=np.float64)}
        kept |= {"motion": self._motion.copy(), "law": self._state.copy()}
        if self._applied is not None:
            kept["applied"] = self._applied.state()
        return kept | {f"held_{k}": column.copy() for k, column in enumerate(self._held)}

    @classmethod
    def restored(
        cls,
        damper: Damper,
        state: Mapping[str, FloatArray],
        *,
        longest_step: float = core.LONGEST_STEP,
        patience: int = 1_000_000,
    ) -> CarriedRun:
        """Return the run of a kept state, with the damper that it was of: it goes on bit for bit.

        Raises
        ------
        InputError
            A part of the state is missing, or of another shape.
        """
        run = cls(damper, longest_step=longest_step, patience=patience)
        parts = {name: np.array(values, dtype=np.float64) for name, values in state.items()}
        expected = {"run": 5, "motion": core.MOTION_NUMBERS, "law": core.STATE_NUMBERS}
        for name, count in expected.items():
            if name not in parts or parts[name].shape != (count,):
                shape = parts[name].shape if name in parts else "not there"
                raise InputError(f"carried state: {name} is {shape}; expected {count} numbers")
        step, dead_band, taken, answered, over = parts["run"].tolist()
        run._motion, run._state = parts["motion"], parts["law"]
        run._taken, run._answered, run._over = int(taken), int(answered), bool(over)
        if "applied" in parts:
            run._applied = run._begin(step, dead_band)
            run._applied.restore(parts["applied"])
            run._held = [parts[f"held_{k}"] for k in range(5) if f"held_{k}" in parts]
            lengths = [len(column) for column in run._held]
            if len(lengths) != 5 or lengths[0] < 1 or len(set(lengths[:4])) != 1:
                raise InputError(
                    f"carried state: held columns have {lengths} samples; expected 5 of one length"
                )
        return run

    def _begin(self, step: float, dead_band: float) -> Applied:
        """Take step and dead band of the run, the first batch's; return what the law feels of its command."""
        self._step, self._dead_band, lag = step, dead_band, self._damper.command_lag_s
        return Applied(self._damper.actuation or Actuation(lag, lag), step)

    def _answer(self, new: list[FloatArray], *, last: bool) -> FloatArray:
        columns = [np.concatenate(pair) for pair in zip(self._held, new, strict=True)] if self._held else new
        coefficients = self._coefficients(columns[3], columns[4], columns[0])
        record = core.open_batch(
            self._step,
            (columns[0], columns[1], columns[2]),
            self._motion,
            dead_band=self._dead_band,
            longest_step=self._longest_step,
            patience=self._patience,
            last=last,
        )
        force = core.carry(self._law, record, coefficients, self._state, self._workspace)[record.behind :]
        keep = max(record.samples - 1, 0)
        self._held = [column[keep:].copy() for column in columns]
        self._answered += len(force)
        return force

    def _coefficients(self, command: FloatArray, temperature: FloatArray, x: FloatArray) -> FloatArray:
        """Return the law's coefficients, shape (m,) where nothing moves them, else (m, n)."""
        damper = self._damper
        warm = temperature if len(temperature) else None
        if np.ptp(command) == 0.0 and (warm is None or np.ptp(warm) == 0.0):
            command, warm = command[:1], None if warm is None else warm[:1]
        found = damper.coefficients_at(command, warm)
        violations = damper.law.violations(dict(zip(damper.law.names, found, strict=True)))
        violations += reversed_valve(damper, found, x)
        if violations:
            raise InputError("; ".join(violations))
        return np.ascontiguousarray(found[:, 0] if len(command) == 1 else found)
