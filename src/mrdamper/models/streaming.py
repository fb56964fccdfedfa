"""A damper along a run that comes in batches, as an object that keeps the state between two of them."""

from __future__ import annotations

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import RunState, finish_run, simulate_batch

__all__ = ["CarriedRun"]


class CarriedRun:
    """A damper along one run: ``simulate_batch`` with its state.

    Raises
    ------
    InputError
        A law in Python, which runs whole only.
    """

    def __init__(self, damper: Damper, state: RunState | None = None) -> None:
        if damper.law.kernel is None:
            raise InputError(f"{damper.law.name}: a law in Python runs whole, not in batches")
        self._damper = damper
        self.state = RunState() if state is None else state

    def advance(self, batch: Trajectory) -> FloatArray:
        """Take the run's next samples; return the force [N] of those that are settled by now, shape (m,)."""
        force, self.state = simulate_batch(self._damper, batch, self.state)
        return force

    def finish(self) -> FloatArray:
        """Return the force [N] of the samples that are left, shape (m,): the run ends here."""
        force, self.state = finish_run(self._damper, self.state)
        return force
