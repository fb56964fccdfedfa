"""Define a hysteresis law in Python (a slipping spring), and fit it to runs of the virtual rig.

python examples/custom_law.py    (your own files: mrdamper fit DIR --law examples/custom_law.py:Slipping ...)
"""

import mrdamper
from mrdamper.models.laws import Coefficient
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import find_preset

Values = dict[str, float]


class Slipping:
    """A slipping spring with a dashpot in parallel. The state z is spring travel / yield displacement."""

    name = "slipping"
    coefficients = (
        Coefficient("yield_force", "N", "force at which the spring slips", linear=True, lower=0.0, upper=1e4),
        Coefficient("viscosity", "N s/m", "damping of the dashpot", linear=True, lower=0.0, upper=1e5),
        Coefficient("rho", "1/m", "inverse yield displacement", linear=False, lower=10.0, upper=1e5),
    )

    def rate(self, z: float, x: float, v: float, values: Values) -> float:
        return values["rho"] * (v - abs(v) * z)

    def force(self, z: float, x: float, v: float, values: Values) -> float:
        return values["yield_force"] * z + values["viscosity"] * v


if __name__ == "__main__":
    tests = Campaign(
        motions=("sine3mm2Hz",), currents_A=(0.0, 1.0), temperatures_degC=(20.0,), steps=None, duration_s=1.0
    )
    runs = [run for run, _ in measure(find_preset("nominal"), tests)]
    fitted = mrdamper.fit(runs, Slipping, temperature="none")
    print(f"error {fitted.cost_percent:.2f} % in {fitted.cpu_s:.0f} s")
